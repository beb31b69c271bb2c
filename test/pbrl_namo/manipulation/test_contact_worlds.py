"""Contact worlds: what is carried goes as told, what it meets is pushed by Coulomb's law, and a wall holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.planar import compose
from pbrl_model.kernel import GRAVITY
from pbrl_model.parameters import BodyParameters
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation.contact_worlds import SMOOTH, ContactWorlds
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.stances import Stances
from pbrl_namo.scene import Movable, NamoScene

SETTINGS = ManipulationSettings()
AHEAD = np.array([0.1, 0.0, 0.0])
MASS = 14.0
HALVES = 0.4 + 0.25
"""Of table and chair [m]."""


def box(width: float, height: float) -> np.ndarray:
    return 0.5 * np.array([[-width, -height], [width, -height], [width, height], [-width, height]])


def scene_of(gap: float = 0.1, room: float = 12.0, at: np.ndarray | None = None) -> NamoScene:
    """A table with a chair behind it, in a room; all of it moved to a pose."""
    frame = np.zeros(3) if at is None else at
    movable = {"table": Movable(box(0.8, 1.6), 0.7775, 33.0), "chair": Movable(box(0.5, 0.5), 0.7775, MASS)}
    places = {"table": np.array([0.0, 0.0, 0.0]), "chair": np.array([HALVES + gap, 0.0, 0.0])}
    walls = np.array([compose(frame, np.array([*corner, 0.0]))[:2] for corner in box(room, 5.0)])
    poses = {name: compose(frame, pose) for name, pose in places.items()}
    start = compose(frame, np.array([-1.5, 0.0, 0.0]))
    return NamoScene.of(walls, {}, movable, poses, start, np.array([*frame[:2], np.nan]))


def chairs(frictions: Sequence[float]) -> list[ObjectModel]:
    return [ObjectModel.uniform(BodyParameters(mass=MASS, mu_ground=mu), box(0.5, 0.5)) for mu in frictions]


def behind(scene: NamoScene) -> np.ndarray:
    """The base in the table's frame, who holds the middle of the face away from the chair."""
    grasps = [each for each in Stances.of(scene, "table", 0.3, SETTINGS.grasping).grasps if len(each.sides) == 2]
    return min(grasps, key=lambda each: float(np.hypot(*(each.base[:2] - [-1.2, 0.0])))).base


def carried(scene: NamoScene, frictions: Sequence[float], seconds: float, twist: np.ndarray = AHEAD):
    worlds = ContactWorlds(scene, "table", {"chair": chairs(frictions)}, SETTINGS)
    return worlds.carry(behind(scene), [(twist, seconds)])


def test_what_is_pushed_resists_with_its_friction_and_is_pushed_as_far_as_it_is_in_the_way() -> None:
    frictions = (0.1, 0.3, 0.5)
    found = carried(scene_of(gap=0.2), frictions, 10.0)
    np.testing.assert_allclose(found.end, [1.0, 0.0, 0.0], atol=1e-3)
    friction, impact = MASS * GRAVITY * np.array(frictions), MASS * AHEAD[0] / SMOOTH
    assert (found.force > 0.99 * friction).all()
    assert (found.force < friction + 1.05 * impact).all()
    np.testing.assert_allclose(found.poses["chair"][:, 0], 1.0 + HALVES, atol=0.06)
    assert found.moved("chair", scene_of(gap=0.2).poses["chair"]).all()


def test_what_is_not_met_stays_and_takes_nothing() -> None:
    scene = scene_of(gap=1.5)
    found = carried(scene, (0.1,), 10.0)
    assert found.force[0] < 1e-3
    np.testing.assert_allclose(found.poses["chair"][0], scene.poses["chair"], atol=1e-6)
    assert not found.moved("chair", scene.poses["chair"]).any()


def test_what_is_pressed_against_a_wall_takes_more_than_any_gripper_has() -> None:
    found = carried(scene_of(room=4.0), (0.1,), 15.0)
    assert found.force[0] > 10.0 * SETTINGS.constraints.grip_force


def test_a_turn_goes_on_its_circle_and_the_force_is_of_what_is_met_alone() -> None:
    twist = np.array([0.05, 0.0, 0.1])
    alone = carried(scene_of(gap=3.0), (0.5,), 6.0, twist)
    radius, angle = 0.5, 0.6
    np.testing.assert_allclose(alone.end, [radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle], atol=2e-3)
    assert alone.force[0] < 1.0
    met = carried(scene_of(gap=0.05), (0.5,), 6.0, twist)
    assert 10.0 < met.force[0] < 2.0 * MASS * GRAVITY * 0.5


def test_where_the_room_lies_and_how_it_is_turned_does_not_matter() -> None:
    frame = np.array([3.0, -7.0, 2.0])
    here, there = scene_of(), scene_of(at=frame)
    one, other = (carried(scene, (0.2,), 8.0) for scene in (here, there))
    np.testing.assert_allclose(compose(frame, one.end), other.end, atol=1e-4)
    np.testing.assert_allclose(compose(frame, one.poses["chair"][0]), other.poses["chair"][0], atol=5e-3)
    np.testing.assert_allclose(one.force, other.force, rtol=0.05)


def test_same_worlds_same_bytes_and_each_is_its_own() -> None:
    both = carried(scene_of(), (0.1, 0.4), 5.0)
    again = carried(scene_of(), (0.1, 0.4), 5.0)
    assert both.poses["chair"].tobytes() == again.poses["chair"].tobytes()
    assert both.force.tobytes() == again.force.tobytes()
    assert carried(scene_of(), (0.4,), 5.0).force[0] == pytest.approx(both.force[1], rel=1e-6)


def test_who_asks_without_others_or_of_different_worlds_is_told() -> None:
    scene = scene_of()
    for models in ({}, {"chair": []}, {"table": chairs((0.1,))}):
        with pytest.raises(NamoError, match="contact worlds"):
            ContactWorlds(scene, "table", models, SETTINGS)
    with pytest.raises(NamoError, match="arms that reach"):
        ContactWorlds(scene, "table", {"chair": chairs((0.1,))}, SETTINGS).carry(
            np.array([-3.0, 0.0, 0.0]), [(AHEAD, 1.0)]
        )
