"""Whole stories in a world without physics: the thesis's first experiment, and what goes wrong on the way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from office_of_fakes import DT, GOAL, SETTINGS, Brain, Office, executive_in, office
from room_of_fakes import NOMINAL
from shapely import Point, box
from tampering import events, known, once

from pbrl_control.kinematics import RobotKinematics
from pbrl_control.loop import ControlLoop
from pbrl_control.percept import Percept
from pbrl_namo.executive import (
    GraspJob,
    LearnJob,
    MismatchJob,
    Order,
    PlanJob,
    State,
    status_of,
)
from pbrl_namo.executive.table import Event


@pytest.fixture
def world(kinematics: RobotKinematics) -> Office:
    return office(kinematics)


def test_experiment_1_a_stuck_table_is_learned_and_the_other_one_moved(world: Office) -> None:
    """Thesis 6.5.1 and figure 43."""
    world.pinned = {"table_a"}
    brain = Brain(world, moves=known)
    executive = executive_in(world, brain)
    order = world.run(executive)
    assert order.state == State.DONE, order.status
    assert np.hypot(*(world.base - GOAL)[:2]) < 0.05
    a_try = [State.LOOK, State.GET_READY, State.PLANNING, State.GET_GRASP_POINT, State.NAVIGATE, State.GRASP]
    assert world.states == [
        *(*a_try, State.CLEAR, State.UPDATE_MODEL, State.RELEASE),
        *(*a_try, State.CLEAR, State.RELEASE),
        *(State.LOOK, State.GET_READY, State.PLANNING, State.DRIVE_TO_GOAL, State.DONE),
    ]
    rows = executive.mission.account.rows()
    assert rows["surprises"] == rows["calls to UpdateModel"] == 1.0
    assert rows["openings"] == 1.0
    assert rows["calls to the planner"] == 3.0
    assert rows["free-space regions"] == 2.0
    assert rows["overall runtime [s]"] == pytest.approx(world.time, abs=2 * DT)
    assert world.things["table_a"].tolist() == [0.3, 1.55, 0.0]
    assert world.things["table_b"][0] < -0.2
    (learned,) = brain.asked(LearnJob)
    clear, surprise = (next(c for c in executive.mission.account.log if c.after == s) for s in world.states[6:8])
    assert learned.begin < clear.time < learned.end == surprise.time, "from the closed grip to the surprise"
    assert surprise.event == Event.UNEXPECTED_FORCE
    assert "expected 10 N and at most 40 N; learn the model again" in surprise.sentence
    assert not world.grips


def test_a_free_table_is_moved_at_once(world: Office) -> None:
    executive = executive_in(world)
    assert world.run(executive).state == State.DONE
    assert Event.OPENED in events(executive)
    assert executive.mission.account.surprises == 0
    assert world.things["table_b"].tolist() == [0.3, -1.55, 0.0]


def test_a_goal_in_the_same_region_is_driven_to(world: Office) -> None:
    world.joints = NOMINAL.copy()  # arms low at the start
    executive = executive_in(world, goal=np.array([-2.5, -1.5, 1.0]))
    assert world.run(executive).state == State.DONE
    assert world.states == [State.LOOK, State.GET_READY, State.PLANNING, State.DRIVE_TO_GOAL, State.DONE]
    assert world.base == pytest.approx([-2.5, -1.5, 1.0], abs=0.05)


def test_what_nobody_sees_is_gone_round_once_it_was_struck_and_forgotten_with_the_goal(
    kinematics: RobotKinematics,
) -> None:
    world = office(kinematics, things={}, bodies={}, fixed={})
    world.unseen = Point(0.5 * (world.base[:2] + GOAL[:2])).buffer(0.15)
    executive = executive_in(world)
    assert world.run(executive).state == State.DONE
    assert Event.WAY_LOST in events(executive)
    assert 1 <= len(executive.view.around.struck.outlines) <= 3
    executive.aim(np.array([-2.5, -1.5, 1.0]))
    world.tick(executive)
    assert not executive.view.around.struck.outlines


def test_what_was_felt_where_nothing_is_is_doubted_before_the_goal_is_given_up(kinematics: RobotKinematics) -> None:
    world = office(kinematics, things={}, bodies={}, fixed={})
    executive = executive_in(world)
    executive.view.around.struck.outlines = {"something unseen 1": box(-0.1, -2.9, 0.1, 2.9)}
    assert world.run(executive).state == State.DONE
    assert events(executive).count(Event.DOUBTED) == 1
    assert executive.mission.account.plans == 2
    (doubt,) = [change.sentence for change in executive.mission.account.log if change.event == Event.DOUBTED]
    assert doubt.startswith("no way to the goal: ")
    assert doubt.endswith("; planned anew without something unseen 1, which only the base has felt")


def test_what_is_felt_again_is_believed(kinematics: RobotKinematics) -> None:
    world = office(kinematics, things={}, bodies={}, fixed={})
    world.unseen = box(-0.1, -2.9, 0.1, 2.9)
    executive = executive_in(world)
    executive.view.around.struck.outlines = {"something unseen 1": world.unseen}
    order = world.run(executive)
    assert order.state == State.FAILED
    assert order.status.startswith("no way to the goal: ")
    assert events(executive).count(Event.DOUBTED) == 1
    assert executive.view.around.struck.outlines, "and stays on the map"


def test_an_empty_room_is_driven_through(kinematics: RobotKinematics) -> None:
    world = office(kinematics, things={}, bodies={}, fixed={})
    assert world.run(executive_in(world)).state == State.DONE
    assert State.GRASP not in world.states


def test_a_goal_that_nothing_leads_to_is_said_to_be(world: Office) -> None:
    executive = executive_in(world, beliefs={"table_a": "static", "table_b": "static"})
    order = world.run(executive)
    assert order.state == State.FAILED
    assert order.status == "no way to the goal: nothing that could be moved; cut off: regions 1"
    assert world.time < 1.0


UNREACHABLE = {
    "in a table": ([0.3, 1.55, math.nan], "goal: expected free floor, got (0.30, 1.55) in 'table_a'"),
    "in a wall": ([1.0, 0.0, math.nan], "in 'wall_middle'"),
    "outside": ([9.0, 0.0, math.nan], "outside of it"),
}


@pytest.mark.parametrize("case", UNREACHABLE)
def test_a_goal_that_is_no_place_to_be_is_said_to_be(world: Office, case: str) -> None:
    goal, sentence = UNREACHABLE[case]
    order = world.run(executive_in(world, goal=np.array(goal)))
    assert order.state == State.FAILED
    assert sentence in order.status
    assert len(world.states) == 4


def test_a_model_that_does_not_explain_is_asked_about(world: Office) -> None:
    world.pinned = {"table_a"}
    brain = Brain(world, explains=False)
    executive = executive_in(world, brain)
    world.run(executive, to=State.RELEASE)
    assert world.states[-3:] == [State.UPDATE_MODEL, State.ASK_MISMATCH, State.RELEASE]
    (asked,) = brain.asked(MismatchJob)
    (learned,) = brain.asked(LearnJob)
    assert (asked.object, asked.begin, asked.end) == (learned.object, learned.begin, learned.end)
    assert asked.belief == "static", "the model that was just learned"
    rows = executive.mission.account.rows()
    assert (rows["calls to UpdateModel"], rows["repaired models"]) == (1.0, 1.0)


def test_nobody_is_asked_where_nobody_is_to_be(world: Office) -> None:
    world.pinned = {"table_a"}
    brain = Brain(world, explains=False)
    executive = executive_in(world, brain, settings=SETTINGS.model_copy(update={"ask_mismatch": False}))
    world.run(executive, to=State.RELEASE)
    assert world.states[-2:] == [State.UPDATE_MODEL, State.RELEASE]
    assert not brain.asked(MismatchJob)


@pytest.mark.parametrize(
    ("stiffness", "strongest", "slides", "state", "event"),
    [
        (2000.0, 20.0, False, State.CLEAR, Event.STALLED),
        (1000.0, 30.0, True, State.CLEAR, Event.GRIP_SLIPPED),
        (20000.0, math.inf, False, State.GRASP, Event.UNEXPECTED_FORCE),
    ],
)
def test_every_surprise_is_learned_from(
    world: Office, stiffness: float, strongest: float, slides: bool, state: State, event: Event
) -> None:
    """Something stays where it is without much of a force, held or slipping, or is felt in the test of the grip."""
    world.pinned, world.stiffness, world.strongest, world.slides = {"table_a"}, stiffness, strongest, slides
    brain = Brain(world)
    executive = executive_in(world, brain)
    world.run(executive, to=State.UPDATE_MODEL)
    last = executive.mission.account.log[-1]
    assert (last.before, last.event) == (state, event)
    world.run(executive, to=State.RELEASE)
    assert executive.mission.beliefs == {"table_a": "static"}
    (job,) = brain.asked(LearnJob)
    assert job.begin < job.end


THINKING = [State.PLANNING, State.GET_GRASP_POINT, State.UPDATE_MODEL, State.ASK_MISMATCH]
KINDS = dict(zip(THINKING, (PlanJob, GraspJob, LearnJob, MismatchJob), strict=True))


@pytest.mark.parametrize("state", THINKING)
@pytest.mark.parametrize("what", ["cancel", "pause", "aim", "nothing"])
def test_long_thoughts_can_be_interrupted(world: Office, state: State, what: str) -> None:
    world.pinned = {"table_a"}
    brain = Brain(world, explains=False, silent=(KINDS[state],))
    executive = executive_in(world, thinker=brain)
    world.run(executive, to=state)
    held = state in (State.UPDATE_MODEL, State.ASK_MISMATCH)
    if what == "cancel":
        executive.cancel()
        assert world.tick(executive).state == (State.RELEASE_AND_CANCEL if held else State.CANCELLED)
        assert world.run(executive).state == State.CANCELLED
    elif what == "pause":
        executive.pause("sim_node is gone")
        assert world.tick(executive).state == State.PAUSED
        executive.resume()
        assert world.tick(executive).state == State.PAUSED, "until the robot stands"
        after = State.RELEASE if held else State.LOOK
        assert world.run(executive, to=after).state == after
    elif what == "aim":
        executive.aim(np.array([-2.5, 2.0, math.nan]))
        assert world.tick(executive).state == (state if held else State.LOOK)
    else:
        order = world.run(executive)
        assert order.state == State.FAILED
        assert "asked 3 times, the last time: no answer within 2 s" in order.status
    assert bool(world.grips) == (held and what in ("pause", "aim"))


@pytest.mark.parametrize("state", [State.NAVIGATE, State.GRASP, State.CLEAR, State.UPDATE_MODEL, State.DRIVE_TO_GOAL])
def test_a_new_goal_in_mid_action_is_gone_to(world: Office, state: State) -> None:
    world.pinned = {"table_a"} if state == State.UPDATE_MODEL else set()
    elsewhere = np.array([-2.5, 2.0, math.nan])
    executive = executive_in(world)
    once(world, state, lambda: executive.aim(elsewhere), after=0.0 if state == State.UPDATE_MODEL else 1.0)
    order = world.run(executive)
    assert order.state == State.DONE, order.status
    assert np.hypot(*(world.base - elsewhere)[:2]) < 0.05
    assert executive.mission.goal is not None
    if state == State.UPDATE_MODEL:
        assert executive.mission.beliefs == {"table_a": "static"}, "what was felt is learned all the same"


def test_after_the_end_there_can_be_another_goal(world: Office) -> None:
    executive = executive_in(world, goal=np.array([-2.5, -1.5, math.nan]))
    assert world.run(executive).state == State.DONE
    executive.aim(np.array([-2.5, 1.5, math.nan]))
    assert world.tick(executive).state == State.LOOK
    assert world.run(executive).state == State.DONE
    assert world.base[:2] == pytest.approx([-2.5, 1.5], abs=0.05)


@pytest.mark.parametrize("state", [State.LOOK, State.NAVIGATE, State.GRASP, State.CLEAR, State.DRIVE_TO_GOAL])
def test_who_is_told_to_stop_stops(world: Office, state: State) -> None:
    executive = executive_in(world, goal=np.array([-2.5, -1.5, 0.0]) if state == State.DRIVE_TO_GOAL else GOAL)
    once(world, state, lambda: executive.cancel("the visitor has left"), after=0.1 if state == State.LOOK else 1.0)
    order = world.run(executive)
    assert order.state == State.CANCELLED
    assert order.status == "the visitor has left"
    assert not world.grips


def test_beliefs_of_others_are_planned_with(world: Office) -> None:
    executive = executive_in(world)
    executive.believe("table_a", "static")
    world.run(executive, to=State.GET_GRASP_POINT)
    assert executive.mission.object == "table_b"


def test_what_it_tells_is_what_it_does(world: Office) -> None:
    executive = executive_in(world, Brain(world, moves=known))
    told = []

    def tell(world: Office) -> None:
        told.append(status_of(executive))

    world.happens = tell  # type: ignore[assignment]
    world.run(executive)
    moving = [status for status in told if status.state == State.CLEAR and math.isfinite(status.force_limit)]
    assert moving
    assert all(status.object == "table_a" for status in moving)
    assert {(status.region, status.target, status.regions) for status in moving} == {(0, 1, 2)}
    assert all(math.isfinite(status.expected_force) and status.force_limit == 40.0 for status in moving)
    assert max(status.felt_force for status in moving) == pytest.approx(world.friction, rel=0.2)
    assert all(math.isnan(status.felt_force) for status in told if status.state == State.NAVIGATE)
    last = status_of(executive)
    assert (last.finished, last.success, last.sentence) == (True, True, "at the goal")
    assert sum(last.seconds.values()) == pytest.approx(world.time, abs=2 * DT)


def test_same_seed_same_story(kinematics: RobotKinematics) -> None:
    ends = []
    for _ in range(2):
        world = office(kinematics)
        executive = executive_in(world, goal=np.array([-2.5, 2.0, math.nan]), seed=4)
        world.run(executive)
        ends.append((world.time, *world.base))
    assert ends[0] == ends[1]


def test_it_is_an_executive_like_any_other(world: Office) -> None:
    executive = executive_in(world)
    loop = ControlLoop(world.kinematics, executive)
    command = loop.tick(0.0, world.percept())
    assert isinstance(command.push, Order)
    assert command.body.base_v == 0.0
    assert loop.tick(0.02, Percept()).push.state == State.LOOK  # type: ignore[attr-defined]
