"""What acts on a body from outside: each effect against the closed form of the thing it is built from."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bullet_sim.client import GRAVITY
from bullet_sim.concealed.detent import catch_force, peak_distance
from bullet_sim.errors import SimError

PLAIN = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [0, 0, 0]}
PILLAR = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]


def made(lab: Any, concealed: dict[str, Any], **keys: Any) -> tuple[Any, Any, Any]:
    """A world with one effect, its body and the effect."""
    world = lab.world(lab.scene({"table_a": PLAIN | keys}, concealed=concealed))
    lab.run(world, 0.1)
    return world, world.find("table_a"), world.effects[0]


def launch(world: Any, vx: float = 0.0, vy: float = 0.0, spin: float = 0.0) -> None:
    """Send table_a off."""
    world.client.api.resetBaseVelocity(world.client.body("table_a"), [vx, vy, 0], [0, 0, spin])


def speed(body: Any) -> float:
    return float(np.hypot(*body.twist().linear[:2]))


@pytest.mark.parametrize("heading", [0.0, 2.3])
def test_a_free_table_on_a_slope_accelerates_with_g_sine(lab: Any, heading: float) -> None:
    world, body, effect = made(lab, {"floor_slope": {"angle": 0.02, "heading": heading}})
    before = body.twist().linear[:2]
    lab.run(world, 1.0)
    gained = body.twist().linear[:2] - before
    pull = GRAVITY * math.sin(0.02)
    np.testing.assert_allclose(gained, pull * np.array([math.cos(heading), math.sin(heading)]), rtol=1e-3, atol=1e-4)
    assert effect.strength() == pytest.approx(pull)
    assert abs(body.pose().yaw) < 1e-3
    assert world.gravity[0] == pytest.approx(pull * math.cos(heading))


def test_a_cord_is_loose_below_its_length_and_pulls_with_k_times_the_excess_beyond(lab: Any) -> None:
    cord = {"anchor": [-1.0, 0.0, 0.7775], "point": [0.0, 0.0, 0.0], "slack_length": 1.2, "stiffness": 50.0}
    world, body, effect = made(lab, {"tether": {"table_a": cord}})
    launch(world, vx=0.6)
    seen = []
    for _ in range(1600):
        x = body.pose().position[0]
        before = body.twist().linear[0]
        world.step()
        seen.append((x + 1.0 - 1.2, (body.twist().linear[0] - before) * 30 * 400, effect.strength(), effect.acting()))
    excess, force, told, acting = np.array(seen).T
    loose = excess <= 0
    assert 50 < loose.sum() < 1550
    np.testing.assert_allclose(force[loose], 0.0, atol=0.02)
    np.testing.assert_allclose(force[~loose], -50.0 * excess[~loose], atol=0.05)
    np.testing.assert_allclose(told, 50.0 * np.maximum(excess, 0), atol=1e-4)
    np.testing.assert_array_equal(acting > 0, ~loose)


def test_a_cord_pulls_along_its_own_line_heights_included(lab: Any) -> None:
    cord = {"anchor": [2.0, 1.0, 0.0], "point": [0.4, 0.7, -0.1], "slack_length": 0.1, "stiffness": 10.0}
    world, body, effect = made(lab, {"tether": {"table_a": cord}})
    before, pose = body.twist(), body.pose()
    line = np.array([2.0, 1.0, 0.0]) - pose.point([0.4, 0.7, -0.1])
    world.step()
    length = np.linalg.norm(line)
    assert effect.strength() == pytest.approx(10.0 * (length - 0.1), rel=1e-6)
    gained = (body.twist().linear - before.linear)[:2] * 400 * 30
    np.testing.assert_allclose(gained, (effect.strength() / length * line)[:2], rtol=0.01)


def test_a_catch_draws_in_from_near_and_its_force_peaks_as_told(lab: Any) -> None:
    world, body, effect = made(lab, {"detent": {"table_a": {"place": [0.3, 0.0], "force": 12.0, "gap": 0.06}}})
    launch(world, vx=0.5)
    seen = []
    for _ in range(480):
        before, x = body.twist().linear[0], body.pose().position[0]
        world.step()
        seen.append((0.3 - x, (body.twist().linear[0] - before) * 30 * 400, effect.strength()))
    away, force, told = np.array(seen).T
    assert force.max() == pytest.approx(12.0, rel=0.01)
    assert force.min() == pytest.approx(-12.0, rel=0.01)
    assert away[np.argmax(force)] == pytest.approx(peak_distance(0.06), abs=3e-3)
    np.testing.assert_allclose(np.abs(force), told, atol=0.05)
    assert np.abs(force[np.abs(away) > 0.2]).max() < 0.1 * 12.0
    distances = np.linspace(0, 0.3, 3001)
    peak = distances[np.argmax([catch_force(d, 0.06) for d in distances])]
    assert peak == pytest.approx(peak_distance(0.06), abs=1e-4)


def test_a_catch_takes_no_energy(lab: Any) -> None:
    world, body, _ = made(lab, {"detent": {"table_a": {"place": [0.3, 0.02], "force": 12.0, "gap": 0.06}}})
    launch(world, vx=0.5)
    lab.run(world, 3.0)
    twist = body.twist()
    inertia = 30 * (0.8**2 + 1.4**2) / 12
    energy = 15 * speed(body) ** 2 + inertia / 2 * twist.angular[2] ** 2
    assert energy == pytest.approx(15 * 0.25, rel=0.02)


def test_a_pin_keeps_a_point_within_its_compliance(lab: Any) -> None:
    pin = {"point": [0.3, 0.5], "stiffness": 3e4}
    world, body, effect = made(lab, {"hidden_hinge": {"table_a": pin}})
    start = body.pose().point([0.3, 0.5, 0.0])[:2]
    worst, most = 0.0, 0.0
    for number in range(1600):
        force = np.array([25.0 * math.sin(number / 150), 15.0, 0.0])
        body.apply_force(force, body.pose().point([-0.35, -0.5, -0.1]))
        world.step()
        away = float(np.hypot(*(body.pose().point([0.3, 0.5, 0.0])[:2] - start)))
        worst, most = max(worst, away), max(most, effect.strength())
    assert abs(body.pose().yaw) > 0.3, "it turned about the pin"
    assert worst < 1.3 * most / 3e4
    assert most > 15.0


def test_a_bushing_too_stiff_for_the_step_is_a_one_line_error(lab: Any) -> None:
    with pytest.raises(
        SimError, match=r"hidden_hinge\.table_a\.stiffness: expected at most 24000 N/m for 6 kg .* got 100000"
    ):
        made(lab, {"hidden_hinge": {"table_a": {"point": [0.2, 0.2], "stiffness": 1e5}}}, nominal_mass=6.0)


def test_a_worn_pin_has_play_and_a_rusty_one_brakes(lab: Any) -> None:
    world, body, effect = made(lab, {"hidden_hinge": {"table_a": {"point": [0.0, 0.0], "play": 0.01}}})
    launch(world, vx=0.1)
    lab.run(world, 0.08)
    assert effect.strength() == 0.0
    assert speed(body) == pytest.approx(0.1, rel=0.01)
    lab.run(world, 0.05)
    assert speed(body) < 0.09
    rusty = {"hidden_hinge": {"table_a": {"point": [0.0, 0.0], "friction": 1.5}}}
    world, body, _ = made(lab, rusty)
    launch(world, spin=0.8)
    lab.run(world, 0.5)
    inertia = 30 * (0.8**2 + 1.4**2) / 12
    assert body.twist().angular[2] == pytest.approx(0.8 - 1.5 * 0.5 / inertia, rel=0.01)


def test_a_hidden_obstacle_stops_the_table_at_its_face(lab: Any) -> None:
    pillar = {"polygon": PILLAR, "pose": [0.7, 0.3, 0.0]}
    world, body, effect = made(lab, {"hidden_obstacle": [pillar]})
    launch(world, vx=0.4)
    acted = []
    for _ in range(800):
        if world.client.time < 1.0:
            body.apply_force(np.array([5.0, 0, 0]), body.pose().position)
        world.step()
        acted.append(effect.acting())
        corner = body.pose().point([0.4, 0.3, 0.0])
        assert corner[0] < 0.6 + 0.01
    first = acted.index(True) / 400 + 0.1
    assert first == pytest.approx(0.1 + 0.2 / 0.41, abs=0.06)
    assert "hidden_obstacle_0" not in world.furniture


def test_an_unseen_body_takes_the_momentum_that_the_table_loses(lab: Any) -> None:
    crate = {"polygon": [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]], "pose": [0.9, 0.0, 0.0]}
    world, body, effect = made(lab, {"unseen_body": [crate | {"nominal_mass": 10.0, "friction": 1e-4}]})
    launch(world, vx=0.4)
    lab.run(world, 1.0)
    hidden = effect.furniture
    assert 30 * body.twist().linear[0] + 10 * hidden.twist().linear[0] == pytest.approx(30 * 0.4, rel=0.03)
    assert hidden.twist().linear[0] > 0.25
    assert hidden.pose().position[0] > 0.95
    assert set(world.furniture) == {"table_a"}


def test_a_push_from_outside_adds_its_impulse_in_its_time(lab: Any) -> None:
    steady = {"force": [4.0, -3.0], "point": [0, 0, -0.2], "start": 0.5, "end": 1.5}
    world, body, effect = made(lab, {"external_force": {"table_a": steady}})
    lab.run(world, 0.35)
    assert not effect.acting()
    assert speed(body) < 1e-4
    lab.run(world, 2.0)
    np.testing.assert_allclose(30 * body.twist().linear[:2], [4.0, -3.0], rtol=5e-3)
    periodic = {"force": [6.0, 0.0], "period": 0.8, "phase": math.pi / 2, "point": [0.0, 0.0, -0.2]}
    world, body, effect = made(lab, {"external_force": {"table_a": periodic}})
    start = body.twist().linear[0]
    speeds = []
    for _ in range(640):
        world.step()
        speeds.append(body.twist().linear[0])
    swing = 6.0 / 30 * 0.8 / (2 * math.pi)
    assert np.ptp(speeds) == pytest.approx(2 * swing, rel=0.02)
    assert speeds[-1] == pytest.approx(start, abs=2e-3), "whole periods leave no momentum"


@pytest.mark.parametrize("taken_off", [False, True])
def test_a_payload_keeps_the_momentum(lab: Any, taken_off: bool) -> None:
    box = {"mass": 10.0, "at": 1.0, "place": [0.2, -0.3], "taken_off": taken_off}
    world, body, effect = made(lab, {"payload_change": {"table_a": box}})
    launch(world, vx=0.3)
    lab.run(world, 0.8)
    before = body.twist()
    assert effect.strength() == (10.0 if taken_off else 0.0), "it acts while it lies there"
    lab.run(world, 0.5)
    after = body.twist()
    assert effect.strength() == (0.0 if taken_off else 10.0)
    inertia = 30 * (0.8**2 + 1.4**2) / 12
    if taken_off:  # what is lifted off takes its own momentum along
        np.testing.assert_allclose(after.linear, before.linear, atol=5e-3)
        lab.run(world, 0.2, lambda: body.apply_force(np.array([30.0, 0, 0]), body.pose().position))
        assert body.twist().linear[0] - after.linear[0] == pytest.approx(30.0 * 0.2 / 30, rel=0.02)
        return
    # At rest it is put down: linear and angular momentum about the room's origin are what they were.
    arm = (body.pose().matrix @ [0.2, -0.3, 0.0])[:2]
    spin = after.angular[2]
    of_box = 10.0 * (after.linear[:2] + spin * np.array([-arm[1], arm[0]]))
    np.testing.assert_allclose(30 * after.linear[:2] + of_box, [30 * before.linear[0], 0.0], atol=0.1)
    centre, box_at = body.pose().position[:2], body.pose().position[:2] + arm
    turning = inertia * spin + 30 * (centre[0] * after.linear[1] - centre[1] * after.linear[0])
    turning += box_at[0] * of_box[1] - box_at[1] * of_box[0]
    assert turning == pytest.approx(0.0, abs=0.1)
    assert abs(spin) > 0.02


def test_films_brake_each_foot_in_proportion_to_its_speed(lab: Any) -> None:
    drag = {"viscous_drag": {"table_a": {"damping": 24.0}}}
    world, body, effect = made(lab, drag)
    launch(world, vx=0.4)
    lab.run(world, 0.5)
    assert speed(body) == pytest.approx(0.4 * math.exp(-24.0 / 30 * 0.5), rel=0.01)
    assert effect.strength() == pytest.approx(24.0 * speed(body), rel=0.01)
    world, body, _ = made(lab, drag)
    launch(world, spin=1.0)
    lab.run(world, 0.5)
    inertia, lever2 = 30 * (0.8**2 + 1.4**2) / 12, 0.34**2 + 0.64**2
    assert body.twist().angular[2] == pytest.approx(math.exp(-24.0 * lever2 / inertia * 0.5), rel=0.01)
