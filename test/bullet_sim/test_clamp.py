from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bullet_sim.clamp import LEAST_HOLD, GripperSpec, find_clamp, held_interval
from bullet_sim.client import Pose, yaw_quaternion
from bullet_sim.errors import SimError
from bullet_sim.sensors import multiply

SPEC = GripperSpec()
MIDDLE = 0.7775 - 0.0125
BLOCK = {
    "kind": "block",
    "polygon": [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]],
    "height": 0.5,
    "nominal_mass": 8.0,
    "pose": [2, 0, 0],
}


def gripper_at(tip: tuple[float, float, float], heading: float = 0.0, tilt: float = 0.0) -> Pose:
    """A left gripper (approach +y of its frame) whose plates end at `tip`, pointing along `heading`."""
    lean = np.array([math.sin(tilt / 2), 0.0, 0.0, math.cos(tilt / 2)])
    pose = Pose(np.zeros(3), multiply(yaw_quaternion(heading - np.pi / 2), lean))
    return Pose(np.array(tip) - pose.matrix @ SPEC.along(SPEC.plate_end), pose.quaternion)


def test_an_edge_between_the_plates_is_held_at_the_middle_of_the_patch(lab: Any) -> None:
    world = lab.world()
    test = find_clamp(world.furniture.values(), gripper_at((-0.315, 0.35, MIDDLE)), SPEC)
    assert test.clamp is not None
    assert test.clamp.body == "table_a"
    assert test.clamp.depth == pytest.approx(0.060, abs=1e-6)
    np.testing.assert_allclose(test.clamp.contact, [-0.345, 0.35, -0.0125], atol=1e-5)
    assert test.clamp.reach == pytest.approx(0.217 - 0.030, abs=1e-6)
    assert test.distance == pytest.approx(0.015, abs=1e-5), "plates' middle is 45 mm behind their end"


def test_the_outcome_does_not_depend_on_where_the_world_has_its_origin(lab: Any) -> None:
    rng = np.random.default_rng(5)
    here = find_clamp(lab.world().furniture.values(), gripper_at((-0.315, 0.35, MIDDLE)), SPEC)
    for _ in range(5):
        x, y, theta = rng.uniform(-2, 2, 3)
        world = lab.world(lab.scene({"table_a": {**lab.table, "pose": [x, y, theta]}}))
        tip = world.pose("table_a").point([-0.315, 0.35, -0.0125])
        there = find_clamp(world.furniture.values(), gripper_at(tuple(tip), heading=theta), SPEC)
        assert there.distance == pytest.approx(here.distance, abs=1e-5)
        np.testing.assert_allclose(there.clamp.contact, here.clamp.contact, atol=1e-5)


@pytest.mark.parametrize("gap", [0.01, 0.15, 1.0])
def test_out_of_reach_is_refused_with_the_distance(lab: Any, gap: float) -> None:
    test = find_clamp(lab.world().furniture.values(), gripper_at((-0.375 - gap, 0.2, MIDDLE)), SPEC)
    assert test.clamp is None
    assert test.distance == pytest.approx(gap + 0.045, abs=1e-5)
    assert f"{test.distance:.3f} m" in test.message
    assert "table_a" in test.message


@pytest.mark.parametrize(
    ("lift", "held"), [(0.0, True), (0.016, True), (-0.016, True), (0.018, False), (-0.018, False), (0.3, False)]
)
def test_the_edge_has_to_be_between_the_plates_in_height(lab: Any, lift: float, held: bool) -> None:
    test = find_clamp(lab.world().furniture.values(), gripper_at((-0.315, 0.0, MIDDLE + lift)), SPEC)
    assert (test.clamp is not None) == held, test.message
    assert test.distance == pytest.approx(math.hypot(0.015, lift), abs=1e-4)


@pytest.mark.parametrize(("depth", "held"), [(LEAST_HOLD - 0.001, False), (LEAST_HOLD + 0.001, True)])
def test_a_shallow_hold_is_refused(lab: Any, depth: float, held: bool) -> None:
    test = find_clamp(lab.world().furniture.values(), gripper_at((-0.375 + depth, 0.0, MIDDLE)), SPEC)
    assert (test.clamp is not None) == held, test.message


def test_tilted_plates_are_refused(lab: Any) -> None:
    test = find_clamp(lab.world().furniture.values(), gripper_at((-0.315, 0.0, MIDDLE), tilt=0.4), SPEC)
    assert test.clamp is None
    assert "level" in test.message


def test_a_thick_body_offers_no_edge(lab: Any) -> None:
    world = lab.world(lab.scene({"box": BLOCK}))
    test = find_clamp(world.furniture.values(), gripper_at((1.85, 0.0, 0.49)), SPEC)
    assert test.clamp is None
    assert math.isinf(test.distance)
    thick = lab.world(lab.scene({"table_a": {**lab.table, "slab": 0.07}}))
    assert find_clamp(thick.furniture.values(), gripper_at((-0.315, 0.0, 0.74)), SPEC).clamp is None


def test_of_several_bodies_the_held_one_is_found(lab: Any) -> None:
    other = {**lab.table, "pose": [-0.375 * 2 - 0.12, 0, 0]}
    world = lab.world(lab.scene({"table_b": other, "table_a": lab.table}))
    test = find_clamp(world.furniture.values(), gripper_at((-0.315, 0.0, MIDDLE)), SPEC)
    assert test.clamp is not None
    assert test.clamp.body == "table_a"


@pytest.mark.parametrize("fault", [{"force": -1.0}, {"opening": math.nan}, {"plate_end": 0.1}, {"approach": 0.5}])
def test_a_gripper_that_cannot_be_is_refused(fault: dict[str, float]) -> None:
    with pytest.raises(SimError, match="gripper: "):
        GripperSpec(**fault)


def test_held_interval_of_a_line_through_a_square() -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    for start, end, expected in (
        ([-1, 0.5], [1, 0.5], (0.5, 1.0)),
        ([0.2, 0.5], [0.8, 0.5], (0.0, 1.0)),
        ([-1, 0.5], [3, 0.5], (0.25, 0.5)),
        ([-1, 2.0], [1, 2.0], (1.0, 1.0)),
        ([0.5, 0.5], [0.5, 0.5], (1.0, 1.0)),
    ):
        assert held_interval(square, np.array(start), np.array(end)) == pytest.approx(expected)
