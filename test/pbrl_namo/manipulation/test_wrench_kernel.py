"""Grip forces in the kernel are those of `pbrl_control.constraints.wrench`."""

from __future__ import annotations

import numpy as np
import pytest
from manipulation_rooms import box

from pbrl_control.constraints.classes import DEFAULTS, Freedom, ModelClass
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.wrench import expected_grip_wrench
from pbrl_control.planar import Array
from pbrl_model.parameters import BodyParameters
from pbrl_namo.manipulation.worlds import physics_of
from pbrl_namo.manipulation.wrench_kernel import WORK, grip_wrenches

KINDS = (
    "free",
    "rolls along x",
    "rolls along y",
    "locked",
    "locked and weak",
    "pivot",
    "bar",
    "pivot and wheel",
    "bar and wheel",
)


def model_of(kind: str, rng: np.random.Generator) -> ObjectModel:
    """Return a random model of a kind, off its frame's middle."""
    wheel = {
        "wheel_x": rng.uniform(-0.3, 0.3),
        "wheel_y": rng.uniform(-0.7, 0.7),
        "wheel_theta": rng.uniform(-3.0, 3.0),
    }
    hinge = {"hinge_x": 3.0, "hinge_y": -2.0, "anchor_x": rng.uniform(-0.4, 0.4), "anchor_y": rng.uniform(-0.7, 0.7)}
    more = {
        "free": {**wheel, "mu_x": 0.01, "mu_y": 0.0},
        "rolls along x": {**wheel, "mu_x": 0.02, "mu_y": 0.6},
        "rolls along y": {**wheel, "mu_x": 0.6, "mu_y": 0.02},
        "locked": {**wheel, "mu_x": 0.5, "mu_y": 0.7},
        "locked and weak": {**wheel, "mu_x": 0.13, "mu_y": 0.14},
        "pivot": {**hinge, "hinge_radius": 0.0},
        "bar": {**hinge, "hinge_radius": rng.uniform(0.3, 1.0)},
        "pivot and wheel": {**hinge, **wheel, "hinge_radius": 0.0, "mu_x": 0.2, "mu_y": 0.3},
        "bar and wheel": {**hinge, **wheel, "hinge_radius": rng.uniform(0.3, 1.0), "mu_x": 0.2, "mu_y": 0.3},
    }[kind]
    parameters = BodyParameters(mass=rng.uniform(15.0, 60.0), mu_ground=rng.choice([0.0, 0.02, 0.3]), **more)
    return ObjectModel.uniform(parameters, box(0.75, 1.5) + rng.uniform(-0.2, 0.2, 2))


def kernel(model: ObjectModel, pose: Array, twist: Array, rate: Array, contacts: Array) -> Array:
    out = np.empty((len(contacts), 3))
    physics = np.array(physics_of(model, pose))
    grip_wrenches(physics, twist, rate, contacts, DEFAULTS.torque_arm, np.full((WORK, 4), np.nan), out)
    return out


@pytest.mark.parametrize("grips", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_wrenches_are_the_librarys(kind: str, grips: int, seed: int) -> None:
    rng = np.random.default_rng([seed, grips, KINDS.index(kind)])
    model, pose = model_of(kind, rng), rng.uniform(-1.0, 1.0, 3)
    freedom = Freedom.of(model, pose)
    contacts = rng.uniform([-0.6, -0.9], [0.6, 0.9], (grips, 2))
    moves = freedom.moves if freedom.model_class != ModelClass.STATIC else np.eye(3)
    for move in moves:
        for speed in (0.1, -0.1):
            for rate in (np.zeros(3), 1.5 * speed * move, -0.7 * speed * move):
                mine = kernel(model, pose, speed * move, rate, contacts)
                theirs = expected_grip_wrench(model, pose, speed * move, rate, contacts)
                scale = max(1.0, float(np.abs(theirs).max()))
                assert mine == pytest.approx(theirs, abs=1e-7 * scale)


def test_setting_out_from_rest_is_the_librarys() -> None:
    rng = np.random.default_rng(1)
    for kind in KINDS:
        model, pose = model_of(kind, rng), np.array([0.3, 0.2, 0.1])
        freedom = Freedom.of(model, pose)
        contacts = np.array([[-0.4, 0.2], [-0.4, -0.3]])
        for move in freedom.moves:
            mine = kernel(model, pose, np.zeros(3), 0.2 * move, contacts)
            assert mine == pytest.approx(expected_grip_wrench(model, pose, np.zeros(3), 0.2 * move, contacts), abs=1e-7)


def test_at_rest_nothing_is_needed() -> None:
    rng = np.random.default_rng(1)
    for kind in KINDS:
        mine = kernel(model_of(kind, rng), np.zeros(3), np.zeros(3), np.zeros(3), np.array([[-0.4, 0.2]]))
        assert mine == pytest.approx(np.zeros((1, 3)), abs=1e-9)


def test_a_push_through_the_middle_is_friction_and_inertia() -> None:
    model = ObjectModel.uniform(BodyParameters(mass=30.0, mu_ground=0.02), box(1.0, 1.0))
    mine = kernel(model, np.zeros(3), np.array([0.1, 0.0, 0.0]), np.array([0.15, 0.0, 0.0]), np.array([[-0.5, 0.0]]))
    assert mine[0] == pytest.approx([30.0 * (0.02 * 9.81 + 0.15), 0.0, 0.0], abs=2e-2)
