"""Krang sits: in every posture wheels and slider carry it as statics says, and it stays as it was put."""

from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.client import GRAVITY
from krang_sim.postures import POSTURES
from krang_sim.robot import BODY_JOINTS, JOINTS

SLIDER = -0.46
"""Where the slider meets the floor, in `base` [m]."""


def centre_of_mass(stage) -> tuple[float, np.ndarray]:
    """Mass [kg] and centre (3,) [m] of the whole robot, from its links."""
    api, number = stage.client.api, stage.robot.number
    base = api.getDynamicsInfo(number, -1)
    masses, places = [base[0]], [np.array(api.getBasePositionAndOrientation(number)[0])]
    for link in range(api.getNumJoints(number)):
        masses.append(api.getDynamicsInfo(number, link)[0])
        places.append(np.array(api.getLinkState(number, link, computeForwardKinematics=1)[0]))
    return float(np.sum(masses)), np.array(masses) @ np.array(places) / np.sum(masses)


def borne(stage, link: str) -> float:
    """Force [N] with which the floor carries a link."""
    floor = stage.client.bodies["floor"]
    points = stage.client.api.getContactPoints(stage.robot.number, floor, stage.robot.links[link])
    return sum(point[9] * point[7][2] * np.sign(point[7][2]) for point in points)


@pytest.mark.parametrize("name", POSTURES)
def test_wheels_and_slider_share_the_weight_as_statics_says(stages, name):
    stage = stages(name)
    stage.run(1.0)
    loads = {link: [] for link in ("slider", "left_wheel", "right_wheel")}
    for _ in range(80):
        stage.run(stage.client.step_time)
        for link, seen in loads.items():
            seen.append(borne(stage, link))
    mass, centre = centre_of_mass(stage)
    slider, left, right = (np.mean(seen) for seen in loads.values())
    assert slider + left + right == pytest.approx(mass * GRAVITY, rel=0.01)
    assert slider == pytest.approx(mass * GRAVITY * centre[0] / SLIDER, rel=0.05)
    assert min(slider, left, right) > 50.0  # far from tipping over any of the three
    stage.client.close()


@pytest.mark.parametrize("name", POSTURES)
def test_a_posture_is_kept(stages, name):
    stage = stages(name)
    stage.run(1.0)
    angles = stage.robot.joint_state()[0][[JOINTS.index(joint) for joint in BODY_JOINTS]]
    np.testing.assert_allclose(angles, POSTURES[name].body_joints, atol=5e-4)
    base = stage.robot.base_pose()
    assert np.degrees(np.arccos(base.matrix[2, 2])) < 0.3
    assert np.hypot(*base.position[:2]) < 0.002
    stage.client.close()
