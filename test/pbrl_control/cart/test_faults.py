"""The local controller when something is wrong: silent sensors, a cart that slips, a robot that is pushed, nonsense."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cart_cases import SETTINGS, Costs, arc, assert_within_limits, drive, made, open_floor, pr2_body, straight

from pbrl_control.cart import (
    ArmState,
    CartController,
    CartPlan,
    CartSettings,
    Cause,
    DriveStatus,
)
from pbrl_control.errors import ControlError

FLOOR = open_floor()


FULL = np.ones((2, 7))
ARMS = ArmState(np.tile(np.eye(6, 7), (2, 1, 1)), 0.0 * FULL, -1e3 * FULL, 1e3 * FULL, 1e3 * FULL)


@pytest.mark.parametrize("age", [0.0, 0.01, 0.02, 0.03, 0.04])
@pytest.mark.parametrize(
    ("stream", "cause"),
    [
        ("scan_time", Cause.SCAN),
        ("pose_time", Cause.POSE),
        ("articulation_time", Cause.ARTICULATION),
        ("arms_time", Cause.JOINTS),
    ],
)
def test_a_stream_that_falls_silent_stops_it_within_0_3_s_of_its_last_message(
    stream: str, cause: Cause, age: float
) -> None:
    for path in (straight(2.5), straight(2.5, 0.6), arc(1.0, 1.5, 0.5)):
        controller, world = made(path)
        silent = {}

        def streams(w: object, silent: dict = silent) -> dict:
            given = {"arms": ARMS, "arms_time": w.now - 0.03, "scan_time": w.now - 0.03}
            return given if w.now < 2.0 else given | {stream: silent.setdefault("last", w.now - age)}

        ticks = drive(controller, world, FLOOR, 3.0, streams)
        assert max(np.abs(tick.sent).max() for tick in ticks) > 0.2
        late = [tick for tick in ticks if tick.now >= silent["last"] + 0.3]
        # A laser's next may take 0.05 s, and that counts; the others come at 50 Hz, and their next is waited for.
        obeyed = silent["last"] + 0.3 + (0.0 if cause is Cause.SCAN else 0.02) - SETTINGS.delay
        assert not np.any([tick.sent for tick in ticks if tick.now + SETTINGS.period > obeyed + 1e-9])
        assert np.abs(late[1].rates).max() < 0.02, "but for the lag of the drives"
        assert late[-1].command.status is DriveStatus.WAITING and late[-1].command.cause is cause
        assert_within_limits(ticks, SETTINGS.limits)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"pose": None}, Cause.POSE),
        ({"pose": np.array([0.0, np.nan, 0.0])}, Cause.POSE),
        ({"pose_time": -1.0}, Cause.POSE),
        ({"pose_time": 1e9}, Cause.POSE),
        ({"articulation": None}, Cause.ARTICULATION),
        ({"articulation": math.inf}, Cause.ARTICULATION),
        ({"articulation_time": -1.0}, Cause.ARTICULATION),
        ({"scan_time": -math.inf}, Cause.SCAN),
        ({"scan_time": math.nan}, Cause.SCAN),
        ({"arms_time": -1.0}, Cause.JOINTS),
        ({"arms_time": math.nan}, Cause.JOINTS),
    ],
)
def test_percepts_that_are_old_or_no_numbers_stop_it_until_they_are_good_again(change: dict, cause: Cause) -> None:
    def good(w: object) -> dict:
        return {"arms": ARMS, "arms_time": w.now - 0.02}

    controller, world = made(straight(1.0))
    ticks = drive(controller, world, FLOOR, 20.0, lambda w: good(w) | (change if 1.5 <= w.now < 2.5 else {}))
    bad = [tick for tick in ticks if 1.5 <= tick.now < 2.5]
    assert {tick.command.status for tick in bad} == {DriveStatus.WAITING}
    assert {tick.command.cause for tick in bad} == {cause}
    assert not np.any(bad[-1].sent) and bad[0].command.reason
    assert ticks[-1].command.status is DriveStatus.ARRIVED
    assert_within_limits(ticks, SETTINGS.limits)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"holds": (True, False)}, "the right one has lost it"),
        ({"holds": (False, True)}, "the left one has lost it"),
        ({"holds": (False, False)}, "neither"),
        ({"misfit": 0.05}, "0.050 m off"),
        ({"grip_offset": (0.1, 0.0)}, "0.100 m away"),
        ({"grip_offset": (np.nan, 0.0)}, "nan m away"),
    ],
)
def test_a_cart_that_slips_from_a_hand_stops_it_for_good(change: dict, words: str) -> None:
    controller, world = made(straight(1.0))
    ticks = drive(controller, world, FLOOR, 3.0, lambda w: change if 1.5 <= w.now < 1.6 else {})
    after = [tick for tick in ticks if tick.now >= 1.5]
    assert {tick.command.status for tick in after} == {DriveStatus.FAILED}
    assert after[0].command.cause is Cause.GRIP and words in after[0].command.reason
    assert not np.any([tick.sent for tick in after[6:]])
    assert_within_limits(ticks, SETTINGS.limits)


def test_one_hand_alone_cannot_tell_a_misfit() -> None:
    controller, world = made(straight(0.5))
    ticks = drive(controller, world, FLOOR, 10.0, lambda w: {"misfit": math.nan})
    assert ticks[-1].command.status is DriveStatus.ARRIVED


def test_a_robot_that_was_pushed_away_asks_for_a_new_plan() -> None:
    controller, world = made(straight(1.0))
    world.state = world.state + np.array([0.0, 0.3, 0.0, 0.0])
    world.__post_init__()
    ticks = drive(controller, world, FLOOR, 1.0)
    assert ticks[-1].command.status is DriveStatus.REPLAN and ticks[-1].command.cause is Cause.OFF_PLAN


def test_a_base_that_does_not_move_is_not_waited_for_for_ever() -> None:
    controller, world = made(straight(1.0), slip=np.zeros(4))
    ticks = drive(controller, world, FLOOR, 20.0)
    assert ticks[-1].command.status is DriveStatus.REPLAN
    assert ticks[-1].command.cause in (Cause.LAG, Cause.OFF_PLAN)


def test_hostile_input_is_refused_in_words() -> None:
    controller, world = made(straight(1.0))
    for costs, words in (
        (Costs(np.zeros((3, 3))), "uint8"),
        (Costs(np.zeros(3, dtype=np.uint8)), "rows, columns"),
        (Costs(np.zeros((0, 3), dtype=np.uint8)), "rows, columns"),
        (Costs(np.zeros((3, 3), dtype=np.uint8), 0.0), "resolution"),
        (Costs(np.zeros((3, 3), dtype=np.uint8), 0.1, (0.0, math.nan)), "origin"),
    ):
        with pytest.raises(ControlError, match=words):
            controller.step(0.0, world.percept(costs))
    with pytest.raises(ControlError, match="finite time"):
        controller.step(math.nan, world.percept(FLOOR))
    with pytest.raises(ControlError, match="4 finite numbers"):
        CartController(CartPlan.timed(straight(1.0), SETTINGS.limits), pr2_body(), SETTINGS, np.zeros(3))
    for changes, words in (
        ({"stop_within": 0.06}, "stop_within"),
        ({"near": 0.0, "margin": 0.1}, "near"),
        ({"limits": {"braking": 0.1}}, "braking"),
        ({"frequency": math.nan}, "finite|less"),
    ):
        with pytest.raises(ValueError, match=words):
            CartSettings(**changes)


def test_a_clock_that_stands_or_runs_back_does_not_make_it_jump() -> None:
    controller, world = made(straight(1.0))
    ticks = drive(controller, world, FLOOR, 1.0)
    before = ticks[-1].sent
    again = controller.step(
        ticks[-1].now,
        world.percept(FLOOR, pose_time=ticks[-1].now, articulation_time=ticks[-1].now, scan_time=ticks[-1].now),
    )
    assert np.allclose([*again.twist, again.articulation_rate], before, atol=1e-9)
