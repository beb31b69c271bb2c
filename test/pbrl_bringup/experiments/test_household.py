"""Household objects: what the file says is what is simulated, and what cannot be is refused in one line."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.household import DT, PUSH_STEPS, gather, load_household, parse_household
from pbrl_model.errors import ModelError
from pbrl_model.geometry import mass_properties
from pbrl_model.parameters import KERNEL_COLUMNS
from pbrl_model.transitions.problem import simulate

VALUES: dict[str, Any] = {
    "objects": {"box": {"footprint": [[0, 0], [1, 0], [1, 1], [0, 1]], "push": {"force": 5.0, "torque": 1.0}}},
    "concealed": {"box": {"mass": 4.0, "pivot": [0.2, 0.3]}},
}


def test_ten_objects_five_of_them_constrained() -> None:
    things = list(load_household().values())
    assert [each.truth.has_wheel or each.truth.has_hinge for each in things] == [True] * 5 + [False] * 5


@pytest.mark.parametrize("name", list(load_household()))
def test_pushes_are_those_of_the_kernel_within_a_tenth_of_a_millimetre(name: str) -> None:
    thing = load_household()[name]
    data = gather(np.random.default_rng(0), thing, 6).body(0)
    body = mass_properties(thing.geometry.footprint)
    row = thing.truth.to_vector()[None]
    end = simulate(row, data.start, data.wrench, data.duration, body, DT, parallel=False)[0]
    np.testing.assert_allclose(end[:, :3], data.end[:, :3], atol=1e-4)
    np.testing.assert_allclose(data.duration, DT * PUSH_STEPS)


def test_a_hinge_stays_where_it_is_over_episodes() -> None:
    thing = load_household()["kitchen_table"]
    start = gather(np.random.default_rng(1), thing, 9).body(0).start
    anchor = thing.truth.to_vector()[[KERNEL_COLUMNS.index("anchor_x"), KERNEL_COLUMNS.index("anchor_y")]]
    arm = anchor - mass_properties(thing.geometry.footprint).com
    c, s = np.cos(start[:, 2]), np.sin(start[:, 2])
    place = start[:, :2] + np.column_stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
    np.testing.assert_allclose(place, 0.0, atol=1e-3)


def test_learners_are_not_told_the_mass() -> None:
    assert all(np.isnan(each.geometry.nominal_mass) for each in load_household().values())


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("concealed", "box", "mass"), -1.0, "mass"),
        (("concealed", "box", "weight"), 1.0, "weight"),
        (("concealed", "chair"), {"mass": 1.0}, "chair"),
        (("objects", "box", "footprint"), [[0, 0], [1, 1], [1, 0], [0, 1]], "cross"),
        (("objects", "box", "push", "force"), float("nan"), "force"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(path: tuple[str, ...], value: object, said: str) -> None:
    values = copy.deepcopy(VALUES)
    parse_household(values)
    inner = values
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    with pytest.raises(ModelError, match=said) as caught:
        parse_household(values)
    assert "\n" not in str(caught.value)


def test_an_unknown_file_is_told() -> None:
    with pytest.raises(BringupError, match="did you mean 'household'"):
        load_household("houshold")
