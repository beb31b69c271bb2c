"""The table from a goal to its end."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pbrl_planner.cart.leg import ENDED, Drove, Leg, LegState, Order
from pbrl_planner.cart.query import Outcome
from pbrl_planner.cart.settings import NavigationSettings

SETTINGS = NavigationSettings(blocked=2.0, retry=2.0, retry_most=6.0, give_up=30.0, make_way=1e3)
MAKES_WAY = SETTINGS.model_copy(update={"make_way": 10.0, "room": 8.0})


def driving() -> Leg:
    leg = Leg(SETTINGS, 0.0)
    assert leg.tick(0.0) is Order.PLAN
    assert leg.planned(0.1, Outcome.FOUND, "4 s") is Order.FOLLOW
    return leg


def test_straight_to_the_goal() -> None:
    leg = driving()
    assert leg.state is LegState.DRIVING and leg.tick(9.0) is Order.NOTHING
    assert leg.driving(1.0, 0.0, "") is Order.NOTHING and leg.sentence == "on the way"
    assert leg.drove(2.0, Drove.ARRIVED, "") is Order.END and leg.state is LegState.ARRIVED
    assert (leg.plans, leg.failures) == (1, 0)


def test_one_question_at_a_time() -> None:
    leg = Leg(SETTINGS, 0.0)
    assert leg.tick(0.0) is Order.PLAN
    assert {leg.tick(t) for t in (0.1, 5.0, 50.0)} == {Order.NOTHING}


@pytest.mark.parametrize("outcome", [Outcome.NO_PATH, Outcome.GOAL_OCCUPIED, Outcome.UNDECIDED, Outcome.NOT_READY])
def test_without_a_path_it_is_tried_again_until_patience_is_over(outcome: Outcome) -> None:
    leg, now, times = Leg(SETTINGS, 0.0), 0.0, []
    while leg.state not in ENDED:
        if leg.tick(now) is Order.PLAN:
            order = leg.planned(now, outcome, "why")
            assert order is (Order.END if leg.state in ENDED else Order.FORGET)
            times.append(now)
        now += 0.5
    assert leg.state is LegState.FAILED and leg.sentence == "no path for 36 s; why" and leg.failures == len(times)
    assert np.diff(times).tolist() == [2.0, 4.0, 6.0, 6.0, 6.0, 6.0, 6.0], "less often as it lasts"


@pytest.mark.parametrize("outcome", [Outcome.GOAL_OFF_MAP, Outcome.START_OFF_MAP])
def test_what_no_patience_mends_ends_at_once(outcome: Outcome) -> None:
    leg = Leg(SETTINGS, 0.0)
    leg.tick(0.0)
    assert leg.planned(0.1, outcome, "off") is Order.END and leg.sentence == "off"


def test_who_is_shut_in_clears_first() -> None:
    leg = Leg(SETTINGS, 0.0)
    leg.tick(0.0)
    assert leg.planned(0.1, Outcome.START_OCCUPIED, "") is Order.CLEAR
    assert leg.tick(1.0) is Order.NOTHING and leg.tick(2.2) is Order.PLAN


def test_before_something_it_looks_for_a_way_round_and_keeps_the_old_one() -> None:
    leg = driving()
    assert leg.driving(3.0, 1.9, "somebody") is Order.NOTHING and leg.sentence == "somebody"
    assert leg.driving(3.1, 2.0, "somebody") is Order.PLAN
    assert leg.driving(3.2, 2.1, "somebody") is Order.NOTHING
    assert leg.planned(4.0, Outcome.NO_PATH, "none") is Order.FORGET and leg.state is LegState.DRIVING
    assert leg.driving(5.9, 5.0, "somebody") is Order.NOTHING and leg.driving(6.0, 5.1, "somebody") is Order.PLAN
    assert leg.planned(6.1, Outcome.FOUND, "") is Order.FOLLOW
    assert leg.failures == 1 and leg.plans == 3


def test_a_way_round_what_has_gone_meanwhile_is_not_taken() -> None:
    leg = driving()
    assert leg.driving(3.0, 2.0, "somebody") is Order.PLAN and leg.asked
    leg.driving(4.0, 0.0, "")
    assert leg.planned(4.1, Outcome.FOUND, "from where it stood") is Order.NOTHING
    assert leg.state is LegState.DRIVING and not leg.asked


def test_a_drive_that_is_given_up_is_planned_again() -> None:
    leg = driving()
    assert leg.drove(2.0, Drove.REPLAN, "too far off") is Order.CLEAR and leg.sentence == "too far off"
    assert leg.tick(2.2) is Order.PLAN and leg.state is LegState.PLANNING


def test_while_there_is_no_other_path_what_is_left_of_it_is_gone_on_with_once_it_is_free() -> None:
    leg = driving()
    leg.driving(3.0, 2.0, "somebody")
    leg.planned(3.1, Outcome.NO_PATH, "none")
    assert leg.drove(6.0, Drove.REPLAN, "somebody, for more than 5 s") is Order.CLEAR
    assert leg.tick(6.05) is Order.PLAN, "at once, however long the pause was"
    assert leg.planned(6.1, Outcome.NO_PATH, "none") is Order.GO_ON and leg.state is LegState.DRIVING
    assert leg.driving(6.2, 0.0, "") is Order.NOTHING and leg.sentence == "on the way"
    assert leg.driving(30.0, 0.0, "") is Order.REFINE


def test_who_is_shut_in_clears_before_it_goes_on() -> None:
    leg = driving()
    leg.drove(6.0, Drove.REPLAN, "")
    leg.tick(6.0)
    assert leg.planned(6.1, Outcome.START_OCCUPIED, "") is Order.CLEAR and leg.state is LegState.WAITING
    leg.tick(20.0)
    assert leg.planned(20.1, Outcome.NO_PATH, "") is Order.GO_ON


def test_who_stands_before_something_gives_up_in_the_end_and_who_gets_on_does_not() -> None:
    for gets_on in (False, True):
        leg = driving()
        orders = set()
        for now in np.arange(3.0, 60.0, 0.5):
            if gets_on and now % 10.0 == 0.0:
                leg.got_on()
            if leg.driving(now, 5.0, "somebody") is Order.PLAN:
                orders.add(leg.planned(now, Outcome.NO_PATH, "none"))
        assert (leg.state is LegState.FAILED) is not gets_on and (Order.END in orders) is not gets_on


def test_where_something_was_forgotten_it_is_asked_again_soon() -> None:
    leg = Leg(SETTINGS, 0.0)
    for now in (0.0, 2.0, 6.0):
        assert leg.tick(now) is Order.PLAN
        leg.planned(now, Outcome.NO_PATH, "")
    leg.forgot(6.0)
    assert leg.tick(7.9) is Order.NOTHING and leg.tick(8.0) is Order.PLAN


@pytest.mark.parametrize("ended", [Drove.GRIP_LOST, Drove.REFUSED, Drove.STOPPED])
def test_other_ends_of_a_drive_end_the_goal(ended: Drove) -> None:
    leg = driving()
    assert leg.drove(2.0, ended, "") is Order.END and leg.state is LegState.FAILED and leg.sentence == str(ended)


def test_whatever_comes_after_the_end_changes_nothing() -> None:
    leg = driving()
    leg.drove(2.0, Drove.ARRIVED, "")
    before = (leg.state, leg.sentence, leg.plans)
    assert leg.planned(9.0, Outcome.FOUND, "x") is leg.drove(9.0, Drove.REPLAN, "y") is leg.tick(99.0) is Order.NOTHING
    assert leg.driving(9.0, 9.0, "z") is Order.NOTHING and (leg.state, leg.sentence, leg.plans) == before


def test_no_order_of_events_leaves_it_with_nothing_to_do_for_ever() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        leg, now, asked, driven = Leg(SETTINGS, 0.0), 0.0, False, False
        for _ in itertools.count():
            now += float(rng.uniform(0.1, 3.0))
            order = Order.NOTHING
            if asked and rng.random() < 0.5:
                asked, order = False, leg.planned(now, list(Outcome)[rng.integers(len(Outcome))], "")
            elif driven and rng.random() < 0.3:
                driven, order = False, leg.drove(now, list(Drove)[rng.integers(len(Drove))], "")
            elif driven:
                order = leg.driving(now, float(rng.uniform(0.0, 4.0)), "")
            else:
                order = leg.tick(now)
            assert not (order is Order.PLAN and asked), "never two questions"
            asked = asked or order in (Order.PLAN, Order.REFINE)
            driven = driven or order in (Order.FOLLOW, Order.GO_ON, Order.BACK)
            assert driven or not leg.backing
            if order is Order.END:
                assert leg.state in ENDED
                break
            assert now < 5000.0 and leg.state not in ENDED


def test_on_the_way_a_better_path_is_looked_for_from_time_to_time() -> None:
    leg = driving()
    assert leg.driving(15.0, 0.0, "") is Order.NOTHING and leg.driving(15.2, 0.0, "") is Order.REFINE
    assert leg.driving(16.0, 3.0, "somebody") is Order.NOTHING, "one question at a time"
    assert leg.driving(16.5, 0.0, "") is Order.NOTHING
    assert leg.planned(17.0, Outcome.FOUND, "") is Order.SWITCH and leg.state is LegState.DRIVING
    assert leg.driving(30.0, 0.0, "") is Order.NOTHING and leg.driving(32.1, 0.0, "") is Order.REFINE
    assert leg.planned(33.0, Outcome.NO_PATH, "") is Order.NOTHING and leg.state is LegState.DRIVING
    assert (leg.plans, leg.failures) == (3, 1)


def test_a_better_path_for_a_drive_that_has_ended_is_no_path_from_here() -> None:
    leg = driving()
    assert leg.driving(16.0, 0.0, "") is Order.REFINE
    assert leg.drove(17.0, Drove.REPLAN, "off the path") is Order.CLEAR and leg.tick(18.0) is Order.NOTHING
    assert leg.planned(18.5, Outcome.FOUND, "") is Order.NOTHING and leg.tick(18.6) is Order.PLAN


def test_where_too_little_is_left_nothing_is_asked() -> None:
    leg = driving()
    assert leg.driving(16.0, 0.0, "") is Order.REFINE
    leg.nothing_ahead(16.0)
    assert not leg.asked and leg.driving(20.0, 0.0, "") is Order.NOTHING
    assert leg.driving(21.0, 2.5, "somebody") is Order.PLAN


def stuck(leg: Leg, now: float, driving: bool) -> float:
    """Answer every question with no path until robot and cart are to go back; return when that is [s]."""
    while True:
        asked = leg.driving(now, 5.0, "somebody") if driving else leg.tick(now)
        if asked is Order.PLAN and leg.planned(now, Outcome.NO_PATH, "shut") is Order.BACK:
            return now
        now += 0.5
        assert now < 60.0


@pytest.mark.parametrize("before_something", [False, True])
@pytest.mark.parametrize("ended", [Drove.ARRIVED, Drove.REPLAN])
def test_who_has_no_path_for_long_goes_back_waits_and_tries_again(before_something: bool, ended: Drove) -> None:
    leg = Leg(MAKES_WAY, 0.0)
    leg.tick(0.0)
    if before_something:
        leg.planned(0.0, Outcome.FOUND, "4 s")
    else:
        leg.planned(0.0, Outcome.NO_PATH, "shut")
    back = stuck(leg, 0.5, before_something)
    assert MAKES_WAY.make_way < back < MAKES_WAY.make_way + 2.0 * MAKES_WAY.retry_most
    assert leg.state is LegState.DRIVING and "to make way" in leg.sentence
    orders = {leg.driving(back + t, 9.0, "x") for t in (1.0, 9.0, 20.0)} | {leg.tick(back + 20.0)}
    assert orders == {Order.NOTHING}, "nothing is asked on the way back"
    there = back + 21.0
    assert leg.drove(there, ended, "") is (Order.CLEAR if ended is Drove.REPLAN else Order.NOTHING)
    assert leg.state is LegState.WAITING and leg.tick(there + MAKES_WAY.room - 0.1) is Order.NOTHING
    assert leg.tick(there + MAKES_WAY.room) is Order.PLAN
    assert leg.planned(there + 8.1, Outcome.NO_PATH, "shut") in (Order.FORGET, Order.CLEAR)
    again = stuck(leg, there + 8.2, False)
    assert again <= there + 2.0 * MAKES_WAY.room + MAKES_WAY.retry_most, "sooner than the first time"
    leg.drove(again + 9.0, ended, "")
    there = again + 9.0
    assert leg.tick(there + MAKES_WAY.room) is Order.PLAN
    assert leg.planned(there + 8.1, Outcome.FOUND, "4 s") is Order.FOLLOW
    assert leg.drove(there + 12.0, Drove.ARRIVED, "") is Order.END and leg.state is LegState.ARRIVED


@pytest.mark.parametrize("gets_on", [True, False])
def test_who_gets_on_in_between_is_not_stuck_and_who_finds_paths_in_between_is(gets_on: bool) -> None:
    leg, orders = Leg(MAKES_WAY, 0.0), []
    leg.tick(0.0)
    leg.planned(0.0, Outcome.FOUND, "99 s")
    for now in np.arange(1.0, 40.0, 0.5):
        waits = now % 8.0 < 5.0  # somebody walks by, and somebody else
        if leg.driving(now, now % 8.0 if waits else 0.0, "somebody") is Order.PLAN:
            orders.append(leg.planned(now, Outcome.NO_PATH if now % 3.0 < 2.0 else Outcome.FOUND, "shut"))
        if gets_on and not waits:
            leg.got_on()
    assert (Order.BACK in orders) == (not gets_on) and Order.FOLLOW in orders and Order.FORGET in orders


def test_who_came_from_nowhere_goes_on_asking() -> None:
    leg = Leg(MAKES_WAY, 0.0)
    leg.tick(0.0)
    leg.planned(0.0, Outcome.NO_PATH, "shut")
    back = stuck(leg, 0.5, False)
    leg.nothing_behind()
    assert leg.state is LegState.WAITING and leg.tick(back + SETTINGS.retry_most) is Order.PLAN
