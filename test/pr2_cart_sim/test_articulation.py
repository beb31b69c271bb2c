"""The arms turn the cart about its handle (thesis section 4.5.6): hands, grips, casters and estimate together."""

from __future__ import annotations

import numpy as np
import pytest

from pr2_cart_sim.description import ARM_JOINTS, SIDES
from pr2_cart_sim.observations import CartReading
from pr2_cart_sim.sensing import in_base
from pr2_cart_sim.session import FINGERS, Pr2Session

HANDLE = np.array([0.65, 0.0])


def hand_jacobian(session: Pr2Session, side: str) -> np.ndarray:
    """Jacobian (6, 7) of the middle between the fingers in `world`."""
    robot, api = session.robot, session.office.world.client.api
    joints = list(robot._movable)
    states = [state[0] for state in api.getJointStates(robot.number, joints)]
    link = robot.links[f"{side}_ft"]
    off = FINGERS.middle - np.array(api.getLinkState(robot.number, link)[2])
    still = [0.0] * len(states)
    linear, angular = api.calculateJacobian(robot.number, link, off.tolist(), states, still, still)
    index = session.office.world.client.joints("pr2")
    columns = [joints.index(index[name]) for name in ARM_JOINTS[side]]
    return np.vstack([np.array(linear)[:, columns], np.array(angular)[:, columns]])


@pytest.mark.parametrize("turn", [0.3, -0.3])
def test_the_arms_turn_the_cart_about_its_handle(make_scene, make_session, run, turn):
    session = make_session(make_scene())

    def articulate() -> None:
        for side in SIDES:
            hand = session.robot.link_pose(f"{side}_ft").point(FINGERS.middle)
            off = hand[:2] - HANDLE
            jacobian = hand_jacobian(session, side)
            twist = np.array([-turn * off[1], turn * off[0], 0, 0, 0, turn])
            session.command_arm(side, jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-4 * np.eye(6), twist))

    seen = run(session, 0.6, articulate)
    pose = in_base(session.robot.base_pose(), session.office.world.pose("cart"))
    angle = turn * 0.6
    assert pose[2] == pytest.approx(angle, abs=0.05)
    np.testing.assert_allclose(pose[:2], HANDLE + 0.484 * np.array([np.cos(angle), np.sin(angle)]), atol=0.02)
    reading = [one for one in seen if isinstance(one, CartReading) and one.source == "hands"][-1]
    np.testing.assert_allclose(reading.pose, pose, atol=0.015)
    assert session.contacts == []
    np.testing.assert_allclose(session.robot_truth()[0], 0.0, atol=2e-3)  # the held wheels bear what the arms push
