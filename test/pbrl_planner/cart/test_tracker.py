"""Where robot and cart are, from streams that come late, in any order, or not at all."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pbrl_control.planar import compose
from pbrl_planner.cart.outline import GRIP
from pbrl_planner.cart.tracker import ALONE, CartTracker, grip_offset

CART = np.array([[-0.5, -0.275], [0.5, -0.275], [0.5, 0.275], [-0.5, 0.275]])
MIDDLE = np.array([0.65 + 0.484, 0.0, 0.0])


def told(tracker: CartTracker, time: float, pose: np.ndarray) -> None:
    tracker.moved(time, pose, np.zeros(3))
    tracker.localised(time, pose)
    tracker.cart_seen("hands", time, MIDDLE)


def test_state_needs_all_streams_and_their_order_does_not_matter() -> None:
    pose = np.array([1.0, 2.0, 0.3])
    steps = {
        "scene": lambda each: each.furniture({"cart": CART, "chair": CART}),
        "grasps": lambda each: each.grasps({"left": "cart", "right": "cart"}),
        "places": lambda each: told(each, 5.0, pose),
    }
    for order in itertools.permutations(steps):
        tracker = CartTracker()
        for name in order:
            assert tracker.state(5.0) is None and tracker.missing
            steps[name](tracker)
        assert tracker.missing == "" and tracker.state(5.0) == pytest.approx([1.0, 2.0, 0.3, 0.0])
        assert grip_offset(tracker.sight(5.0)) == pytest.approx((0.0, 0.0))


def test_own_outlines_are_where_robot_and_cart_are() -> None:
    tracker, pose = CartTracker(), np.array([1.0, 2.0, np.pi / 2])
    assert tracker.own(1.0) == []
    told(tracker, 1.0, pose)
    (robot,) = tracker.own(1.0)
    assert robot.shape == ALONE.shape and np.ptp(robot, axis=0) == pytest.approx(np.ptp(ALONE, axis=0)[::-1])
    tracker.furniture({"cart": CART})
    tracker.grasps({"left": "cart", "right": "cart"})
    reach = np.concatenate(tracker.own(1.0))
    assert reach[:, 1].max() == pytest.approx(2.0 + GRIP[0] + 1.0, abs=0.02), "the cart lies ahead, which is up"
    unseen = np.concatenate(tracker.own(2.0))
    assert unseen[:, 1].max() == pytest.approx(reach[:, 1].max()), "what is held is where it was last seen"
    tracker.grasps({})
    alone = np.concatenate(tracker.own(2.0))
    assert alone[:, 1].max() < 2.4, "where a cart is that was let go is not known any more"


def test_the_checkerboard_serves_while_the_hands_are_silent() -> None:
    tracker = CartTracker()
    tracker.furniture({"cart": CART})
    tracker.grasps({"left": "cart"})
    tracker.cart_seen("hands", 1.0, MIDDLE)
    tracker.cart_seen("checkerboard", 1.4, compose(np.array([0.65, 0.0, 0.2]), np.array([0.484, 0.0, 0.0])))
    assert tracker.sight(1.1).source == "hands" and tracker.sight(1.5).source == "checkerboard"
    assert tracker.sight(2.0) is None and tracker.last_sight().source == "checkerboard"


def test_readings_a_little_ahead_of_the_clock_set_the_time() -> None:
    tracker = CartTracker()
    assert tracker.now(7.0) == 7.0
    told(tracker, 7.02, np.zeros(3))
    assert tracker.now(7.0) == 7.02 and tracker.now(7.1) == 7.1 and tracker.now(3.0) == 3.0


def test_a_pose_from_before_a_clock_was_set_back_a_little_is_not_of_now() -> None:
    tracker = CartTracker()
    told(tracker, 10.0, np.array([5.0, 0.0, 0.0]))
    assert tracker.pose_time(10.04) == 10.04
    assert not tracker.moved(9.4, np.array([4.0, 0.0, 0.0]), np.zeros(3))
    assert tracker.pose_time(9.4) == 10.0, "the pose is still that of 10.0"


def test_odometry_late_is_left_aside_and_a_clock_set_back_begins_anew() -> None:
    tracker = CartTracker()
    told(tracker, 10.0, np.array([5.0, 0.0, 0.0]))
    assert not tracker.moved(9.9, np.array([4.0, 0.0, 0.0]), np.zeros(3))
    assert tracker.pose(10.0) == pytest.approx([5.0, 0.0, 0.0])
    assert tracker.moved(0.1, np.array([1.0, 0.0, 0.0]), np.zeros(3))
    assert tracker.pose(0.1) is None
    tracker.localised(0.1, np.array([1.0, 1.0, 0.0]))
    assert tracker.pose(0.1) == pytest.approx([1.0, 1.0, 0.0])
