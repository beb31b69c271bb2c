"""The bench of the NAMO planner: its kinematic world obeys constraints, walls are walls, rivals are asked alike."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pbrl_bringup.benches import namo
from pbrl_bringup.benches.namo_kinematic import (
    LOST,
    REACHED,
    RIGHTLY,
    WRONGLY,
    carry_out,
    certain,
    find_way,
    office_run,
    out_of_reach,
    true_models,
)
from pbrl_bringup.benches.namo_rivals import check_of
from pbrl_bringup.commands.bench import BENCHES
from pbrl_control.constraints.classes import ModelClass, classify
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.planar import compose, inverse, rotation
from pbrl_namo.manipulation.plan import ManipulationPlan
from pbrl_namo.planner import plan
from pbrl_namo.regions.free_space import free_space
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.scenes import random_office

SCENES = Path(__file__).resolve().parents[1] / "data/namo_scenes"
STUCK = ("front_left", "rear_right")
LOADED = 130.0
"""Mass that two locked casters do not let go anywhere [kg]."""


def box(width: float, height: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    return np.array([[-width, -height], [width, -height], [width, height], [-width, height]]) / 2.0 + [x, y]


def room() -> NamoScene:
    """6 m by 4 m, split by two tables."""
    movable = {"square": Movable(box(0.8, 0.8), 0.75, 33.0), "long": Movable(box(0.75, 1.5), 0.75, 38.0)}
    poses = {"square": np.array([3.0, 0.85, 0.0]), "long": np.array([3.0, 2.8, 0.0])}
    start, goal = np.array([0.9, 2.0, 0.0]), np.array([5.2, 2.0, math.nan])
    return NamoScene.of(box(6.0, 4.0, 3.0, 2.0), {}, movable, poses, start, goal)


def truth_of(scene: NamoScene, **locked: tuple[str, ...]) -> dict[str, ObjectModel]:
    hidden = {
        name: {"mass": LOADED if len(locked.get(name, ())) > 1 else thing.mass, "locked_casters": locked.get(name, ())}
        for name, thing in scene.movable.items()
    }
    return true_models(scene, hidden)


def chosen(scene: NamoScene, truth: dict[str, ObjectModel]) -> ManipulationPlan:
    made = plan(scene, {name: certain(model) for name, model in truth.items()}, 0)
    assert made.chosen is not None and made.chosen.plan is not None
    return made.chosen.plan


@pytest.mark.parametrize(
    ("locked", "expected"),
    [((), ModelClass.UNCONSTRAINED), (("rear_left",), ModelClass.FIXED_POINT), (STUCK, ModelClass.STATIC)],
)
def test_hidden_casters_make_the_class_that_they_should(locked: tuple[str, ...], expected: ModelClass) -> None:
    model = truth_of(room(), long=locked)["long"]
    assert classify(model) == expected
    if len(locked) == 1:
        assert model.wheel == pytest.approx([-0.375 + 0.06, 0.75 - 0.06])


def test_what_rolls_goes_as_planned_and_the_robot_with_it() -> None:
    scene = room()
    truth = truth_of(scene)
    what = chosen(scene, truth)
    after, refused, hit = carry_out(scene, what, truth[what.object])
    assert not refused and not hit
    assert after.poses[what.object] == pytest.approx(what.end, abs=1e-9)
    before = compose(inverse(scene.poses[what.object]), what.drive_to)
    assert compose(inverse(after.poses[what.object]), after.start) == pytest.approx(before, abs=1e-9)


def test_what_is_stuck_does_not_move() -> None:
    scene = room()
    what = chosen(scene, truth_of(scene))
    after, refused, _ = carry_out(scene, what, truth_of(scene, square=STUCK, long=STUCK)[what.object])
    assert refused
    assert after.poses[what.object] == pytest.approx(scene.poses[what.object])


def test_what_turns_about_a_locked_caster_keeps_it_in_place() -> None:
    scene = room()
    truth = truth_of(scene, square=STUCK, long=("rear_left",))
    what = chosen(scene, truth)
    after, refused, hit = carry_out(scene, what, truth["long"])
    assert what.object == "long" and not refused and not hit
    places = [
        pose[:2] + rotation(float(pose[2])) @ truth["long"].wheel for pose in (scene.poses["long"], after.poses["long"])
    ]
    assert places[0] == pytest.approx(places[1], abs=1e-3)
    assert abs(after.poses["long"][2] - scene.poses["long"][2]) > 0.1


def test_nothing_is_moved_into_something() -> None:
    scene = room()
    truth = truth_of(scene)
    what = chosen(scene, truth)
    close = NamoScene.of(
        box(6.0, 4.0, 3.0, 2.0),
        {"post": box(0.05, 0.05, *what.end[:2])},
        {**scene.movable},
        {**scene.poses},
        scene.start,
        scene.goal,
    )
    after, _, hit = carry_out(close, what, truth[what.object])
    assert hit
    assert after.poses[what.object] == pytest.approx(scene.poses[what.object], abs=0.7)


@pytest.mark.parametrize(
    ("locked", "end"),
    [
        ({}, (REACHED,)),
        ({"square": STUCK}, (REACHED,)),
        ({"square": STUCK, "long": STUCK}, (RIGHTLY,)),
    ],
)
def test_a_way_is_found_where_there_is_one_and_else_that_is_said(
    locked: dict[str, tuple[str, ...]], end: tuple[str, ...]
) -> None:
    scene = room()
    truth = truth_of(scene, **locked)
    run = find_way(scene, truth, 0)
    assert run.end in end
    assert out_of_reach(scene, truth) == (run.end == RIGHTLY)
    assert run.failed <= run.moves
    assert run.planning >= run.longest > 0.0


def hall(width: float) -> NamoScene:
    """A hall of 6 m, narrower in its middle, with a table there."""
    walls = {"low": box(1.0, 0.3, 3.0, 0.15), "high": box(1.0, 0.3, 3.0, width - 0.15)}
    movable = {"table": Movable(box(0.8, 0.8), 0.75, 33.0)}
    poses = {"table": np.array([3.0, width / 2.0, 0.0])}
    start, end = np.array([0.9, width / 2.0, 0.0]), np.array([5.2, width / 2.0, math.nan])
    return NamoScene.of(box(6.0, width, 3.0, width / 2.0), walls, movable, poses, start, end)


def test_what_only_turns_where_it_fills_a_passage_is_proved_to_close_it_and_what_rolls_is_not() -> None:
    scene = hall(1.9)
    assert out_of_reach(scene, truth_of(scene, table=("front_left",)))
    assert not out_of_reach(scene, truth_of(scene))
    wide = hall(4.0)
    assert not out_of_reach(wide, truth_of(wide, table=("front_left",)))


def test_what_cannot_be_grasped_from_where_the_robot_is_proves_that_a_goal_is_out_of_reach() -> None:
    scene = hall(1.9)
    low = NamoScene.of(
        np.asarray(scene.room.exterior.coords)[:-1],
        {name: np.asarray(outline.exterior.coords)[:-1] for name, outline in scene.fixed.items()},
        {"table": Movable(box(0.8, 0.8), 0.3, 33.0)},
        dict(scene.poses),
        scene.start,
        scene.goal,
    )
    assert out_of_reach(low, truth_of(low)), "no gripper gets down to it"


def test_a_start_in_something_is_no_success() -> None:
    scene = room().moved({}, np.array([3.0, 2.8, 0.0]))
    assert find_way(scene, truth_of(scene), 0).end == LOST


def test_the_same_seed_gives_the_same_run() -> None:
    first, again = (office_run(3, 2, 6) for _ in range(2))
    assert (first.end, first.reason, first.moves, first.failed) == (again.end, again.reason, again.moves, again.failed)
    assert first.end in (REACHED, RIGHTLY, WRONGLY)


@pytest.mark.parametrize(("count", "seed"), [(5, 0), (12, 1), (20, 2)])
def test_a_walled_in_goal_cannot_be_reached_whatever_is_taken_away(count: int, seed: int) -> None:
    scene = random_office(count, np.random.default_rng(seed), move_needed=True)
    walled = namo.walled_in(scene)
    assert len(walled.movable) + len(walled.fixed) == len(scene.movable) + len(scene.fixed)
    empty = free_space(walled, leave_out=set(walled.movable))
    assert empty.index(walled.start) != empty.index(walled.goal)
    assert free_space(walled).index(walled.goal) is not None


def test_what_opens_is_what_joins_start_and_target() -> None:
    scene = room()
    opened = check_of(scene, free_space(scene), "long", scene.goal[:2])
    assert not opened(scene.poses["long"])
    assert opened(np.array([3.0, 3.2, math.pi / 2.0]))
    assert not opened(np.array([0.9, 2.0, 0.0]))


def test_scenes_that_are_not_there_make_no_row(tmp_path: Path) -> None:
    assert namo.peer_scenes(0, tmp_path).rows == []


def test_scenes_of_the_peer_are_solved_sooner_than_by_it() -> None:
    found = namo.peer_scenes(0, SCENES)
    assert len(found.rows) == len(namo.PEER_SCENES)
    assert all(row.holds and row.against["end"] == REACHED and row.against["moves"] >= 1.0 for row in found.rows)


def test_it_is_known_by_name() -> None:
    assert "namo" in BENCHES
