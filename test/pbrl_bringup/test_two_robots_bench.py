"""The bench of two robots: rooms that mirror each other, and an arrival that counts only at the robot's own goal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Pose2D
from pbrl_msgs.msg import NamoStatus
from rosgraph_msgs.msg import Clock

from bullet_sim.scene import load_scene
from pbrl_bringup.benches import two_robots
from pbrl_bringup.benches.two_robots import GOALS, arrival, room
from pbrl_bringup.commands.bench import BENCHES
from pbrl_bringup.ros.client import Heard


def test_it_is_known_to_the_command() -> None:
    assert "two-robots" in BENCHES
    assert callable(two_robots.measure)


@pytest.mark.parametrize("shut_in", [False, True])
def test_the_second_room_is_the_first_in_a_mirror(shut_in: bool, tmp_path: Path) -> None:
    outlines = []
    for mirrored in (False, True):
        path = tmp_path / f"{mirrored}.yaml"
        path.write_text(room("room", mirrored=mirrored, shut_in=shut_in))
        scene = load_scene(str(path))
        assert set(scene.bodies) == ({"cupboard", "table"} if shut_in else {"cupboard"})
        corners = np.array(scene.bodies["cupboard"].footprint) + np.array(scene.bodies["cupboard"].pose[:2])
        outlines.append(np.abs(sorted(corners.tolist())))
        assert scene.robot.pose[1] == (-0.3 if mirrored else 0.3)
    np.testing.assert_allclose(*(np.sort(each, axis=0) for each in outlines))


def test_another_robot_s_goal_is_no_arrival() -> None:
    (first, goal), (_, other) = GOALS.items()
    clock = Heard()
    clock(Clock())
    clock.message.clock.sec = 12

    def ended(x: float, y: float, success: bool) -> bool:
        told = NamoStatus(state="Done", sentence="at the goal", finished=True, success=success, goal=Pose2D(x=x, y=y))
        found = arrival(first, told, clock, 30.0)
        assert (found.simulated, found.seconds, found.sentence) == (12.0, 30.0, "Done: at the goal")
        return found.arrived

    assert ended(*goal, True)
    assert not ended(*goal, False)
    assert not ended(*other, True)
