from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bullet_sim.clamp import Clamp, GripperSpec, find_clamp
from bullet_sim.errors import SimError
from bullet_sim.grip import Grip
from bullet_sim.world import World

SPEC = GripperSpec()
ALL = ["front_left", "front_right", "rear_left", "rear_right"]


def grasp(lab: Any, world: World, *, y: float = 0.0, depth: float = 0.06) -> tuple[Any, Grip]:
    hand = lab.hand(world, (-0.375 + depth, y, 0.765))
    lab.run(world, 0.1)
    test = find_clamp(world.furniture.values(), world.client.link_pose(*hand.link), SPEC)
    assert test.clamp is not None, test.message
    return hand, Grip(world.client, hand.link, SPEC, world.find("table_a"), test.clamp)


def surface(grip: Grip) -> float:
    """How far out on the limit surface the load is."""
    force = np.hypot(*grip.load.force[:2]) / SPEC.force_limit
    return math.hypot(force, grip.load.torque[2] / SPEC.torque_limit)


def anchored(lab: Any, mass: float = 300.0) -> World:
    """A table that does not move: heavy, with all wheels braked."""
    return lab.world(lab.scene(concealed={"mass": {"table_a": mass}, "locked_casters": {"table_a": ALL}}))


@pytest.mark.parametrize("step", [1 / 240, 1 / 400, 1 / 1000])
def test_a_held_table_follows_the_hand_without_slip(lab: Any, step: float) -> None:
    world = lab.world(step=step)
    lab.align(world)
    hand, grip = grasp(lab, world)
    body, start = world.find("table_a"), world.pose("table_a").position[0]
    began = world.client.time

    def drive() -> None:
        hand.move(min(0.1, 0.2 * (world.client.time - began)))
        grip.apply()
        assert surface(grip) < 0.5

    lab.run(world, 3.0, drive)
    assert grip.slipped == 0.0
    assert not grip.lost
    assert body.pose().position[0] - start == pytest.approx(hand.travel, abs=0.002)
    assert body.twist().linear[0] == pytest.approx(0.1, abs=0.005)
    steady = 0.00075 * 33 * 9.81 / 0.0375
    assert grip.load.force[0] == pytest.approx(steady, abs=0.5), "at constant speed the grip carries rolling resistance"


def test_rubber_is_a_spring_below_the_limit(lab: Any) -> None:
    world = anchored(lab)
    hand, grip = grasp(lab, world)
    hand.move(0.005)
    lab.run(world, 1.0, grip.apply)
    hand.move(0.0)
    lab.run(world, 0.3, grip.apply)
    stretch = hand.travel - world.pose("table_a").position[0]
    assert grip.load.force[0] == pytest.approx(SPEC.stiffness * stretch, rel=0.02)
    assert not grip.load.slipping


@pytest.mark.parametrize("speed", [0.02, 0.2, -0.2])
def test_beyond_the_limit_the_plates_slip_at_the_limit(lab: Any, speed: float) -> None:
    world = anchored(lab)
    hand, grip = grasp(lab, world)
    hand.move(speed)
    seen = []
    while abs(hand.travel) < 0.04:
        grip.apply()
        seen.append(surface(grip))
        world.step()
    assert max(seen) <= 1 + 1e-9
    assert seen[-1] == pytest.approx(1.0, abs=1e-6)
    assert grip.load.force[0] == pytest.approx(np.sign(speed) * SPEC.force_limit, rel=0.01)
    assert grip.slipped == pytest.approx(0.04 - SPEC.force_limit / SPEC.stiffness, abs=0.003)


def test_pulled_off_the_edge_the_grasp_is_lost_and_nothing_acts_any_more(lab: Any) -> None:
    world = anchored(lab)
    hand, grip = grasp(lab, world, depth=0.05)
    hand.move(-0.1)
    lab.run(world, 0.4, grip.apply)
    assert not grip.lost, "4 cm of 5 are out"
    lab.run(world, 0.3, grip.apply)
    assert grip.lost
    assert 0.025 < grip.slipped < 0.05
    np.testing.assert_array_equal(grip.load.force, np.zeros(3))


def test_turning_the_wrist_loads_the_edge_in_force_and_moment_until_it_slips(lab: Any) -> None:
    world = anchored(lab)
    hand, grip = grasp(lab, world)
    hand.turn(0.5)
    forces, torques = [], []

    def turn() -> None:
        grip.apply()
        assert surface(grip) <= 1 + 1e-9
        forces.append(np.hypot(*grip.load.force[:2]))
        torques.append(grip.load.torque[2])

    lab.run(world, 1.0, turn)
    assert grip.load.slipping
    assert 0.9 * SPEC.force_limit < max(forces) <= SPEC.force_limit
    assert 0.1 * SPEC.torque_limit < max(torques) <= SPEC.torque_limit


def test_force_and_moment_share_one_limit(lab: Any) -> None:
    world = anchored(lab)
    hand, grip = grasp(lab, world)
    hand.turn(0.6)
    hand.move(0.03)
    lab.run(world, 0.8, grip.apply)
    assert surface(grip) == pytest.approx(1.0, abs=1e-6)
    assert 0.1 * SPEC.force_limit < np.hypot(*grip.load.force[:2]) < 0.99 * SPEC.force_limit
    assert 0.1 * SPEC.torque_limit < grip.load.torque[2] < 0.99 * SPEC.torque_limit


def test_a_table_on_a_locked_caster_turns_in_the_grip(lab: Any) -> None:
    world = lab.world(lab.scene(concealed={"locked_casters": {"table_a": ["rear_right"]}}), seed=3)
    hand, grip = grasp(lab, world, y=0.35)
    hand.move(0.1)
    lab.run(world, 2.0, grip.apply)
    assert world.truth("table_a").planar[2] < -0.1
    assert not grip.lost


def test_the_same_push_gives_the_same_bytes(lab: Any) -> None:
    runs = []
    for _ in range(2):
        world = lab.world(seed=7)
        hand, grip = grasp(lab, world, y=0.3)
        hand.move(0.15)
        lab.run(world, 1.0, grip.apply)
        truth = world.truth("table_a")
        runs.append((truth.position.tobytes(), truth.quaternion.tobytes(), grip.load.force.tobytes()))
    assert runs[0] == runs[1]


def test_a_clamp_of_another_body_is_refused(lab: Any) -> None:
    world = lab.world()
    hand = lab.hand(world, (-0.315, 0.0, 0.765))
    clamp = Clamp("table_b", np.zeros(3), 0.18, 0.05)
    with pytest.raises(SimError, match="expected a clamp on an edge of 'table_a'"):
        Grip(world.client, hand.link, SPEC, world.find("table_a"), clamp)
