"""Sentences follow from posterior and geometry."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pbrl_bringup.verdict import (
    ahead_verdict,
    hinge_verdict,
    learning_verdict,
    place_name,
    spread_radius,
    wheel_verdict,
)

TABLE = np.array([[-0.6, -0.4], [0.6, -0.4], [0.6, 0.4], [-0.6, 0.4]])
CASTERS = np.array([[-0.5, -0.3], [0.5, -0.3], [0.5, 0.3], [-0.5, 0.3]])


def wheel_draws(x: float, y: float, sd: float, mu: float = 0.4) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    points = np.array([x, y]) + sd * rng.standard_normal((400, 2))
    friction = np.full(400, mu)
    return {"wheel_x": points[:, 0], "wheel_y": points[:, 1], "mu_x": friction, "mu_y": friction}


@pytest.mark.parametrize(
    ("point", "name"),
    [((-0.5, 0.3), "rear-left"), ((0.5, 0.0), "front"), ((0.0, -0.3), "right"), ((0.01, 0.01), "middle")],
)
def test_places_have_names(point: tuple[float, float], name: str) -> None:
    assert place_name(point, TABLE) == name


def test_names_go_with_the_outline_not_with_its_origin() -> None:
    assert place_name((0.0, 0.0), TABLE + np.array([0.6, 0.0])) == "rear"


def test_a_place_close_to_a_caster_is_called_by_it() -> None:
    text = wheel_verdict("table", wheel_draws(-0.51, 0.3, 0.005), TABLE, CASTERS)
    assert text.startswith("The table’s rear-left caster is stuck")
    assert re.search(r"a point 1\.\d cm from it", text)


def test_a_place_far_from_casters_is_not() -> None:
    text = wheel_verdict("table", wheel_draws(0.0, 0.3, 0.005), TABLE, CASTERS)
    assert "at its left, 30 cm from the middle" in text


def test_no_friction_means_nothing_holds_it() -> None:
    assert "rolls freely" in wheel_verdict("cart", wheel_draws(0.5, 0.3, 0.2, mu=0.005), TABLE, CASTERS)


def test_a_wheel_of_no_certain_place_is_not_called_a_stuck_caster() -> None:
    """What a free table's posterior looks like: it rolls along, and the place is as wide as the table."""
    draws = wheel_draws(-0.35, 0.1, 0.3) | {"mu_x": np.full(400, 0.003)}
    text = wheel_verdict("table", draws, TABLE, CASTERS)
    assert text.startswith("Nothing holds the table in place: it rolls") and "stuck" not in text
    held = wheel_verdict("table", wheel_draws(-0.35, 0.1, 0.3, mu=0.2), TABLE, CASTERS)
    assert "does not say where" in held and "stuck" not in held


def test_a_wheel_that_rolls_one_way_is_not_stuck() -> None:
    draws = wheel_draws(-0.51, 0.3, 0.01) | {"mu_x": np.full(400, 0.003)}
    text = wheel_verdict("table", draws, TABLE, CASTERS)
    assert "at its rear-left caster: a wheel there rolls and does not swivel" in text and "stuck" not in text


def test_a_hinge_has_a_radius() -> None:
    radius = np.array([0.299, 0.301])
    assert (
        hinge_verdict("door", {"hinge_radius": radius})
        == "The door turns on a hinge 30 cm from where it was held (± 0.2 cm)."
    )


def test_learning_that_does_not_help_is_said_so() -> None:
    assert "did not help" in learning_verdict(0.01, 0.02, 9.8, fitted=True)
    text = learning_verdict(0.2, 0.02, 9.8, fitted=False)
    assert "the end of a push of 10 seconds it had not seen was predicted 20 cm off before learning" in text
    assert ahead_verdict(2.0, 0.31, 0.04) == "Looking 2 seconds ahead it was 31 cm off and is 4.0 cm off."


def test_spread_radius_is_that_of_a_ring() -> None:
    angle = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    ring = 0.03 * np.column_stack([np.cos(angle), np.sin(angle)]) + [1.0, 2.0]
    assert spread_radius(ring) == pytest.approx(0.03)
