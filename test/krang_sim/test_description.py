"""The URDF against the published test vectors of Krang's chain, in two engines that share no code."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio
import pytest

from bullet_sim.client import BulletClient, Pose
from bullet_sim.quiet import bullet
from krang_sim.robot import BODY_JOINTS, description_path

PUSH_CART = (1.0091, -1.0637, -0.0389, -1.8836, 0.2605, 1.2431, -0.0465)
PUSH_TABLE = (1.0668, -1.1286, -0.0096, -2.0422, 0.1238, 1.4877, -0.0624)
ANGLES = {
    "K0": (0, 0, *(0,) * 14),
    "K1": (2.532, 0, *(0,) * 14),
    "K2": (2.532, 0, *PUSH_CART, *(-q for q in PUSH_CART)),
    "K3": (2.732, 0, *PUSH_TABLE, *(-q for q in PUSH_TABLE)),
    "K4": (2.4, 0.3, 1.4, -1.0, 0.2, -0.8, 0.3, -0.8, 0.5, -1.102, 0.589, 0.0, 1.339, 0.141, 0.959, -1.0),
}
FRAMES = ("left_ft", "left_tip", "right_ft", "right_tip", "torso_link")
# Position (3,) [m] in `base` of each of FRAMES, then quaternions x y z w of left_ft and right_ft.
VECTORS = {
    "K0": """-1.1315 1.0878 -0.0153  -1.1315 1.3048 -0.0153  -1.1315 -1.0858 -0.0153  -1.1315 -1.3028 -0.0153
             -1.1315 0.0010 -0.0153  0 -0.7833 0 0.6216  0 -0.7833 0 0.6216""",
    "K1": """-0.1418 1.0878 0.8111  -0.1418 1.3048 0.8111  -0.1418 -1.0858 0.8111  -0.1418 -1.3028 0.8111
             -0.1418 0.0010 0.8111  0 0.3579 0 0.9338  0 0.3579 0 0.9338""",
    "K2": """0.3864 0.1454 0.8953  0.6015 0.1170 0.8963  0.3864 -0.1434 0.8953  0.6015 -0.1150 0.8963
             -0.1418 0.0010 0.8111  0.0129 0.0081 -0.7517 0.6593  -0.0129 0.0081 0.7517 0.6593""",
    "K3": """0.4488 0.1251 0.7648  0.6645 0.1011 0.7660  0.4488 -0.1231 0.7648  0.6645 -0.0991 0.7660
             -0.0360 0.0010 0.7273  0.0299 0.0230 -0.7446 0.6664  -0.0299 0.0230 0.7446 0.6664""",
    "K4": """0.2010 0.2380 1.3563  0.1740 0.0976 1.5196  0.1488 -0.3252 1.1214  0.2584 -0.1401 1.0925
             -0.2198 0.0010 0.8542  -0.0518 0.4178 0.9059 0.0448  0.1932 0.0151 0.9429 0.2708""",
}


def expected(vector: str) -> tuple[np.ndarray, np.ndarray]:
    values = np.array(VECTORS[vector].split(), dtype=float)
    quaternions = values[15:].reshape(2, 4)
    return values[:15].reshape(5, 3), quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def bullet_frames(angles: tuple[float, ...]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    with BulletClient() as client:
        client.load_urdf("krang", str(description_path()), Pose(np.zeros(3), np.array([0.0, 0, 0, 1])))
        number, joints = client.body("krang"), client.joints("krang")
        for name, angle in zip(BODY_JOINTS, angles, strict=True):
            client.api.resetJointState(number, joints[name], angle)
        links = {client.api.getJointInfo(number, joint)[12].decode(): joint for joint in joints.values()}
        poses = {frame: client.link_pose("krang", links[frame]) for frame in FRAMES}
    return {frame: (pose.position, pose.quaternion) for frame, pose in poses.items()}


def pinocchio_frames(angles: tuple[float, ...]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    model = pinocchio.buildModelFromUrdf(str(description_path()))
    data, q = model.createData(), pinocchio.neutral(model)
    for name, angle in zip(BODY_JOINTS, angles, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = angle
    pinocchio.framesForwardKinematics(model, data, q)
    placed = {frame: data.oMf[model.getFrameId(frame)] for frame in FRAMES}
    return {frame: (at.translation, pinocchio.Quaternion(at.rotation).coeffs()) for frame, at in placed.items()}


@pytest.mark.parametrize("engine", [bullet_frames, pinocchio_frames])
@pytest.mark.parametrize("vector", VECTORS)
def test_forward_kinematics_meets_every_vector(engine, vector):
    frames = engine(ANGLES[vector])
    positions, quaternions = expected(vector)
    for frame, position in zip(FRAMES, positions, strict=True):
        assert np.abs(frames[frame][0] - position).max() < 1e-3, frame
    for frame, quaternion in zip(("left_ft", "right_ft"), quaternions, strict=True):
        angle = 2 * math.acos(min(1.0, abs(float(np.dot(frames[frame][1], quaternion)))))
        assert angle < 1e-3, frame


def test_every_link_has_an_inertial_of_a_possible_body():
    for link in ElementTree.parse(description_path()).getroot().iter("link"):
        inertia = link.find("inertial/inertia")
        assert inertia is not None, link.get("name")
        moments = sorted(float(inertia.get(axis, "nan")) for axis in ("ixx", "iyy", "izz"))
        assert moments[0] > 0, link.get("name")
        assert moments[0] + moments[1] >= moments[2], link.get("name")


def test_mass_is_that_of_the_parts():
    links = ElementTree.parse(description_path()).getroot().iter("link")
    masses = {link.get("name"): float(link.find("inertial/mass").get("value")) for link in links}  # type: ignore[union-attr]
    arm = 3.952 + 3.925 + 2.373 + 2.373 + 1.413 + 2.646 + 1.769
    assert sum(masses.values()) == pytest.approx(75.767 + 2 * 4.66 + 14.006 + 4.0 + 1.41 + 2 * arm, abs=0.25)
    assert masses["left_ft"] + masses["left_tip"] == pytest.approx(1.769)


def test_nothing_but_wheels_and_slider_touches_the_floor():
    with BulletClient() as client:
        pose = Pose(np.array([0, 0, 1e-3]), np.array([0.0, 0, 0, 1]))
        client.load_urdf("krang", str(description_path()), pose)
        number, joints = client.body("krang"), client.joints("krang")
        client.api.resetJointState(number, joints["waist"], 2.732)
        floor = client.api.createMultiBody(0, client.api.createCollisionShape(bullet.GEOM_PLANE))
        near = {point[3] for point in client.api.getClosestPoints(number, floor, 0.005)}
    assert near == {joints["lwheel"], joints["rwheel"], joints["slider_mount"]}
