"""What answers the executive: plans and ways in a small room, learning from a pushed table, refusals in words."""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.errors import BagError
from pbrl_bag.types import Recording
from pbrl_control.constraints.classes import ModelClass
from pbrl_mismatch.encounter import Encounter
from pbrl_mismatch.errors import MismatchError
from pbrl_model.fitting.options import FitOptions
from pbrl_model.parameters import KERNEL_COLUMNS, BodyParameters
from pbrl_namo import thinking
from pbrl_namo.beliefs.belief import ObjectBelief, belief_of_draws
from pbrl_namo.beliefs.stops import Stop
from pbrl_namo.errors import NamoError
from pbrl_namo.executive import Move, PlanJob, Refused
from pbrl_namo.executive.jobs import GraspAnswer, GraspJob, LearnAnswer, LearnJob, MismatchAnswer, MismatchJob, finite
from pbrl_namo.manipulation import ManipulationSettings
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.settings import NamoSettings
from pbrl_namo.thinking import Thoughts

QUICK = NamoSettings(manipulation=ManipulationSettings(worlds=20))
QUICK_FIT = FitOptions(model_class="wheel", search_draws=20, draws=20, chains=1, holdout_share=0.0)


def box(width: float, height: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    return np.array([[-width, -height], [width, -height], [width, height], [-width, height]]) / 2.0 + [x, y]


def room(tables: dict[str, tuple[float, float]], width: float = 4.0, wall: bool = False) -> NamoScene:
    """6 m long, the goal at the other end; tables are 0.8 m wide and as long as told, at x = 3 m and the y told."""
    movable = {name: Movable(box(0.8, length), 0.75, 33.0) for name, (length, _) in tables.items()}
    poses = {name: np.array([3.0, y, 0.0]) for name, (_, y) in tables.items()}
    fixed = {"wall": box(0.1, width, 4.2, width / 2)} if wall else {}
    goal = np.array([5.2, width / 2, math.nan])
    return NamoScene.of(box(6.0, width, 3.0, width / 2), fixed, movable, poses, np.array([0.9, width / 2, 0.0]), goal)


CLOSED = {"square": (0.8, 0.85), "long": (1.5, 2.8)}


def nothing(begin: float, end: float) -> Recording:
    raise BagError(f"recording: expected wrenches between {begin}\nand {end} s, got none")


def rolling(scene: NamoScene) -> dict[str, ObjectBelief]:
    draws = np.array([[33.0, 0.02]] * 20)
    return {name: belief_of_draws(thing, ("mass", "mu_ground"), draws) for name, thing in scene.movable.items()}


def job(scene: NamoScene, **more: object) -> PlanJob:
    return replace(PlanJob(scene, rolling(scene), {}, 1), **more)


def thoughts(recorded: Callable[[float, float], Recording] = nothing) -> Thoughts:
    return Thoughts(recorded, QUICK, QUICK_FIT)


def _module(path: Path) -> Any:
    """Import a file by its place: every folder of tests has a `conftest`."""
    spec = importlib.util.spec_from_file_location(f"{path.parent.name}_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = found
    spec.loader.exec_module(found)
    return found


@pytest.fixture(scope="module")
def pinned() -> Recording:
    """A table with a caster that does not roll, pushed for 4 s."""
    made = _module(Path(__file__).parents[1] / "pbrl_model" / "conftest.py")
    wheel = BodyParameters(mass=33.0, wheel_x=-0.65, wheel_y=0.3, mu_x=0.6, mu_y=0.6)
    recording: Recording = made.record_push(made.Push(truth=wheel, seconds=4.0, speed=0.1), 1)
    return recording


def test_a_free_way_is_given_with_nothing_to_move() -> None:
    answer = thoughts()(job(room({})))
    assert answer.way is not None
    assert answer.move is None
    assert answer.reason == ""
    np.testing.assert_array_equal(answer.way.goal[:2], [5.2, 2.0])
    assert answer.regions == 1
    assert answer.region == 0
    assert answer.seconds > 0.0


def test_what_stands_in_the_way_is_moved_and_everything_said_that_the_executive_needs() -> None:
    scene = room(CLOSED)
    answer = thoughts()(job(scene))
    assert answer.way is None
    move = answer.move
    assert move is not None
    assert move.object in CLOSED
    assert finite(move) == ""
    assert move.start != move.end
    assert move.targets.shape[1:] == (2,)
    assert len(move.targets) > 3
    assert move.expected_force > 0.0
    assert move.model is not None
    assert move.model.casters is not None
    outline = scene.movable[move.object].footprint
    assert (np.abs(move.model.casters.places) < np.abs(outline).max(axis=0)).all(), "casters stand under the table"
    assert any(choice.object == move.object for choice in answer.choices)


def test_a_move_that_was_planned_can_be_grasped() -> None:
    scene = room(CLOSED)
    move = thoughts()(job(scene)).move
    answer = thoughts()(GraspJob(scene, move, (), 1))
    assert isinstance(answer, GraspAnswer)
    assert answer.candidate is not None, answer.reason


def test_same_job_same_answer() -> None:
    first, again = (thoughts()(job(room(CLOSED))).move for _ in range(2))
    assert isinstance(first, Move)
    assert first.object == again.object
    assert np.array(first.contact).tobytes() == np.array(again.contact).tobytes()
    assert [twist.tobytes() for twist, _ in first.segments] == [twist.tobytes() for twist, _ in again.segments]


def test_of_what_nothing_was_learned_the_prior_is_believed() -> None:
    assert thoughts()(job(room(CLOSED), beliefs={})).move is not None
    assert thoughts()(job(room(CLOSED), beliefs={"square": None, "long": "what is this"})).move is not None


def test_a_goal_that_cannot_be_reached_is_said_in_words() -> None:
    answer = thoughts()(job(room(CLOSED, wall=True)))
    assert answer.way is None
    assert answer.move is None
    assert "whatever is moved" in answer.reason
    assert answer.cut_off


def test_a_gap_that_a_disc_passes_and_the_robot_does_not_is_widened(monkeypatch: pytest.MonkeyPatch) -> None:
    """1.2 m are left beside the table: enough for the disc, not for the disc that is 12 cm wider."""
    asked = []

    def no_way(scene: NamoScene, seed: int) -> None:
        asked.append(seed)
        raise NamoError("way to the goal: too narrow")

    monkeypatch.setattr(thinking, "find_way", no_way)
    answer = thoughts()(job(room({"table": (2.0, 2.2)}, width=3.2)))
    assert len(asked) == 2, "with the disc as it is, and with one that still passes"
    assert answer.move is not None
    assert answer.move.object == "table"
    assert answer.reason == ""


def test_where_no_disc_is_wide_enough_to_see_why_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_way(scene: NamoScene, seed: int) -> None:
        raise NamoError("way to the goal: none")

    monkeypatch.setattr(thinking, "find_way", no_way)
    answer = thoughts()(job(room({})))
    assert answer.way is None
    assert answer.move is None
    assert "not wide enough for the robot's turns" in answer.reason


def test_what_a_pinned_table_is_is_learned(pinned: Recording) -> None:
    asked = []

    def recorded(begin: float, end: float) -> Recording:
        asked.append((begin, end))
        return pinned

    answer = thoughts(recorded)(LearnJob("table", 2.0, 6.0, None, 3))
    assert asked == [(2.0, 6.0)]
    assert isinstance(answer, LearnAnswer)
    assert answer.explained
    assert answer.reason == ""
    assert answer.belief.classes()[ModelClass.FIXED_POINT] > 0.9
    place = answer.belief.rows[:, [KERNEL_COLUMNS.index("wheel_x"), KERNEL_COLUMNS.index("wheel_y")]].mean(axis=0)
    assert place == pytest.approx([-0.65, 0.3], abs=0.05)


def test_what_a_model_class_cannot_explain_is_said(pinned: Recording) -> None:
    free = Thoughts(lambda begin, end: pinned, QUICK, QUICK_FIT.model_copy(update={"model_class": "free"}))
    answer = free(LearnJob("table", 2.0, 6.0, None, 3))
    assert isinstance(answer, LearnAnswer)
    assert not answer.explained
    assert answer.reason.startswith(thinking.LEFT_OUT)


def test_a_left_out_force_that_stops_no_push_is_no_reason_to_ask(
    monkeypatch: pytest.MonkeyPatch, pinned: Recording
) -> None:
    """20 N of 51 N: by a robot that is not stopped by half of what it feels, it need not be explained."""
    monkeypatch.setattr(thinking, "MATTERS", 0.5)
    free = Thoughts(lambda begin, end: pinned, QUICK, QUICK_FIT.model_copy(update={"model_class": "free"}))
    answer = free(LearnJob("table", 2.0, 6.0, None, 3))
    assert isinstance(answer, LearnAnswer)
    assert answer.explained


@pytest.mark.parametrize("kind", [LearnJob, MismatchJob])
def test_errors_of_learning_and_diagnosis_are_refusals_of_one_line(kind: type[LearnJob], pinned: Recording) -> None:
    unrecorded = thoughts()(kind("table", 0.0, 1.0, None, 1))
    assert isinstance(unrecorded, Refused)
    assert unrecorded.reason == "recording: expected wrenches between 0.0 and 1.0 s, got none"
    unknown = thoughts(lambda begin, end: pinned)(kind("nobody", 0.0, 1.0, None, 1))
    assert isinstance(unknown, Refused)
    assert "nobody" in unknown.reason
    assert "\n" not in unknown.reason


def test_learning_does_not_need_to_know_what_was_met(monkeypatch: pytest.MonkeyPatch, pinned: Recording) -> None:
    def hardly_moved(recording: Recording, name: str) -> None:
        raise MismatchError(f"{name}: expected it to have moved")

    monkeypatch.setattr(thinking, "find_encounter", hardly_moved)
    answer = thoughts(lambda begin, end: pinned)(LearnJob("table", 2.0, 6.0, None, 3))
    assert isinstance(answer, LearnAnswer)
    assert answer.explained


def test_what_was_met_is_not_gone_to_again_and_what_was_met_before_neither(
    monkeypatch: pytest.MonkeyPatch, pinned: Recording
) -> None:
    here, ahead = np.array([2.0, 1.0, 0.0]), np.array([1.0, 0.0])
    met = Encounter(5.0, here, np.array([2.02, 1.0, 0.0]), np.array([0.4, 0.0]), -ahead, 60.0, 5.0)
    monkeypatch.setattr(thinking, "find_encounter", lambda recording, name: met)
    think = thoughts(lambda begin, end: pinned)
    learned = think(LearnJob("table", 2.0, 6.0, None, 3))
    assert isinstance(learned, LearnAnswer)
    assert not learned.explained
    assert "met something near (2.42, 1.00) m" in learned.reason
    earlier = Stop(np.zeros(2), np.array([0.0, 1.0]), 4.0)
    answer = think(MismatchJob("table", 2.0, 6.0, replace(learned.belief, stops=(earlier,)), 3))
    assert isinstance(answer, MismatchAnswer)
    assert answer.belief is not None
    first, second = answer.belief.stops
    assert first is earlier
    np.testing.assert_allclose(second.direction, ahead)
    assert second.level == pytest.approx(2.4 - thinking.SPARE)


def diagnosed(monkeypatch: pytest.MonkeyPatch, effects: tuple[str, ...], mass: float = 21.0) -> None:
    row = np.full(len(thinking.COLUMN), np.nan)
    row[thinking.COLUMN["mass"]] = mass
    found = SimpleNamespace(
        effects=[SimpleNamespace(effect=name) for name in effects], repaired=SimpleNamespace(row=row)
    )
    monkeypatch.setattr(thinking, "diagnose", lambda recording, options: SimpleNamespace(objects={"table": found}))


def test_what_was_left_out_is_named_and_the_repaired_body_believed(
    monkeypatch: pytest.MonkeyPatch, pinned: Recording
) -> None:
    diagnosed(monkeypatch, ("tether", "detent"))
    answer = thoughts(lambda begin, end: pinned)(MismatchJob("table", 2.0, 6.0, None, 1))
    assert isinstance(answer, MismatchAnswer)
    assert answer.found == "tether and detent"
    assert answer.belief.rows[:, KERNEL_COLUMNS.index("mass")] == pytest.approx(21.0)


def test_where_nothing_is_named_there_is_no_belief(monkeypatch: pytest.MonkeyPatch, pinned: Recording) -> None:
    diagnosed(monkeypatch, ())
    answer = thoughts(lambda begin, end: pinned)(MismatchJob("table", 2.0, 6.0, None, 1))
    assert isinstance(answer, MismatchAnswer)
    assert answer.belief is None
    assert answer.found


def test_a_repair_that_is_no_body_is_refused(monkeypatch: pytest.MonkeyPatch, pinned: Recording) -> None:
    diagnosed(monkeypatch, ("tether",), mass=-1.0)
    assert isinstance(thoughts(lambda begin, end: pinned)(MismatchJob("table", 2.0, 6.0, None, 1)), Refused)


def test_a_diagnosis_that_fails_is_refused_in_words(monkeypatch: pytest.MonkeyPatch, pinned: Recording) -> None:
    def fails(recording: Recording, options: object) -> None:
        raise MismatchError("diagnose: expected motion,\n got none")

    monkeypatch.setattr(thinking, "diagnose", fails)
    answer = thoughts(lambda begin, end: pinned)(MismatchJob("table", 2.0, 6.0, None, 1))
    assert answer == Refused("diagnose: expected motion, got none")
