"""Domains from YAML: what is built, and one line for every fault."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pbrl_model.agents.domain import ActionSet, Domain, Thing, centred
from pbrl_model.agents.domain_file import load_domain, parse_domain
from pbrl_model.errors import ModelError

CONFIG = Path(__file__).resolve().parents[3] / "config" / "experiments"


def raw(name: str = "shopping_cart") -> dict[str, Any]:
    return yaml.safe_load((CONFIG / f"{name}.yaml").read_text())


def test_the_cart_is_that_of_figure_22(cart: Domain) -> None:
    (thing,) = cart.scene.things
    truth = cart.truth["cart"].parameters
    rear = thing.footprint[:, 0].min()
    assert truth.wheel_x == pytest.approx(rear) and truth.wheel_y == pytest.approx(0.0)  # in the handle's axis
    assert truth.mu_y > 10 * truth.mu_x
    assert cart.actions is not None and len(cart.actions) == 16
    assert np.isnan(thing.goal.pose[2]) if thing.goal else False


def test_the_apartment_has_the_classes_of_figure_22(apartment: Domain) -> None:
    truth = {name: physics.parameters for name, physics in apartment.truth.items()}
    assert len(truth) == len(apartment.scene.things) == 11
    assert {name for name, each in truth.items() if each.has_wheel} == {"dining_table", "office_desk"}
    assert {name for name, each in truth.items() if each.has_hinge} == {"kitchen_table"}
    chairs = [each.mass for name, each in truth.items() if name.startswith("chair")]
    assert min(truth["couch"].mass, truth["bed"].mass) > 8 * max(chairs)


def test_the_pivot_lies_on_the_floor_where_the_body_puts_it(apartment: Domain) -> None:
    truth = apartment.truth["kitchen_table"].parameters
    np.testing.assert_allclose([truth.hinge_x, truth.hinge_y], [6.6 - 0.4, 2.2 - 0.25])


def test_footprints_are_about_the_centre_of_mass() -> None:
    shape = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    footprint, com = centred(shape)
    np.testing.assert_allclose(com, [2 / 3, 1 / 3])
    np.testing.assert_allclose(footprint + com, shape, atol=1e-12)
    with pytest.raises(ModelError, match="about its centre of mass"):
        Thing("off", shape, np.zeros(3))


def change(values: dict[str, Any], path: str, new: object) -> dict[str, Any]:
    *steps, last = path.split(".")
    inner = values
    for step in steps:
        inner = inner[step]
    inner[last] = new
    return values


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        ("stepz", 3, "did you mean 'steps'"),
        ("objects.cart.gaol", {}, "did you mean 'goal'"),
        ("concealed.cart.wheel.acros", 0.3, "did you mean 'across'"),
        ("concealed.cart.mass", -1.0, "concealed.cart.mass"),
        ("concealed.cart.floor_friction", 1.5, "floor_friction"),
        ("objects.cart.start", [0.0, 0.0], "objects.cart.start"),
        ("objects.cart.start", [0.0, float("nan"), 0.0], "objects.cart.start"),
        ("objects.cart.footprint", [[0, 0], [1, 1], [1, 0], [0, 1]], "edges that do not cross"),
        ("room.outline", [[0, 0], [1, 0]], "room.outline"),
        ("room.walls", [[[0, 0], [1, 1], [1, 0], [0, 1]]], "edges that do not cross"),
        ("concealed.trolley", {"mass": 1.0}, "'trolley' not in `objects`"),
        ("concealed", {}, "'cart' not in `concealed`"),
        ("actions.duration", [0.0], "actions.duration"),
        ("noise", -0.1, "noise"),
    ],
)
def test_a_fault_is_one_line_that_names_it(path: str, value: object, told: str) -> None:
    with pytest.raises(ModelError) as error:
        parse_domain(change(raw(), path, value), "file.yaml")
    assert told in str(error.value) and str(error.value).startswith("file.yaml: ")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "write",
    [
        lambda path: None,
        lambda path: path.write_text("- just\n- a list"),
        lambda path: path.write_text("a: [1"),
        lambda path: path.write_bytes(b"\xff\xfe\x00"),
        lambda path: path.write_text(""),
    ],
)
def test_a_file_that_is_none_is_one_line(write: Callable[[Path], object], tmp_path: Path) -> None:
    path = tmp_path / "domain.yaml"
    write(path)
    with pytest.raises(ModelError) as error:
        load_domain(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_actions_are_checked_and_turned_with_the_body() -> None:
    actions = ActionSet(np.array([[1.0, 2.0, 3.0]]), np.array([0.2]))
    np.testing.assert_allclose(actions.in_world(0, np.pi / 2), [-2.0, 1.0, 3.0], atol=1e-12)
    with pytest.raises(ModelError, match="actions: expected"):
        ActionSet(np.zeros((2, 3)), np.zeros(2))
    with pytest.raises(ModelError, match="actions: expected"):
        ActionSet(np.zeros((2, 2)), np.ones(2))
