"""Furniture is pushed against other furniture where nothing else helps, and only there."""

from __future__ import annotations

import numpy as np

from pbrl_namo.beliefs import ObjectBelief, belief_of_draws
from pbrl_namo.manipulation import ManipulationSettings
from pbrl_namo.planner import plan
from pbrl_namo.regions import free_space
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.settings import LastResortSettings, NamoSettings

LOOKS = ManipulationSettings(worlds=12)
GENTLE = NamoSettings(manipulation=LOOKS, last_resort=LastResortSettings(margins=(), pushing=False))
LAST = NamoSettings(manipulation=LOOKS.model_copy(update={"pushing": True}), last_resort=LastResortSettings(margins=()))


def box(width: float, height: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    return np.array([[-width, -height], [width, -height], [width, height], [-width, height]]) / 2.0 + [x, y]


def corridor(chair: bool = True) -> NamoScene:
    """A door into a corridor that a table fills, too wide for the door and to be turned, a chair close behind it."""
    walls = {
        "low": box(0.1, 1.925, 6.05, 0.9625),
        "high": box(0.1, 1.925, 6.05, 4.0375),
        "below": box(1.5, 1.55, 6.85, 0.775),
        "above": box(1.5, 1.55, 6.85, 4.225),
    }
    movable = {"table": Movable(box(1.2, 1.5), 0.7775, 33.0)}
    poses = {"table": np.array([6.85, 2.5, 0.0])}
    if chair:
        movable["chair"], poses["chair"] = Movable(box(0.5, 0.5), 0.7775, 14.0), np.array([7.8, 2.5, 0.0])
    start, goal = np.array([3.0, 2.5, 0.0]), np.array([8.6, 0.6, np.nan])
    return NamoScene.of(box(12.0, 5.0, 6.0, 2.5), walls, movable, poses, start, goal)


def beliefs_of(scene: NamoScene, friction: float = 0.02) -> dict[str, ObjectBelief]:
    names = ("mass", "mu_ground")
    found = {
        name: belief_of_draws(each, names, np.array([[each.mass, 0.02]] * 12)) for name, each in scene.movable.items()
    }
    if "chair" in found:
        found["chair"] = belief_of_draws(scene.movable["chair"], names, np.array([[14.0, friction]] * 12))
    return found


def test_what_stands_behind_what_is_pushed_goes_before_it() -> None:
    scene = corridor()
    given_up = plan(scene, beliefs_of(scene), 0, GENTLE)
    assert given_up.chosen is None
    found = plan(scene, beliefs_of(scene), 0, LAST)
    assert found.chosen is not None and found.chosen.plan is not None, found.reason
    made = found.chosen.plan
    assert (made.object, made.pushes) == ("table", ("chair",))
    assert found.chosen.probability > 0.7
    assert made.highest_force < LOOKS.constraints.grip_force
    rubbing = plan(scene, beliefs_of(scene, friction=0.2), 0, LAST)
    assert rubbing.chosen is not None and rubbing.chosen.plan is not None
    assert rubbing.chosen.plan.expected_force > made.expected_force + 10.0, "what is pushed resists too"


def test_what_is_too_heavy_to_be_pushed_is_left_where_it_is() -> None:
    scene = corridor()
    beliefs = beliefs_of(scene)
    beliefs["chair"] = belief_of_draws(scene.movable["chair"], ("mass", "mu_ground"), np.array([[150.0, 0.3]] * 12))
    assert plan(scene, beliefs, 0, LAST).chosen is None


def test_nothing_is_pushed_where_something_gentler_helps() -> None:
    scene = corridor(chair=False)
    for settings in (GENTLE, LAST):
        found = plan(scene, beliefs_of(scene), 0, settings)
        assert found.chosen is not None and found.chosen.plan is not None
        assert found.chosen.plan.pushes == ()


def test_with_a_last_resort_this_comes_last() -> None:
    levels = NamoSettings().harder()
    assert [each.manipulation.pushing for each in levels] == [False, True]
    assert not NamoSettings().manipulation.pushing
    assert free_space(corridor()).index(np.array([3.0, 2.5])) != free_space(corridor()).index(np.array([8.6, 0.6]))
