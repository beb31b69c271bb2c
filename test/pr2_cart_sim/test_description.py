"""The URDF against the published test vectors of the PR2's chain, in two engines that share no code."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio
import pytest

from bullet_sim.client import BulletClient, Pose
from pr2_cart_sim.description import BODY_JOINTS, description_path
from pr2_cart_sim.postures import POSTURES, Posture, mirrored

ZERO = (0.0,) * 7
POSES = {
    "P0": Posture(0.0, ZERO, ZERO),
    "P1": POSTURES["untucked"],
    "P2": Posture(0.2, (0.5, 0.3, 1.0, -1.2, 0.7, -0.9, 0.4), (-0.2, 0.8, -0.5, -1.6, -0.3, -0.6, 1.1)),
    "P3": POSTURES["table_forward"],
    "P4": POSTURES["edge_grasp"],
    "P5": POSTURES["tucked"],
}
# Position (3,) [m] and quaternion x y z w in `base` of l_gripper_tool_frame, then of r_gripper_tool_frame.
VECTORS = {
    "P0": "0.9510 0.1880 0.7907  0 0 0 1  0.9510 -0.1880 0.7907  0 0 0 1",
    "P1": """0.4560 0.4019 0.9968  0.1080 -0.5330 0.1667 0.8225
             0.4560 -0.4019 0.9968  -0.1080 -0.5330 -0.1667 0.8225""",
    "P2": """0.6646 0.0981 1.0112  0.6981 -0.6101 -0.2016 0.3158
             0.5729 -0.0592 1.0584  0.1892 -0.4520 0.4619 0.7392""",
    "P3": "0.6500 0.2500 0.7400  0 0 0 1  0.6500 -0.2500 0.7400  0 0 0 1",
    "P4": "0.6500 0.2500 0.7400  -0.7071 0 0 0.7071  0.6500 -0.2500 0.7400  0.7071 0 0 0.7071",
    "P5": """0.1027 -0.2929 0.4331  -0.4772 0.4921 -0.5487 0.4785
             0.0093 0.0312 0.5061  0.0248 0.7706 -0.5778 0.2679""",
}
PRINTED = 1e-4  # the vectors have four decimals, and so have the postures that were solved for


def angles_of(posture: Posture, laser: float = 0.0) -> dict[str, float]:
    values = (posture.torso, *posture.head, laser, *posture.left, *posture.right)
    return dict(zip(BODY_JOINTS, values, strict=True))


def bullet_frames(angles: dict[str, float]) -> dict[str, Pose]:
    with BulletClient() as client:
        client.load_urdf("pr2", str(description_path()), Pose(np.zeros(3), np.array([0.0, 0, 0, 1])))
        number, joints = client.body("pr2"), client.joints("pr2")
        for name, angle in angles.items():
            client.api.resetJointState(number, joints[name], angle)
        links = {client.api.getJointInfo(number, joint)[12].decode(): joint for joint in joints.values()}
        return {name: client.link_pose("pr2", joint) for name, joint in links.items()}


def pinocchio_frames(angles: dict[str, float]) -> dict[str, Pose]:
    model = pinocchio.buildModelFromUrdf(str(description_path()))
    data, q = model.createData(), pinocchio.neutral(model)
    for name, angle in angles.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [math.cos(angle), math.sin(angle)]
    pinocchio.framesForwardKinematics(model, data, q)
    placed = {frame.name: data.oMf[model.getFrameId(frame.name)] for frame in model.frames}
    return {
        name: Pose(np.array(at.translation), pinocchio.Quaternion(at.rotation).coeffs()) for name, at in placed.items()
    }


def angle_between(first: np.ndarray, second: np.ndarray) -> float:
    return 2 * math.acos(min(1.0, abs(float(first @ second)) / float(np.linalg.norm(first) * np.linalg.norm(second))))


@pytest.mark.parametrize("engine", [bullet_frames, pinocchio_frames])
@pytest.mark.parametrize("vector", VECTORS)
def test_forward_kinematics_meets_every_vector(engine, vector):
    frames = engine(angles_of(POSES[vector]))
    values = np.array(VECTORS[vector].split(), dtype=float).reshape(2, 7)
    for frame, value in zip(("l_gripper_tool_frame", "r_gripper_tool_frame"), values, strict=True):
        assert np.abs(frames[frame].position - value[:3]).max() < PRINTED, frame
        assert angle_between(frames[frame].quaternion, value[3:]) < 3 * PRINTED, frame


@pytest.mark.parametrize("engine", [bullet_frames, pinocchio_frames])
def test_lasers_and_head_meet_their_vectors(engine):
    frames = engine(angles_of(Posture(0.1, ZERO, ZERO, head=(0.3, 0.4)), laser=0.5))
    for name, place in {
        "base_laser_link": (0.2750, 0, 0.3030),
        "laser_tilt_link": (0.0633, 0, 1.1440),
        "head_tilt_link": (-0.0021, 0.0201, 1.2721),
    }.items():
        assert np.abs(frames[name].position - place).max() < PRINTED, name
    pitched = np.array([0, math.sin(0.25), 0, math.cos(0.25)])
    assert angle_between(frames["laser_tilt_link"].quaternion, pitched) < 1e-6


@pytest.mark.parametrize("name", POSES)
def test_two_engines_agree_to_a_micrometre(name):
    ours, theirs = bullet_frames(angles_of(POSES[name])), pinocchio_frames(angles_of(POSES[name]))
    for frame, pose in ours.items():
        assert np.abs(pose.position - theirs[frame].position).max() < 1e-6, frame


def test_mirrored_angles_are_the_mirror_image():
    left = POSES["P2"].left
    frames = bullet_frames(angles_of(Posture(0.2, left, mirrored(left))))
    ours, theirs = frames["l_gripper_tool_frame"], frames["r_gripper_tool_frame"]
    np.testing.assert_allclose(theirs.position, ours.position * [1, -1, 1], atol=1e-6)
    x, y, z, w = ours.quaternion
    assert angle_between(theirs.quaternion, np.array([-x, y, -z, w])) < 1e-5


@pytest.mark.parametrize("side", ["left", "right"])
def test_sensor_frames_have_y_along_the_gripper_and_z_where_fingers_open(side):
    frames = bullet_frames(angles_of(POSES["P2"]))
    sensor, palm = frames[f"{side}_ft"].matrix, frames[f"{side[0]}_gripper_palm_link"].matrix
    np.testing.assert_allclose(sensor[:, 1], palm[:, 0], atol=1e-6)
    np.testing.assert_allclose(sensor[:, 2], palm[:, 1], atol=1e-6)


def test_every_link_has_an_inertial_of_a_possible_body():
    for link in ElementTree.parse(description_path()).getroot().iter("link"):
        inertia = link.find("inertial/inertia")
        assert inertia is not None, link.get("name")
        moments = sorted(float(inertia.get(axis, "nan")) for axis in ("ixx", "iyy", "izz"))
        assert moments[0] > 0, link.get("name")
        assert moments[0] + moments[1] >= moments[2], link.get("name")


def test_mass_is_that_of_the_whole_robot():
    links = ElementTree.parse(description_path()).getroot().iter("link")
    masses = [float(link.find("inertial/mass").get("value")) for link in links]  # type: ignore[union-attr]
    assert sum(masses) == pytest.approx(265.0, abs=4.0)
