"""Rollouts: nothing is passed through, nothing comes nearer, and what is said to be open is."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from manipulation_rooms import ANGLED, HOLLOW, box, screw_closed, two_tables

from pbrl_control.planar import compose
from pbrl_namo.manipulation import ManipulationSettings, Yard
from pbrl_namo.manipulation.body import Body
from pbrl_namo.manipulation.grasps import Grasp, reachable_grasps
from pbrl_namo.manipulation.rollout import Roller, aside, base_twists, timing
from pbrl_namo.manipulation.settings import MotionSettings
from pbrl_namo.regions import Opening, build_roadmap, free_space
from pbrl_namo.scene import Movable, NamoScene

SETTINGS = ManipulationSettings()
RADIUS = 0.52
STRAIGHT = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])


def roller_of(
    scene: NamoScene, name: str, side: float = 0.0, settings: ManipulationSettings = SETTINGS
) -> tuple[Roller, tuple[Grasp, ...]]:
    """Return what follows commands of a thing, gripped from the region in which the robot is."""
    free, roadmap = free_space(scene, RADIUS), build_roadmap(scene, np.random.default_rng(0))
    start = free.index(scene.start[:2])
    assert start is not None
    grasps = reachable_grasps(scene, roadmap, name, start, settings)
    assert grasps
    opening = Opening(start, 1 - start, name)
    target = np.array([5.2, 2.0]) if not side else np.array([side, 2.0])
    return Roller(
        Yard.of(scene, RADIUS, 0.025), opening, Body.of(scene.movable[name].footprint), grasps, target, settings
    ), grasps


def everything(roller: Roller, twists: np.ndarray) -> np.ndarray:
    return np.ones((len(twists), len(roller.grasps)), dtype=bool)


@pytest.mark.parametrize("name", ["square", "long"])
@pytest.mark.parametrize("shape", [None, ANGLED, HOLLOW])
def test_what_moves_touches_nothing_and_stops_only_where_it_would(name: str, shape: np.ndarray | None) -> None:
    scene = two_tables()
    if shape is not None:
        thing = Movable(0.75 * shape)
        scene = NamoScene.of(
            box(6.0, 4.0, (3.0, 2.0)), {}, {**scene.movable, name: thing}, scene.poses, scene.start, scene.goal
        )
    roller, grasps = roller_of(scene, name)
    twists = np.vstack((STRAIGHT, [[0.0, 0.0, 1.0], [0.3, -0.2, -1.0]]))
    found = roller.roll(twists, everything(roller, twists))
    others = shapely.union_all([outline for other, outline in scene.outlines.items() if other != name])
    pose = scene.poses[name]
    motion = SETTINGS.motion
    for c, g in np.ndindex(found.went.shape):
        for share in np.linspace(0.0, 1.0, 5):
            there = screw_closed(pose, twists[c], share * found.went[c, g])
            things = [scene.movable[name].at(there)]
            things += [shapely.Polygon(outline).buffer(0.0) for outline in placed(grasps[g].covers, there)]
            for thing in things:
                assert thing.distance(others) >= motion.clearance - 1e-3
                assert scene.room.covers(thing)
        if found.hits[c, g] >= 0:  # one stride on it would be too near
            outlines = [*Body.of(scene.movable[name].footprint).points, *np.vstack(grasps[g].covers)]
            fastest = max(
                np.hypot(t[0], t[1]) for t in (twists[c][:2] + twists[c][2] * np.array([-p[1], p[0]]) for p in outlines)
            )
            there = screw_closed(pose, twists[c], found.went[c, g] + 1.001 * motion.step / fastest)
            things = [scene.movable[name].at(there), *(shapely.Polygon(o) for o in placed(grasps[g].covers, there))]
            leave = shapely.Point(compose(there, grasps[g].leave)[:2]).buffer(RADIUS + 1e-3, quad_segs=64)
            near = [thing.buffer(1.5 * motion.clearance) for thing in things]
            assert any(not scene.room.covers(thing) or thing.intersects(others) for thing in (*near, leave))


def placed(outlines: tuple[np.ndarray, np.ndarray], pose: np.ndarray) -> list[np.ndarray]:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return [outline @ np.array([[c, s], [-s, c]]) + pose[:2] for outline in outlines]


def test_what_is_open_is_open_and_was_not_before() -> None:
    scene = two_tables()
    roller, grasps = roller_of(scene, "square")
    twists = np.vstack((STRAIGHT, [[0.0, 0.0, 1.0]]))
    found = roller.roll(twists, everything(roller, twists))
    assert found.opened.any()
    for c, g in zip(*np.nonzero(found.opened), strict=True):
        there = screw_closed(scene.poses["square"], twists[c], found.went[c, g])
        free = free_space(scene.moved({"square": there}), RADIUS)
        assert free.index(compose(there, grasps[g].leave)[:2]) == free.index(np.array([5.2, 2.0])) is not None
        before = screw_closed(scene.poses["square"], twists[c], found.went[c, g] - 0.06)
        earlier = free_space(scene.moved({"square": before}), RADIUS + 0.5 * SETTINGS.motion.spare)
        leave, end = compose(before, grasps[g].leave)[:2], np.array([5.2, 2.0])
        assert earlier.index(leave) is None or earlier.index(leave) != earlier.index(end)


@pytest.mark.parametrize("low", [0.4, 0.39])
def test_a_thing_against_a_wall_leaves_it_and_slides_along_it_but_does_not_enter_it(low: float) -> None:
    """Its lower edge is on the wall, or by rounding a centimetre in it."""
    scene = two_tables()
    scene = NamoScene.of(
        box(6.0, 4.0, (3.0, 2.0)),
        {"block": box(0.7, 0.85, (3.0, 1.5))},
        scene.movable,
        {**scene.poses, "square": np.array([3.0, low, 0.0])},
        scene.start,
        scene.goal,
    )
    roller, _ = roller_of(scene, "square")
    found = roller.roll(STRAIGHT, everything(roller, STRAIGHT))
    assert found.went[1].max() > 0.5  # along it
    assert found.went[2].max() > 0.0  # away, until the robot meets the block
    assert found.went[3].max() == 0.0  # into it


def test_what_is_not_to_be_tried_is_not() -> None:
    roller, _ = roller_of(two_tables(), "square")
    found = roller.roll(STRAIGHT, ~everything(roller, STRAIGHT))
    assert not found.went.any()
    assert not found.opened.any()
    assert (found.hits == -1).all()


def test_one_motion_after_another_ends_where_both_lead() -> None:
    """A motion in two halves is the motion."""
    roller, _ = roller_of(two_tables(), "square")
    down = STRAIGHT[3:]
    whole = roller.roll(down, everything(roller, down))
    g = int(np.argmax(whole.opened[0]))
    assert whole.opened[0, g]
    rest = roller.roll_on(down[0], 0.1, g, down)
    assert rest.opened[0, 0]
    assert 0.1 + rest.went[0, 0] == pytest.approx(whole.went[0, g], abs=0.06)


def test_the_base_goes_sideways_no_further_than_it_can() -> None:
    roller, grasps = roller_of(two_tables(), "square")
    motion = MotionSettings()
    found = roller.roll(STRAIGHT, everything(roller, STRAIGHT))
    base = base_twists(STRAIGHT, grasps)
    assert (np.abs(base[..., 1]) * found.went <= motion.sideways + 1e-9).all()
    spot = np.array([[grasps[0].base[1], -grasps[0].base[0], 1.0]])
    assert aside(spot, grasps[:1], motion)[0, 0] == 0.0  # on the spot it is not carried at all
    turn = np.array([[0.0, 0.0, 1.0]])
    lever = float(np.hypot(*grasps[0].base[:2]))
    if abs(base_twists(turn, grasps[:1])[0, 0, 0]) < 1e-9:
        assert 1.0 / aside(turn, grasps[:1], motion)[0, 0] == pytest.approx(motion.sideways / lever)


@pytest.mark.parametrize(
    ("point", "left", "right"),
    [
        ((0.0, 0.0), 29.2, 29.3),
        ((-0.375, -0.75), 33.6, 79.1),
        ((0.375, 0.75), 27.7, 18.5),
        ((-0.375, 0.0), 42.5, 42.7),
        ((-0.675, 0.0), 72.1, 72.4),
        ((-0.315, -0.69), 31.4, 65.1),
    ],
)
def test_a_table_turns_as_far_as_krangs_arms_let_it(point: tuple[float, float], left: float, right: float) -> None:
    """Degrees that `./pbrl experiment articulation` finds for six points, both hands at the middle of a long face."""
    grasp = Grasp(("left", "right"), {}, np.pi, 0.0, np.array([-1.095, 0.0, 0.0]), np.zeros(3), (box(1, 1), box(1, 1)))
    turn = np.array([[point[1], -point[0], 1.0]])
    for sign, degrees in ((1.0, left), (-1.0, right)):
        reach = np.degrees(1.0 / aside(sign * turn, [grasp], MotionSettings())[0, 0])
        assert reach == pytest.approx(degrees, rel=0.15)


def test_base_and_thing_keep_their_speeds() -> None:
    _, grasps = roller_of(two_tables(), "long")
    twists = np.vstack((STRAIGHT, [[0.0, 0.0, 1.0], [0.7, -0.3, 1.0]]))
    speeds, ramps = timing(twists, grasps, SETTINGS.motion)
    base = base_twists(twists, grasps) * speeds[..., None]
    assert np.hypot(base[..., 0], base[..., 1]).max() <= SETTINGS.motion.speed + 1e-12
    assert (np.hypot(*twists[:, :2].T)[:, None] * speeds).max() <= SETTINGS.motion.speed + 1e-12
    assert np.abs(base[..., 2]).max() <= SETTINGS.motion.yaw_rate + 1e-12
    assert (ramps > 0.0).all()
