"""Casters against hand calculation: rolling resistance, trailing, a locked one as a pivot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bullet_sim.client import GRAVITY

TABLES = {
    "A": ([0.75, 1.50], 33.0, 0.00075),
    "B": ([0.80, 1.80], 38.0, 0.00075),
    "A on carpet": ([0.75, 1.50], 33.0, 0.0018),
}
PUSH = 20.0


def hand_calculation(mass: float, lever: float, push: float) -> float:
    """Acceleration (F - f W / r) / (m + 4 I / r^2) of a table rolling straight on four discs of 0.25 kg."""
    radius, wheel = 0.0375, 0.25
    return (push - lever * mass * GRAVITY / radius) / (mass + 4 * 0.5 * wheel)


@pytest.mark.parametrize("step", [1 / 240, 1 / 400, 1 / 1000])
@pytest.mark.parametrize("kind", TABLES)
def test_a_push_of_20_newton_and_coasting_agree_with_the_hand_calculation(lab: Any, kind: str, step: float) -> None:
    size, mass, lever = TABLES[kind]
    table = {**lab.table, "size": size, "nominal_mass": mass, "casters": {"rolling_resistance": lever}}
    world = lab.world(lab.scene({"table_a": table}), step=step)
    lab.align(world)
    lab.run(world, 0.5)
    body = world.find("table_a")

    def push() -> None:
        x, y, _ = body.pose().position
        body.apply_force(np.array([PUSH, 0.0, 0.0]), np.array([x, y, 0.55]))

    speeds = [body.twist().linear[0]]
    lab.run(world, 1.0, push)
    speeds.append(body.twist().linear[0])
    lab.run(world, 0.2)
    speeds.append(body.twist().linear[0])
    pushed, coasting = speeds[1] - speeds[0], (speeds[2] - speeds[1]) / 0.2
    assert pushed == pytest.approx(hand_calculation(mass, lever, PUSH), rel=0.01)
    assert coasting == pytest.approx(hand_calculation(mass, lever, 0.0), rel=0.01)


def test_a_push_below_the_rolling_resistance_moves_nothing(lab: Any) -> None:
    world = lab.world()
    lab.align(world)
    lab.run(world, 0.25)
    body = world.find("table_a")
    start = body.pose().position
    limit = 0.00075 * 33 * GRAVITY / 0.0375
    force = np.array([0.9 * limit, 0.0, 0.0])
    lab.run(world, 2.0, lambda: body.apply_force(force, body.pose().point([0, 0, -0.2])))
    assert np.abs(body.pose().position - start)[:2].max() < 1e-3


@pytest.mark.parametrize("heading", [0.0, 0.6, np.pi / 4, 2.0])
def test_rolling_resistance_is_the_same_in_every_direction(lab: Any, heading: float) -> None:
    world = lab.world(lab.scene({"table_a": {**lab.table, "pose": [0, 0, heading]}}))
    lab.align(world)
    lab.run(world, 0.25)
    body = world.find("table_a")
    along = np.array([np.cos(heading), np.sin(heading), 0.0])
    lab.run(world, 1.0, lambda: body.apply_force(PUSH * along, body.pose().point([0, 0, -0.2])))
    assert body.twist().linear @ along == pytest.approx(hand_calculation(33.0, 0.00075, PUSH), rel=0.01)


def drive_straight(lab: Any, world: Any, distance: float) -> None:
    """Move table_a along world x at 0.2 m/s for a distance, held straight by springs."""
    body = world.find("table_a")
    lab.run(world, 0.1)
    start, began = body.pose().position[0], world.client.time
    while body.pose().position[0] - start < distance:
        pose, twist = body.pose(), body.twist()
        gap = 0.2 * (world.client.time - began) - (pose.position[0] - start)
        force = np.array([3000 * gap - 300 * (twist.linear[0] - 0.2), -3000 * pose.position[1], 0.0])
        force[1] -= 300 * twist.linear[1]
        turn = -3000 * pose.yaw - 300 * twist.angular[2]
        for side in (-0.5, 0.5):
            body.apply_force(force / 2 - np.array([turn * side / 0.5, 0.0, 0.0]), pose.point([0.0, side, -0.2]))
        world.step()


@pytest.mark.parametrize("seed", range(4))
def test_casters_trail_after_15_centimetres(lab: Any, seed: int) -> None:
    world = lab.world(seed=seed)
    casters = world.find("table_a").casters
    before = casters.angles()
    drive_straight(lab, world, 0.15)
    after = np.abs(np.angle(np.exp(1j * casters.angles())))
    # One pushed straight back against its trail is held there by its bearing for a while, as real ones are.
    turns = np.abs(before) < np.deg2rad(165)
    assert turns.sum() >= 2
    assert after[turns].max() < np.deg2rad(10), np.rad2deg(after)


def test_a_frictionless_swivel_follows_the_kinematics_of_a_trailing_wheel(lab: Any) -> None:
    easy = {"swivel_friction": 0.0, "contact_width": 0.0, "rolling_resistance": 0.0}
    world = lab.world(lab.scene({"table_a": {**lab.table, "casters": easy}}), seed=3)
    casters = world.find("table_a").casters
    before = casters.angles()
    drive_straight(lab, world, 0.06)
    expected = 2 * np.arctan(np.tan(before / 2) * np.exp(-0.06 / 0.028))  # from delta' = -sin(delta) / trail
    np.testing.assert_allclose(casters.angles(), expected, atol=np.deg2rad(3))


def test_casters_are_left_at_random_angles_drawn_from_the_generator(lab: Any) -> None:
    first, same, other = (lab.world(seed=seed).find("table_a").casters.angles() for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert np.abs(first - other).min() > 1e-3


@pytest.mark.parametrize("caster", ["front_left", "front_right", "rear_left", "rear_right"])
def test_a_table_with_one_locked_caster_turns_about_that_caster(lab: Any, caster: str) -> None:
    world = lab.world(lab.scene(concealed={"locked_casters": {"table_a": [caster]}}), seed=1)
    lab.run(world, 0.25)
    body = world.find("table_a")
    number = [link.name for link in body.casters.links].index(caster)
    pivot = body.casters.contacts()[number]
    place = np.array(body.casters.links[number].place)
    far = np.array([-np.sign(place[0]) * 0.35, -np.sign(place[1]) * 0.7, -0.0125])
    drift = 0.0
    while abs(body.pose().yaw) < 0.5 and world.client.time < 30:
        pose, twist = body.pose(), body.twist()
        point = pose.point(far)
        push = pose.matrix[:, 0]
        speed = twist.linear + np.cross(twist.angular, point - pose.position)
        body.apply_force(push * np.clip(400 * (0.15 - speed @ push), 0, 25), point)
        world.step()
        drift = max(drift, float(np.linalg.norm(body.casters.contacts()[number] - pivot)))
    assert abs(body.pose().yaw) >= 0.5, "it did not turn"
    assert drift < 0.01


def test_a_locked_caster_slides_when_pushed_beyond_its_friction(lab: Any) -> None:
    locked = {"locked_casters": {"table_a": ["front_left", "front_right", "rear_left", "rear_right"]}}
    weight = 33 * GRAVITY
    for share, moves in ((0.6, False), (0.8, True)):
        world = lab.world(lab.scene(concealed=locked))
        lab.run(world, 0.25)
        body = world.find("table_a")
        force = np.array([share * weight, 0.0, 0.0])
        lab.run(world, 0.5, lambda body=body, force=force: body.apply_force(force, body.pose().point([0, 0, -0.74])))
        assert (body.pose().position[0] > 0.05) == moves, "0.7 of its weight is where braked wheels begin to slide"


@pytest.mark.parametrize("locked", [[], ["rear_right"]])
def test_a_table_left_alone_stays(lab: Any, locked: list[str]) -> None:
    for seed in (0, 2):
        world = lab.world(lab.scene(concealed={"locked_casters": {"table_a": locked}}), seed=seed)
        lab.run(world, 4.0)
        planar = world.truth("table_a").planar
        assert np.hypot(*planar[:2]) < 0.2e-3
        assert abs(planar[2]) < 0.2e-3


def test_loads_add_up_to_the_weight(lab: Any) -> None:
    world = lab.world(lab.scene(concealed={"mass": {"table_a": 60.0}}))
    lab.run(world, 1.0)
    assert world.find("table_a").casters.loads.sum() == pytest.approx(60 * GRAVITY, rel=1e-3)
