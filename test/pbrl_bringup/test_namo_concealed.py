"""Rooms that conceal something: it is met on the way of what looks best, another way is left; rows by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments import namo_concealed, namo_concealed_rooms
from pbrl_bringup.experiments.namo_concealed import REPAIRED, SURPRISES, Pair, rows_of
from pbrl_bringup.experiments.namo_concealed_rooms import FREE, HEAVY, PASSAGE, Concealing, draw_concealing, seen_room
from pbrl_bringup.experiments.namo_concealing import CARPET, CASTERS, KINDS, TETHER, UNSEEN, conceal, track
from pbrl_bringup.experiments.namo_figure import draw
from pbrl_bringup.experiments.namo_rooms import SQUARE
from pbrl_bringup.namo_run import Moment, NamoOutcome
from pbrl_control.planar import compose, inverse, placed
from pbrl_namo.executive import State
from pbrl_namo.executive.mission import job_seed
from pbrl_namo.manipulation.plan import ManipulationPlan
from pbrl_namo.planner import plan
from pbrl_namo.scene import NamoScene
from pbrl_namo.settings import NamoSettings
from pbrl_namo.thinking import unlearned

EFFECTS = {CARPET: "floor_patch", TETHER: "tether", UNSEEN: "unseen_body"}


def outcome(reached: bool, repaired: float = 0.0, surprises: float = 1.0) -> NamoOutcome:
    state = State.DONE if reached else State.FAILED
    moment = Moment(3.0, str(State.PLANNING), "plans", (0.0, 0.0, 0.0), {SQUARE: (2.6, 0.9, 0.0)}, SQUARE)
    rows = {REPAIRED: repaired, SURPRISES: surprises, "overall planning time [s]": 0.5, "calls to UpdateModel": 1.0}
    room = ((-1.5, -2.3), (6.0, -2.3), (6.0, 2.3), (-1.5, 2.3))
    outline = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    return NamoOutcome(str(state), "said", 100.0, rows, (moment,), 0.02, room, {SQUARE: outline}, (5.0, 0.0))


def first_of(room: Concealing) -> tuple[NamoScene, ManipulationPlan]:
    """Return what is seen of a room, and what is done first by who knows nothing."""
    pose, start = np.array(room.scene.bodies[SQUARE].pose), np.array(room.scene.robot.pose)
    seen = seen_room(pose, start, room.goal)
    believed = unlearned(seen.movable[SQUARE], NamoSettings())
    chosen = plan(seen, {SQUARE: believed}, job_seed(room.seed, 1)).chosen
    assert chosen is not None
    assert chosen.plan is not None
    return seen, chosen.plan


@pytest.mark.parametrize("kind", KINDS)
def test_the_first_thing_that_is_planned_meets_what_is_concealed(kind: str) -> None:
    room = draw_concealing(np.random.default_rng([3, KINDS.index(kind)]), kind)
    told = room.scene.concealed.model_dump(exclude_defaults=True)
    assert set(told) == {EFFECTS[kind]}
    assert set(room.scene.bodies) == {SQUARE, namo_concealed_rooms.CUPBOARD}
    seen, what = first_of(room)
    poses = track(seen, what)
    met = [conceal(kind, seen, what, share, PASSAGE) for share in (0.35, 0.45, 0.55)]
    meetings = [meeting for meeting in met if meeting is not None]
    assert meetings
    for meeting in meetings:
        assert meeting.stopping(seen, what)
        assert all(stop.beyond(poses[0]) < 0.0 for stop in meeting.stops)
        assert meeting.solid is None or not meeting.solid.intersects(seen.outlines[SQUARE])
    assert all(np.isfinite(shape).all() for shape in room.outlines())
    assert bool(room.cords()) == (kind == TETHER)
    assert bool(room.outlines()) == (kind != TETHER)


def test_no_caster_stands_on_the_carpet_until_the_first_one_comes_to_its_edge() -> None:
    seen, what = first_of(draw_concealing(np.random.default_rng(4), CARPET))
    meeting = conceal(CARPET, seen, what, 0.45, PASSAGE)
    assert meeting is not None
    tile = shapely.Polygon(meeting.concealed["floor_patch"][0]["polygon"])
    poses = track(seen, what)
    met = int(np.argmin(np.abs(poses - meeting.pose).sum(axis=1)))
    on = [[bool(shapely.intersects_xy(tile, *caster)) for caster in placed(CASTERS, pose)] for pose in poses]
    assert not np.any(on[:met])
    assert np.any(on[met + 1 :])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("friction", [FREE, HEAVY])
def test_who_does_not_know_what_was_met_runs_into_it_again(kind: str, friction: float) -> None:
    seen, what = first_of(draw_concealing(np.random.default_rng([6, KINDS.index(kind)]), kind))
    found = (conceal(kind, seen, what, share, PASSAGE) for share in np.linspace(0.35, 0.55, 9))
    kept = [each for each in found if each is not None and namo_concealed_rooms._kept(seen, what, each, 1)]
    for meeting in kept:
        leave = compose(inverse(seen.poses[SQUARE]), what.drive_to)
        there = seen.moved({SQUARE: meeting.pose}, compose(meeting.pose, leave))
        again = namo_concealed_rooms._chosen(there, friction, 1, ())
        assert again is not None
        assert meeting.stopping(there, again)
    assert kept


def test_the_same_draws_give_the_same_room() -> None:
    one, other = (draw_concealing(np.random.default_rng(5), TETHER) for _ in range(2))
    assert one.scene == other.scene
    assert one.seed == other.seed
    assert one.goal.tobytes() == other.goal.tobytes()
    assert math.isnan(one.goal[2])


def test_what_is_none_of_the_kinds_is_refused() -> None:
    with pytest.raises(BringupError, match="expected one of carpet edge, tether, unseen body, got 'draught'"):
        draw_concealing(np.random.default_rng(0), "draught")


def test_rows_count_both_learners_in_the_same_rooms() -> None:
    pairs = [Pair(kind, outcome(True, 1.0), outcome(number == 0)) for number in range(2) for kind in KINDS]
    first = rows_of(pairs)[0]
    assert first.value == pytest.approx(0.5)
    assert first.holds
    found = rows_of(pairs)[-1]
    assert found.value == 6
    worse = rows_of([Pair(CARPET, outcome(False), outcome(True))])
    assert not worse[0].holds


def test_both_strips_are_drawn_with_what_is_concealed(tmp_path: Path) -> None:
    shapes = [np.array([[3.0, 1.0], [4.0, 1.0], [4.0, 2.0]])]
    assert draw(outcome(True), tmp_path, shapes).name == "figure.png"
    cords = {SQUARE: np.array([[0.0, 0.0], [1.0, 0.5]])}
    assert draw(outcome(False), tmp_path, shapes, "plain", cords=cords).name == "plain.png"
    assert (tmp_path / "plain.png").read_bytes().startswith(b"\x89PNG")


def test_the_kinds_take_turns() -> None:
    assert [namo_concealed.room_of(2, number).kind for number in range(3)] == list(KINDS)
