"""Rooms, rows and film strip of the experiments among movable obstacles, from runs made by hand; and the docs."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_bringup.benches.namo_kinematic import true_models
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments import namo_figure, namo_rooms, namo_static, namo_wheel
from pbrl_bringup.experiments.namo_rooms import (
    GOAL,
    LONG,
    MASSES,
    SIZES,
    SQUARE,
    STUCK,
    TURNED,
    Layout,
    draw_room,
    outline_of,
)
from pbrl_bringup.experiments.namo_trials import PLANNED, PLANS, SURPRISES, UPDATES, rows_of, told
from pbrl_bringup.namo_run import Moment, NamoOutcome
from pbrl_control.constraints.twist import achievable_twist
from pbrl_control.types import PlanarTwist
from pbrl_namo.errors import NamoError
from pbrl_namo.executive import PlanJob, State
from pbrl_namo.executive.mission import job_seed
from pbrl_namo.executive.table import markdown
from pbrl_namo.thinking import Thoughts

ROOT = Path(__file__).resolve().parents[2]
POSES = {SQUARE: (2.6, 1.5, 0.0), LONG: (2.6, -0.7, 0.1)}


def moment(time: float, state: State, sentence: str = "on its way", moved: str | None = None) -> Moment:
    poses = POSES if moved is None else {**POSES, moved: (3.4, 0.2, 0.5)}
    return Moment(time, str(state), sentence, (0.1 * time, 0.0, 0.3), poses, SQUARE)


def outcome(
    reached: bool = True, updates: float = 1.0, surprises: float = 1.0, planned: float = 1.2, moved: str = LONG
) -> NamoOutcome:
    state = State.DONE if reached else State.FAILED
    moments = tuple(moment(5.0 * k, each) for k, each in enumerate((State.PLANNING, State.CLEAR)))
    moments += (moment(10.0, state, moved=moved),)
    rows = {PLANS: 3.0, UPDATES: updates, SURPRISES: surprises, PLANNED: planned}
    sentence = "at the goal" if reached else "no way from region 0"
    outlines = {name: tuple(map(tuple, outline_of(name).tolist())) for name in SIZES}
    room = tuple(map(tuple, STUCK.room.tolist()))
    return NamoOutcome(str(state), sentence, 150.0, rows, moments, 0.02 if reached else 3.0, room, outlines, GOAL)


def test_the_same_seed_draws_the_same_room_and_another_one_another() -> None:
    (one, goal, seed), (again, goal_again, seed_again) = (draw_room(np.random.default_rng(4), TURNED) for _ in range(2))
    assert (one, seed) == (again, seed_again)
    assert goal.tobytes() == goal_again.tobytes()
    other, *_ = draw_room(np.random.default_rng(5), TURNED)
    assert other != one


@pytest.mark.parametrize("layout", [STUCK, TURNED])
@pytest.mark.parametrize("seed", range(4))
def test_every_room_is_closed_and_conceals_what_it_was_told_to(layout: Layout, seed: int) -> None:
    scene, goal, _ = draw_room(np.random.default_rng(seed), layout)
    assert set(scene.bodies) == set(SIZES)
    assert math.isnan(goal[2])
    assert np.abs(goal[:2] - GOAL).max() <= 0.8
    concealed = scene.concealed.locked_casters
    assert set(concealed) == set(layout.locked)
    for name, casters in concealed.items():
        assert tuple(casters) in layout.locked[name]
    poses = {name: np.array(scene.bodies[name].pose) for name in SIZES}
    start = np.array(scene.robot.pose)
    assert namo_rooms.closed(namo_rooms.seen(layout, poses, start, goal))
    away = {name: np.array([x, y + 20.0, yaw]) for name, (x, y, yaw) in poses.items()}
    assert not namo_rooms.closed(namo_rooms.seen(layout, away, start, goal))


def test_in_a_room_of_surprises_the_first_thing_that_a_mission_does_is_refused() -> None:
    """What is planned first is planned by the mission itself, as its thinker plans it."""
    scene, goal, seed = draw_room(np.random.default_rng(6), TURNED)
    poses = {name: np.array(scene.bodies[name].pose) for name in SIZES}
    known = namo_rooms.seen(TURNED, poses, np.array(scene.robot.pose), goal)
    locked = scene.concealed.locked_casters
    truth = true_models(known, {name: {"mass": MASSES[name], "locked_casters": locked[name]} for name in SIZES})

    def nothing(begin: float, end: float) -> Recording:
        raise NamoError(f"nothing was recorded from {begin} to {end} s")

    move = Thoughts(nothing).plan(PlanJob(known, {}, {}, job_seed(seed, 1))).move
    assert move is not None
    twist = PlanarTwist(*map(float, move.segments[0][0]))
    allowed = achievable_twist(truth[move.object], twist, poses[move.object])
    assert allowed.refused_speed > 0.01


def test_a_room_that_never_closes_is_refused_in_a_line() -> None:
    wide = Layout(12.0, STUCK.places, STUCK.locked)
    with pytest.raises(BringupError, match="closed by its tables"):
        draw_room(np.random.default_rng(0), wide)


def test_outlines_are_of_the_sizes_and_about_the_middle() -> None:
    for name, size in SIZES.items():
        np.testing.assert_allclose(np.ptp(outline_of(name), axis=0), size)
        np.testing.assert_allclose(outline_of(name).mean(axis=0), 0.0)


def test_rows_hold_where_all_reach_the_goal_and_not_where_too_few_do() -> None:
    good = rows_of([outcome() for _ in range(40)], namo_static.THESIS)
    assert all(row.holds for row in good)
    assert good[0].value == 40
    bad = rows_of([outcome() for _ in range(37)] + [outcome(reached=False)] * 3, namo_static.THESIS)
    assert bad[0].value == 37
    assert not bad[0].holds
    enough = rows_of([outcome() for _ in range(38)] + [outcome(reached=False)] * 2, namo_static.THESIS)
    assert enough[0].holds


def test_a_run_that_moves_the_table_that_was_to_be_stuck_is_not_as_told() -> None:
    runs = [outcome(), outcome(moved=SQUARE, updates=0.0, surprises=0.0), outcome(reached=False)]
    told = rows_of(runs, namo_static.THESIS)[-1]
    assert told.value == 1
    assert not told.holds


def test_a_run_that_thinks_too_long_or_learns_unasked_is_seen() -> None:
    slow = rows_of([outcome(), outcome(planned=2.3)], namo_static.THESIS)
    assert not slow[1].holds
    unasked = rows_of([outcome(), outcome(), outcome(updates=2.0)], namo_static.THESIS)
    assert unasked[2].holds, "the median is the thesis's"
    assert unasked[3].value == 1
    assert not unasked[3].holds


def test_the_thesis_updated_twice_where_a_caster_is_to_be_learned() -> None:
    twice = rows_of([outcome(updates=2.0, surprises=2.0)], namo_wheel.THESIS)
    assert twice[2].holds
    once = rows_of([outcome()], namo_wheel.THESIS)
    assert not once[2].holds


def test_where_no_run_reaches_the_goal_nothing_is_claimed() -> None:
    rows = rows_of([outcome(reached=False)], namo_static.THESIS)
    assert not rows[0].holds
    assert math.isnan(rows[4].value)
    assert not rows[4].holds
    assert not rows[5].holds


def test_a_run_is_told_as_it_was() -> None:
    run = outcome()
    assert told(run) == asdict(run)
    assert told(run)["moments"][0]["state"] == "Planning"


def test_the_film_strip_is_drawn_and_the_same_twice(tmp_path: Path) -> None:
    first = namo_figure.draw(outcome(), tmp_path).read_bytes()
    assert first.startswith(b"\x89PNG")
    assert namo_figure.draw(outcome(), tmp_path).read_bytes() == first


def test_a_long_run_is_told_by_its_beginning_and_its_end(tmp_path: Path) -> None:
    states = [State.PLANNING, State.CLEAR, State.UPDATE_MODEL, State.RELEASE] * 8
    run = replace(outcome(), moments=tuple(moment(9.0 * k, state, "x" * 200) for k, state in enumerate(states)))
    assert namo_figure.draw(run, tmp_path).stat().st_size > 10_000


def test_every_state_that_has_a_picture_is_one() -> None:
    assert set(namo_figure.SHOWN) <= {str(state) for state in State}


def test_the_documentation_has_the_executives_table_exactly() -> None:
    assert markdown() in (ROOT / "docs/namo.md").read_text(encoding="utf-8")
