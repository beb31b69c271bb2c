"""Stories in which somebody dies, vanishes, lets go or stays silent, or was told nonsense, without physics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from office_of_fakes import GOAL, SETTINGS, Brain, Office, executive_in, office
from room_of_fakes import NOMINAL
from tampering import events, freeze, once

from pbrl_control.errors import ControlError
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.percept import Grip
from pbrl_control.settings import ControllerSettings
from pbrl_namo.errors import NamoError
from pbrl_namo.executive import (
    GraspJob,
    ImmediateThinker,
    LearnJob,
    NamoExecutive,
    PlanJob,
    State,
    status_of,
)
from pbrl_namo.executive.table import DRIVING, Event


@pytest.fixture
def world(kinematics: RobotKinematics) -> Office:
    return office(kinematics)


def test_a_thinker_that_comes_back_is_asked_again(world: Office) -> None:
    brain = Brain(world, lost={PlanJob: 2, GraspJob: 1})
    executive = executive_in(world, brain)
    assert world.run(executive, to=State.NAVIGATE).state == State.NAVIGATE
    plans = brain.asked(PlanJob)
    assert plans[0] is plans[1] is plans[2], "the same job"


@pytest.mark.parametrize(("kind", "state"), [(PlanJob, State.PLANNING), (LearnJob, State.UPDATE_MODEL)])
def test_a_thinker_that_stays_away_is_told_of(world: Office, kind: type, state: State) -> None:
    world.pinned = {"table_a"}
    executive = executive_in(world, Brain(world, lost={kind: 99}))
    order = world.run(executive)
    assert order.state == State.FAILED
    assert "expected an answer, got none; asked 3 times, the last time: nobody at home" in order.status
    assert not world.grips, "let go before it fails"
    assert (State.RELEASE_AND_FAIL in world.states) == (state == State.UPDATE_MODEL)


def test_hands_that_never_close_are_given_up_elsewhere_each_time(world: Office) -> None:
    world.closes = False
    settings = SETTINGS.model_copy(update={"tries": 2})
    brain = Brain(world, order=("table_a",))
    order = world.run(executive_in(world, brain, settings=settings))
    assert order.state == State.FAILED
    assert "table_a is left alone after 2 tries" in order.status
    assert "nothing between the plates" in order.status
    first, second = brain.asked(GraspJob)
    assert (len(first.avoid), len(second.avoid)) == (0, 1)


def test_a_gripper_that_does_not_open_is_told_of(world: Office) -> None:
    world.opens = False
    order = world.run(executive_in(world))
    assert order.state == State.FAILED
    assert "release: expected open grippers within 2 s" in order.status
    assert "says 'its plates do not move'" in order.status
    assert world.grips


def test_a_table_whose_tag_is_lost_while_it_is_held_is_let_go_and_left(world: Office) -> None:
    once(world, State.CLEAR, lambda: freeze(world, "table_a"), after=0.5)
    executive = executive_in(world)
    order = world.run(executive)
    assert Event.TAG_LOST in events(executive)
    assert executive.mission.vanished == ("table_a",)
    assert order.state == State.DONE, order.status
    assert world.things["table_b"][0] < -0.2, "the other one was moved instead"


def test_an_object_that_vanishes_on_the_way_is_left_alone(world: Office) -> None:
    once(world, State.NAVIGATE, lambda: freeze(world, "table_a"), after=2.0)
    executive = executive_in(world)
    for _ in range(2):
        world.run(executive, to=State.GET_GRASP_POINT)
    assert Event.VANISHED in events(executive)
    assert executive.mission.object == "table_b"


def test_a_table_that_somebody_moves_is_planned_for_anew(world: Office) -> None:
    def shove() -> None:
        world.things["table_a"] = np.array([-0.4, 1.2, 0.3])

    once(world, State.NAVIGATE, shove, after=3.0)
    executive = executive_in(world)
    world.run(executive, to=State.LOOK)
    assert events(executive)[-1] == Event.WAY_LOST
    assert world.run(executive, to=State.NAVIGATE).state == State.NAVIGATE


@pytest.mark.parametrize("state", [State.NAVIGATE, State.CLEAR])
def test_who_is_gone_is_waited_for_at_rest(world: Office, state: State) -> None:
    executive = executive_in(world)

    def gone() -> None:
        executive.pause("body_controller_node is gone")
        once(world, State.PAUSED, executive.resume, after=2.0)

    once(world, state, gone, after=1.0)
    for _ in range(2):
        assert world.run(executive, to=State.PLANNING).state == State.PLANNING
    after = world.states[world.states.index(State.PAUSED) + 1]
    assert after == (State.RELEASE if state == State.CLEAR else State.LOOK)
    assert executive.mission.account.seconds[State.PAUSED] == pytest.approx(2.0 + SETTINGS.pause_settle, abs=0.2)


def test_who_is_back_and_gone_again_is_waited_for_anew(world: Office) -> None:
    executive = executive_in(world)
    back: list[float] = []

    def gone() -> None:
        executive.pause("sim_node is gone")
        once(world, State.PAUSED, returns, after=1.0)

    def returns() -> None:
        executive.resume()
        back.append(world.time)
        if len(back) == 1:
            once(world, State.PAUSED, gone, after=0.5 * SETTINGS.pause_settle)

    once(world, State.NAVIGATE, gone, after=1.0)
    for _ in range(2):
        assert world.run(executive, to=State.PLANNING).state == State.PLANNING
    left = next(change.time for change in executive.mission.account.log if change.event == Event.LINK_BACK)
    assert len(back) == 2 and left - back[1] == pytest.approx(SETTINGS.pause_settle, abs=0.1)


def test_who_never_comes_back_is_told_of(world: Office) -> None:
    executive = executive_in(world)
    once(world, State.CLEAR, lambda: executive.pause("sim_node is gone"), after=1.0)
    order = world.run(executive)
    assert order.state == State.FAILED
    assert order.status.startswith("sim_node is gone, for more than 5 s; still left holds 'table_a', right holds")


def test_a_clock_that_is_set_back_is_rested_for(world: Office) -> None:
    executive = executive_in(world)

    def back() -> None:
        world.time -= 5.0

    once(world, State.NAVIGATE, back, after=2.0)
    for _ in range(2):
        assert world.run(executive, to=State.PLANNING).state == State.PLANNING
    assert "the clock was set back" in next(
        change.sentence for change in executive.mission.account.log if change.event == Event.LINK_LOST
    )


def test_lost_odometry_is_said_in_the_end(world: Office) -> None:
    def lose() -> None:
        world.odometry = False

    once(world, State.NAVIGATE, lose, after=2.0)
    order = world.run(executive_in(world))
    assert order.state == State.FAILED
    assert "odometry: expected one in the last 0.3 s" in order.status


def test_it_gives_up_after_its_time(world: Office) -> None:
    executive = executive_in(world, settings=SETTINGS.model_copy(update={"time_limit": 20.0}))
    order = world.run(executive)
    assert order.state == State.FAILED
    assert order.status.startswith("gave up: expected to be there within 20 s")
    assert world.time < 26.0


def test_it_gives_up_after_its_plans(world: Office) -> None:
    world.base_moves = False
    executive = executive_in(world, settings=SETTINGS.model_copy(update={"plans": 2, "tries": 99}))
    order = world.run(executive)
    assert order.state == State.FAILED
    assert "expected to be there with 2 plans" in order.status


@pytest.mark.parametrize("state", sorted(DRIVING))
def test_a_gripper_that_closes_on_the_way_is_opened_before_anything_goes_on(world: Office, state: State) -> None:
    world.joints = NOMINAL.copy()
    executive = executive_in(world, goal=np.array([-2.5, 2.0, 0.0]) if state == State.DRIVE_TO_GOAL else GOAL)
    world.run(executive, to=state)
    for _ in range(8):
        assert world.tick(executive).state == state
    world.hands["left"] = np.array([*world.base, 0.8])
    world.grips["left"] = Grip("table_a", np.zeros(2))
    assert world.tick(executive).state == State.RELEASE
    world.run(executive, to=State.LOOK)
    assert not world.grips


def test_a_move_that_never_opens_anything_is_left_alone_in_the_end(world: Office) -> None:
    short = Brain(world, moves=lambda move: replace(move, segments=((np.array([-0.05, 0.0, 0.0]), 1.0),)))
    settings = SETTINGS.model_copy(update={"tries": 1})
    executive = executive_in(world, short, settings=settings)
    order = world.run(executive)
    assert order.state == State.FAILED
    for name in ("table_a", "table_b"):
        assert f"{name} is left alone after 1 tries: moved as planned, but there is no" in order.status
    assert [job.tries for job in short.asked(PlanJob)] == [{}, {"table_a": 1}, {"table_a": 1, "table_b": 1}]
    assert len(status_of(executive).notes) == 2


def test_what_is_still_held_at_the_start_is_let_go_first(world: Office) -> None:
    world.grips = {"left": Grip("table_a", np.array([-0.375, 0.0]))}
    executive = executive_in(world, goal=np.array([-2.5, -1.5, 1.0]))
    assert world.run(executive).state == State.DONE
    assert world.states[:3] == [State.RELEASE, State.LOOK, State.GET_READY]


def test_times_that_are_none_are_rested_through(world: Office) -> None:
    executive = executive_in(world)
    for now in (math.nan, math.inf):
        order = executive.tick(now, world.percept())
        assert not any(twist.moves() for twist in order.twists.values())
        assert "time: expected a finite number" in order.status
    assert world.run(executive, to=State.NAVIGATE).state == State.NAVIGATE


def test_a_start_in_something_is_said(world: Office) -> None:
    world.base = np.array([0.3, 1.55, 0.0])
    order = world.run(executive_in(world))
    assert order.state == State.FAILED
    assert "start" in order.status


def test_a_goal_that_is_no_number_is_refused_at_once(world: Office) -> None:
    with pytest.raises(NamoError, match="goal: expected"):
        executive_in(world, goal=np.array([math.nan, 0.0, 0.0]))
    executive = executive_in(world)
    for goal in (np.zeros(2), np.array([0.0, math.inf, 0.0]), np.array([0.0, 0.0, math.inf])):
        with pytest.raises(NamoError, match="goal: expected"):
            executive.aim(goal)
    assert world.run(executive, to=State.NAVIGATE).state == State.NAVIGATE, "the goal before still stands"


def test_a_controller_that_never_stows_is_refused(world: Office) -> None:
    with pytest.raises(ControlError, match="stow_idle_arm"):
        NamoExecutive(
            GOAL,
            world.kinematics,
            ImmediateThinker(Brain(world)),
            controller=ControllerSettings(stow_idle_arm=False),
        )


def test_nothing_is_done_before_the_scene_was_told(world: Office) -> None:
    executive = NamoExecutive(GOAL, world.kinematics, ImmediateThinker(Brain(world)), settings=SETTINGS)
    order = world.run(executive)
    assert order.state == State.FAILED
    assert "got none of the scene; tag 'wall_middle'" in order.status
