"""The controller's action, tick by tick of a clock that this test sets: to the goal, and what stops it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist
from pbrl_msgs.action import FollowCartPath
from pbrl_msgs.msg import CartPath
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from pbrl_control.ros.qos import LATCHED
from pbrl_planner.costmap import LETHAL, CostField
from pbrl_planner.ros.cart_controller_node import CartControllerNode
from pbrl_planner.ros.conversions import path_to_msg, stamp_of
from pr2_cart_sim.description import BODY_JOINTS, description_path
from pr2_cart_sim.postures import DEFAULT_POSTURE, posture

Result = FollowCartPath.Result


class Driving:
    """The controller, and a robot that does what it is told."""

    def __init__(self, stage: Any) -> None:
        self.stage = stage
        stage.add(CartControllerNode)
        self.told: list = []
        self.twists, self.status = stage.hear(Twist, "/cmd_vel"), stage.hear(String, "/cart_controller/status", LATCHED)
        self.arms = stage.hear(Float64MultiArray, "/left_arm_velocity_controller/commands")
        self.floor = CostField(np.zeros((120, 240), np.uint8), 0.025, (0.0, 0.0), 0.0)
        self.scans = True
        self.results: list = []
        stands = posture(DEFAULT_POSTURE)
        self.joints = JointState(
            name=list(BODY_JOINTS), position=[0.244, *stands.head, 0.0, *stands.left, *stands.right]
        )

    def begin(self) -> None:
        self.stage.send("/robot_description", String(data=description_path().read_text(encoding="utf-8")), LATCHED)
        self.stage.tell_cart()

    def go(self, length: float = 0.6) -> list:
        x = np.linspace(self.stage.pose[0], self.stage.pose[0] + length, 13)
        poses = np.column_stack((x, np.full(13, 1.5), np.zeros((13, 2))))
        return self.follow(path_to_msg(poses, self.stage.time))

    def follow(self, path: CartPath) -> list:
        goal = FollowCartPath.Goal(path=path)
        self.results = self.stage.ask(FollowCartPath, "/follow_cart_path", goal, self.told.append)
        return self.results

    def tick(self) -> None:
        """One tick: everything is told, the clock last, and the command that comes is obeyed."""
        stage, before = self.stage, len(self.twists)
        if self.scans:
            stage.tell_floor(
                "/local_costmap/costmap", CostField(self.floor.cells, 0.025, (0.0, 0.0), stage.time + 0.05)
            )
        self.joints.header.stamp = stamp_of(stage.time + 0.05)
        stage.send("/joint_states", self.joints)
        stage.tick(0.05)
        stage.until(lambda: len(self.twists) > before or self.results)
        sent = self.twists[-1]
        stage.twist = np.array([sent.linear.x, sent.linear.y, sent.angular.z])

    def speed(self) -> float:
        return float(np.abs(self.stage.twist).max())

    def tick_until(self, condition: Any, most: int) -> int:
        for count in range(most):
            if condition():
                return count
            self.tick()
        raise AssertionError(f"not after {most} ticks: {[each.data for each in self.status]}")


@pytest.fixture
def driving(stage: Any) -> Driving:
    made = Driving(stage)
    made.begin()
    return made


def test_it_drives_to_the_end_of_a_path(driving: Driving) -> None:
    results = driving.go()
    driving.tick_until(lambda: driving.speed() > 0.25, 40)
    driving.tick_until(lambda: results, 120)
    assert results[0].outcome == Result.ARRIVED
    assert np.abs(driving.stage.pose - [1.6, 1.5, 0.0]).max() < 0.021
    assert driving.speed() == 0.0, "the last command stops it"
    left = [each.remaining for each in driving.told]
    assert left[0] > 1.5 and left[-1] < 0.2 and all(a >= b - 1e-9 for a, b in pairwise(left))
    passed = [each.passed for each in driving.told]
    assert 1 <= passed[0] <= passed[len(passed) // 2] <= passed[-1] and passed == sorted(passed)
    assert driving.arms and len(driving.arms[0].data) == 7
    assert driving.status[-1].data == "arrived"


def test_a_silent_laser_stops_it_within_the_time_allowed(driving: Driving) -> None:
    results = driving.go(2.0)
    driving.tick_until(lambda: driving.speed() > 0.3, 60)
    last, driving.scans = driving.stage.time, False
    driving.tick_until(lambda: driving.speed() == 0.0, 20)
    assert driving.stage.time - last <= 0.3 + 1e-9
    assert any("laser" in each.data for each in driving.status)
    assert not results, "it waits for the laser"
    driving.scans = True
    driving.tick_until(lambda: driving.speed() > 0.2, 60)
    driving.scans = False
    driving.tick_until(lambda: results, 140)
    assert results[0].outcome == Result.REPLAN and "laser" in results[0].message


def test_joint_states_without_a_position_a_name_are_left_aside(driving: Driving) -> None:
    results = driving.go()
    driving.tick_until(lambda: driving.speed() > 0.25, 40)
    good, driving.joints = driving.joints, JointState(name=driving.joints.name, position=[0.0])
    driving.tick()
    driving.joints = good
    driving.tick_until(lambda: results, 120)
    assert results[0].outcome == Result.ARRIVED, results[0].message


def test_a_hand_that_loses_the_cart_ends_the_drive_and_says_which(driving: Driving) -> None:
    results = driving.go(2.0)
    driving.tick_until(lambda: driving.speed() > 0.2, 60)
    driving.stage.tell_grasps(("left",))
    ticks = driving.tick_until(lambda: driving.speed() == 0.0, 12)
    assert ticks <= 6
    driving.stage.until(lambda: results)
    assert results[0].outcome == Result.GRIP_LOST and "right" in results[0].message
    driving.stage.until(lambda: "right" in driving.status[-1].data)


def test_hands_that_come_apart_on_the_cart_end_the_drive(driving: Driving) -> None:
    results = driving.go(2.0)
    driving.tick_until(lambda: driving.speed() > 0.2, 60)
    driving.joints.position[driving.joints.name.index("l_shoulder_pan_joint")] += 0.2
    driving.tick_until(lambda: results, 20)
    assert results[0].outcome == Result.GRIP_LOST
    assert "expected the hands within 0.03 m of where they took hold" in results[0].message


def test_it_stops_before_what_is_in_the_way_and_then_gives_up(driving: Driving) -> None:
    results = driving.go(2.0)
    driving.floor.cells[:, 130:134] = LETHAL  # at 3.25 m: 0.6 m before the cart
    driving.tick_until(lambda: any(each.blocked > 1.0 for each in driving.told), 120)
    front = driving.stage.pose[0] + 1.65
    assert 2.8 < front < 3.25 and driving.speed() < 0.01
    assert "in the way" in driving.told[-1].reason
    driving.tick_until(lambda: results, 120)
    assert results[0].outcome == Result.REPLAN


def test_another_path_takes_the_place_and_commands_do_not_jump(driving: Driving) -> None:
    first = driving.go(2.0)
    driving.tick_until(lambda: driving.speed() > 0.3, 60)
    second = driving.go(1.0)
    driving.stage.until(lambda: first)
    assert first[0].outcome == Result.STOPPED
    for _ in range(8):
        before = driving.stage.twist
        driving.tick()
        assert np.abs(driving.stage.twist - before).max() < 2.0 * 0.1 + 1e-9, "braking for as long as a tick counts"
    driving.tick_until(lambda: second, 120)
    assert second[0].outcome == Result.ARRIVED


def test_what_is_no_path_is_refused_in_words(driving: Driving) -> None:
    good = path_to_msg(np.array([[1.0, 1.5, 0.0, 0.0], [1.2, 1.5, 0.0, 0.0]]), 1.0)
    for fault, word in (
        (CartPath(), "frame 'map', got ''"),
        (CartPath(path=good.path), "an articulation for each pose, got 0 for 2"),
        (CartPath(path=good.path, articulation=[0.0, float("nan")]), "finite"),
    ):
        results = driving.follow(fault)
        driving.stage.until(lambda results=results: results)
        assert results[0].outcome == Result.REFUSED and word in results[0].message


def test_without_a_costmap_it_says_so(driving: Driving) -> None:
    driving.scans = False
    results = driving.go()
    driving.tick_until(lambda: results, 140)
    assert results[0].outcome == Result.REFUSED and "/local_costmap/costmap" in results[0].message
