"""Contact sectors: which side touches, whatever way the body is turned; hostile input."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.baselines.sectors import ContactSectors
from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

BOX = np.array([[-0.5, -0.3], [0.5, -0.3], [0.5, 0.3], [-0.5, 0.3]])
WALL = [[[2.0, -9.0], [2.0, 9.0]]]


def at(*poses: tuple[float, float, float]) -> Array:
    """Return one state (1, K, 6) of bodies at rest."""
    return np.array([[[*pose, 0.0, 0.0, 0.0] for pose in poses]])


@pytest.mark.parametrize(("theta", "side"), [(0.0, 0), (-np.pi / 2, 1), (np.pi, 2), (np.pi / 2, 3)])
def test_the_side_that_faces_the_wall_is_in_contact(theta: float, side: int) -> None:
    half = 0.5 if side % 2 == 0 else 0.3
    contacts = ContactSectors([BOX], WALL).contacts(at((2.0 - half - 0.1, 0.0, theta)))
    np.testing.assert_array_equal(contacts[0, 0], np.arange(4) == side)


def test_a_wall_out_of_reach_touches_nothing() -> None:
    assert not ContactSectors([BOX], WALL).contacts(at((1.2, 0.0, 0.0))).any()
    assert ContactSectors([BOX], WALL, radius=0.31).contacts(at((1.2, 0.0, 0.0))).any()


def test_two_bodies_touch_each_other_each_with_its_own_side() -> None:
    contacts = ContactSectors([BOX, BOX]).contacts(at((0.0, 0.0, 0.0), (1.1, 0.0, np.pi)))[0]
    np.testing.assert_array_equal(contacts, [[True, False, False, False], [True, False, False, False]])


def test_a_body_inside_another_is_in_contact() -> None:
    large = 20.0 * BOX
    assert ContactSectors([BOX, large]).contacts(at((0.0, 0.0, 0.3), (0.5, 0.5, 0.0)))[0, 0].all()


def test_sectors_turn_with_the_body_about_its_centre_of_mass() -> None:
    rng = np.random.default_rng(0)
    sectors = ContactSectors([BOX + np.array([3.0, 1.0])], WALL)
    poses = np.column_stack([rng.uniform(1.0, 1.9, 50), rng.normal(size=50), rng.uniform(-3, 3, 50)])
    states = np.column_stack([poses, np.zeros((50, 3))])[:, None]
    np.testing.assert_array_equal(sectors.contacts(states), ContactSectors([BOX], WALL).contacts(states))


def test_many_states_at_once_are_the_states_one_by_one() -> None:
    rng = np.random.default_rng(1)
    sectors = ContactSectors([BOX, 0.5 * BOX, BOX], WALL, sectors=6, rays=4)
    states = rng.uniform(-2.0, 2.0, (40, 3, 6))
    alone = np.concatenate([sectors.conditions(states[[row]]) for row in range(40)])
    np.testing.assert_array_equal(sectors.conditions(states), alone)
    assert alone.any()
    assert not alone.all()


@pytest.mark.parametrize(
    "options", [{"sectors": 0}, {"rays": 0}, {"radius": 0.0}, {"radius": float("nan")}, {"walls": np.zeros((2, 2))}]
)
def test_bad_options_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(ModelError, match="sectors: expected"):
        ContactSectors([BOX], **options)  # type: ignore[arg-type]


def test_bad_states_and_outlines_are_refused() -> None:
    with pytest.raises(ModelError, match=r"\(n, 1, 6\)"):
        ContactSectors([BOX]).contacts(np.zeros((1, 2, 6)))
    with pytest.raises(ModelError, match="cross"):
        ContactSectors([BOX[[0, 2, 1, 3]]])
