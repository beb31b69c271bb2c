"""What is built into a body or into the floor under it: each effect against the closed form of the thing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bullet_sim.client import GRAVITY
from bullet_sim.concealed.floor_patch import contains
from bullet_sim.concealed.foot_friction import BreakawayFrictionSettings, stribeck

PLAIN = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [0, 0, 0]}
INERTIA = 30 * (0.8**2 + 1.4**2) / 12
TILE = {"polygon": [[0.0, -2.0], [3.0, -2.0], [3.0, 2.0], [0.0, 2.0]]}
WHEEL = {"position": [0.2, 0.45], "heading": 0.4}


def made(lab: Any, concealed: dict[str, Any], *, seed: int = 0, body: Any = PLAIN) -> tuple[Any, Any, Any]:
    """A world with one effect, its body and the effect."""
    world = lab.world(lab.scene({"table_a": body}, concealed=concealed), seed=seed)
    lab.run(world, 0.2)
    return world, world.find("table_a"), world.effects[0] if world.effects else None


def launch(world: Any, vx: float = 0.0, vy: float = 0.0, spin: float = 0.0) -> None:
    """Send table_a off."""
    world.client.api.resetBaseVelocity(world.client.body("table_a"), [vx, vy, 0], [0, 0, spin])


def total_mass(world: Any) -> float:
    api, body = world.client.api, world.client.body("table_a")
    return sum(api.getDynamicsInfo(body, link)[0] for link in range(-1, api.getNumJoints(body)))


def centre_of_mass(world: Any) -> Any:
    api, body = world.client.api, world.client.body("table_a")
    links = range(api.getNumJoints(body))
    weights = [api.getDynamicsInfo(body, link)[0] for link in (-1, *links)]
    places = [api.getBasePositionAndOrientation(body)[0], *(api.getLinkState(body, link)[0] for link in links)]
    return np.average(np.array(places), axis=0, weights=weights)


def test_ballast_moves_the_centre_of_mass_as_computed_and_adds_no_weight(lab: Any) -> None:
    ballast = {"mass": 9.0, "place": [0.2, -0.4]}
    world, body, effect = made(lab, {"com_offset": {"table_a": ballast}})
    assert total_mass(world) == pytest.approx(30.0)
    offset = 9.0 / 30.0 * np.array([0.2, -0.4])
    np.testing.assert_allclose(centre_of_mass(world)[:2], offset, atol=1e-4)
    assert effect.strength() == pytest.approx(np.hypot(*offset))
    lab.run(world, 0.4, lambda: body.apply_force(np.array([8.0, 0, 0]), body.pose().point([0.0, 0.3, -0.3])))
    even = 21.0 / 30 * INERTIA + 21.0 * offset @ offset
    inertia = even + 9.0 * (np.array([0.2, -0.4]) - offset) @ (np.array([0.2, -0.4]) - offset)
    assert body.twist().angular[2] == pytest.approx(-8.0 * (0.3 - offset[1]) * 0.4 / inertia, rel=0.02)


def test_a_second_wheel_holds_beside_the_first_and_the_body_turns_where_both_let_it(lab: Any) -> None:
    # Two wheels whose axles meet in one point: the body can only turn about that point.
    first, second = {"position": [0.3, 0.0], "heading": math.pi / 2}, {"position": [0.0, 0.5], "heading": 0.0}
    concealed = {"wheel": {"table_a": first}, "second_wheel": {"table_a": second}}
    world, body, effect = made(lab, concealed)
    assert effect.key == "second_wheel.table_a"
    start = body.pose().point([0.0, 0.0, 0.0])
    pole = body.pose().point([0.0, 0.0, 0.0])[:2]
    lab.run(
        world, 1.5, lambda: body.apply_force(body.pose().matrix @ [0, 12.0, 0], body.pose().point([-0.35, 0, -0.2]))
    )
    assert abs(body.pose().yaw) > 0.2
    assert np.hypot(*(body.pose().position[:2] - pole)) < 0.01
    assert effect.acting()
    assert effect.strength() < 0.7 * 80 + 1
    free, alone, _ = made(lab, {"wheel": concealed["wheel"]})
    lab.run(
        free, 1.5, lambda: alone.apply_force(alone.pose().matrix @ [0, 12.0, 0], alone.pose().point([-0.35, 0, -0.2]))
    )
    assert np.hypot(*(alone.pose().position - start)[:2]) > 0.05, "with one wheel it goes elsewhere"


def test_a_locked_foot_slides_with_its_friction_in_every_direction(lab: Any) -> None:
    foot = {"position": [0.0, 0.0], "load": 50.0, "sliding_friction": 0.4, "locked": True}
    world, body, effect = made(lab, {"second_wheel": {"table_a": foot}})
    launch(world, 0.3, 0.2)
    lab.run(world, 0.2)
    velocity = body.twist().linear[:2]
    expected = np.hypot(0.3, 0.2) - 0.4 * 50 / 30 * 0.2
    np.testing.assert_allclose(velocity, expected * np.array([0.3, 0.2]) / np.hypot(0.3, 0.2), atol=3e-3)
    assert effect.strength() == pytest.approx(20.0, rel=0.02)


def test_feet_that_slide_brake_with_mu_g_and_spin_down_with_their_levers(lab: Any) -> None:
    rough = {"ground_friction": {"table_a": {"friction": 0.08}}}
    world, body, effect = made(lab, rough)
    launch(world, 0.4, 0.3)
    lab.run(world, 0.4)
    assert np.hypot(*body.twist().linear[:2]) == pytest.approx(0.5 - 0.08 * GRAVITY * 0.4, rel=0.02)
    assert effect.strength() == pytest.approx(0.08 * 30 * GRAVITY, rel=0.02)
    lab.run(world, 1.0)
    assert np.hypot(*body.twist().linear[:2]) < 1e-3, "it has come to rest"
    assert max(effect.feet.speeds) == 0.0
    world, body, _ = made(lab, rough)
    launch(world, spin=1.0)
    lab.run(world, 0.3)
    lever = np.hypot(0.34, 0.64)
    assert body.twist().angular[2] == pytest.approx(1.0 - 0.08 * 30 * GRAVITY * lever / INERTIA * 0.3, rel=0.03)


def test_a_slippery_floor_takes_its_share_of_every_foot(lab: Any) -> None:
    room = {"outline": [[-8, -8], [8, -8], [8, 8], [-8, 8]], "floor_friction": 0.5}
    rough = {"ground_friction": {"table_a": {"friction": 0.1}}, "floor_patch": [TILE | {"friction": 0.3}]}
    world = lab.world(lab.scene({"table_a": PLAIN}, concealed=rough, room=room))
    lab.run(world, 0.1)
    feet = world.find("table_a").feet
    assert sorted(np.round(feet.coefficients, 9)) == [0.05, 0.05, 0.3, 0.3], "a tile has a friction of its own"


def test_a_table_on_casters_slides_on_glides_let_down_beside_them(lab: Any) -> None:
    rough = {"ground_friction": {"table_a": {"friction": 0.2, "load_share": 0.5}}}
    world, body, effect = made(lab, rough, body=lab.table)
    assert total_mass(world) == pytest.approx(33.0)
    force = np.array([0.8 * 0.2 * 0.5 * 33 * GRAVITY, 0, 0])
    lab.run(world, 0.5, lambda: body.apply_force(force, body.pose().point([0, 0, -0.7])))
    assert np.hypot(*body.twist().linear[:2]) < 2e-3
    launch(world, vx=0.5)
    world.step()
    assert effect.strength() == pytest.approx(0.2 * 0.5 * 33 * GRAVITY, rel=0.05)


def test_feet_stick_up_to_the_static_coefficient_and_slide_with_less(lab: Any) -> None:
    sticky = {"breakaway_friction": {"table_a": {"static": 0.15, "sliding": 0.06, "speed": 0.02}}}
    weight = 30 * GRAVITY
    for share, moves in ((0.13, False), (0.17, True)):
        world, body, effect = made(lab, sticky)
        force = np.array([share * weight, 0, 0])
        lab.run(world, 0.6, lambda b=body, f=force: b.apply_force(f, b.pose().point([0, 0, -0.5])))
        assert (body.pose().position[0] > 0.02) == moves
        if moves:
            before = body.twist().linear[0]
            lab.run(world, 0.2, lambda b=body, f=force: b.apply_force(f, b.pose().point([0, 0, -0.5])))
            assert body.twist().linear[0] - before == pytest.approx((0.17 - 0.06) * GRAVITY * 0.2, rel=0.03)
            assert not effect.acting(), "far beyond the Stribeck speed"
    told = BreakawayFrictionSettings(static=0.15, sliding=0.06, speed=0.02)
    assert stribeck(told, 0.0) == pytest.approx(0.15)
    assert stribeck(told, 0.02) == pytest.approx(0.06 + 0.09 / math.e)
    assert stribeck(told, 1.0) == pytest.approx(0.06)


def test_a_patch_changes_the_deceleration_inside_only(lab: Any) -> None:
    tile = {"polygon": [[1.0, -2.0], [3.0, -2.0], [3.0, 2.0], [1.0, 2.0]], "friction": 0.05}
    world, body, effect = made(lab, {"floor_patch": [tile]})
    launch(world, vx=0.9)
    seen = []
    for _ in range(1400):
        before = body.twist().linear[0]
        world.step()
        brake = (before - body.twist().linear[0]) * 400
        seen.append((body.pose().position[0], brake, effect.strength()))
    x, brake, share = np.array(seen).T
    outside, inside = x + 0.34 < 0.99, (x - 0.34 > 1.01) & (np.arange(1400) < np.argmax(x > x[-1] - 0.01))
    np.testing.assert_allclose(brake[outside], 0.0, atol=1e-3)
    np.testing.assert_allclose(brake[inside].mean(), 0.05 * GRAVITY, rtol=0.02)
    halfway = (x + 0.34 > 1.01) & (x - 0.34 < 0.99)
    assert brake[halfway].mean() == pytest.approx(0.5 * 0.05 * GRAVITY, rel=0.1)
    assert set(np.round(share[outside], 6)) == {0.0}
    assert set(np.round(share[halfway], 6)) == {0.5}


def test_half_on_a_patch_it_turns(lab: Any) -> None:
    tile = {"polygon": [[-3.0, 0.0], [3.0, 0.0], [3.0, 2.0], [-3.0, 2.0]], "friction": 0.06}
    world, body, _ = made(lab, {"floor_patch": [tile]})
    launch(world, vx=0.6)
    lab.run(world, 0.1)
    pull = 0.06 * 30 * GRAVITY / 2
    assert body.twist().angular[2] == pytest.approx(pull * 0.64 * 0.1 / INERTIA, rel=0.05)


def test_a_carpet_brakes_wheels_and_blocks_and_lets_them_go(lab: Any) -> None:
    tile = {"polygon": [[-3.0, -3.0], [0.8, -3.0], [0.8, 3.0], [-3.0, 3.0]], "rolling_resistance": 0.004}
    world, body, effect = made(lab, {"floor_patch": [tile]}, body=lab.table)
    np.testing.assert_allclose(body.casters.levers, 0.004)
    assert effect.strength() == 1.0
    world.client.api.resetBasePositionAndOrientation(world.client.body("table_a"), [2.0, 0, 0.57], [0, 0, 0, 1])
    world.step()
    np.testing.assert_allclose(body.casters.levers, 0.00075)
    assert effect.strength() == 0.0
    block = {"kind": "block", "polygon": [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]], "height": 0.3}
    slippery = {"polygon": tile["polygon"], "friction": 0.1}
    world, body, effect = made(
        lab, {"floor_patch": [slippery]}, body=block | {"nominal_mass": 10.0, "friction": 0.4, "pose": [0, 0, 0]}
    )
    launch(world, vx=0.5)
    lab.run(world, 0.2)
    assert body.twist().linear[0] == pytest.approx(0.5 - 0.1 * GRAVITY * 0.2, rel=0.05)


def test_a_wheel_on_a_strut_feels_the_carpet(lab: Any) -> None:
    tile = {"polygon": [[-3, -3], [3, -3], [3, 3], [-3, 3]], "friction": 0.0, "rolling_resistance": 0.004}
    wheel = {"position": [0.0, 0.0], "load": 100.0}
    world, body, _ = made(lab, {"floor_patch": [tile], "wheel": {"table_a": wheel}})
    lab.run(world, 1.0, lambda: body.apply_force(np.array([14.0, 0, 0]), body.pose().point([0, 0, -0.2])))
    assert body.twist().linear[0] == pytest.approx((14.0 - 0.004 * 100 / 0.05) / 30.1, rel=0.03)
    small = {**tile, "polygon": [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]}
    _, _, effect = made(lab, {"floor_patch": [small], "wheel": {"table_a": wheel}})
    assert effect.acting(), "where no foot is on it"


FLOORS = [[[-0.5, -3], [1, -3], [1, 3], [-0.5, 3]], [[-3, -3], [-0.5, -3], [-0.5, 3], [-3, 3]]]


def test_from_one_tile_to_the_next_each_is_felt_where_it_is(lab: Any) -> None:
    tiles = [{"polygon": FLOORS[0], "rolling_resistance": 0.004}, {"polygon": FLOORS[1], "rolling_resistance": 0.002}]
    wheel = {"position": [0.0, 0.0], "load": 100.0}
    world, body, _ = made(lab, {"floor_patch": tiles}, body=lab.table | {"pose": [-2.0, 0, 0]})
    rolling, _, _ = made(lab, {"floor_patch": tiles, "wheel": {"table_a": wheel}}, body=PLAIN | {"pose": [-2, 0, 0]})
    braked: list[float] = []
    for fitting in rolling.find("table_a").fittings:
        fitting.set_lever = braked.append
    for x, lever in ((-2.0, 0.002), (0.2, 0.004), (-2.0, 0.002), (0.2, 0.004), (5.0, 0.00075)):
        for each in (world, rolling):
            number = each.client.body("table_a")
            height = each.client.api.getBasePositionAndOrientation(number)[0][2]
            each.client.api.resetBasePositionAndOrientation(number, [x, 0, height], [0, 0, 0, 1])
            each.step()
        np.testing.assert_allclose(body.casters.levers, lever, err_msg=str(x))
        assert x in (-2.0, 5.0) or braked[-1] == lever
    assert braked[-1] == 0.0 or braked[-1] == rolling.find("table_a").fittings[0].lever


@pytest.mark.parametrize("floor", [1.0, 0.8])
def test_a_block_on_two_tiles_has_their_mean_and_the_floor_s_factor_is_not_theirs(lab: Any, floor: float) -> None:
    square = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]
    block = {
        "kind": "block",
        "polygon": square,
        "height": 0.1,
        "nominal_mass": 10.0,
        "friction": 0.4,
        "pose": [0, 0, 0],
    }
    halves = [[[-3, 0], [3, 0], [3, 3], [-3, 3]], [[-3, -3], [3, -3], [3, 0], [-3, 0]]]
    tiles = [{"polygon": half, "friction": mu} for half, mu in zip(halves, (0.1, 0.2), strict=True)]
    room = {"outline": [[-8, -8], [8, -8], [8, 8], [-8, 8]], "floor_friction": floor}
    world = lab.world(lab.scene({"table_a": block}, concealed={"floor_patch": tiles}, room=room), seed=0)
    lab.run(world, 0.2)
    launch(world, vx=0.8)
    lab.run(world, 0.2)
    assert world.find("table_a").twist().linear[0] == pytest.approx(0.8 - 0.15 * GRAVITY * 0.2, rel=0.03)


def test_a_place_is_in_a_polygon_or_not() -> None:
    bay = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 0.5), (0.0, 2.0)]
    assert contains(bay, 0.5, 0.5)
    assert not contains(bay, 1.0, 1.0)
    assert not contains(bay, -0.1, 0.5)


def test_casters_in_the_place_of_feet_have_to_turn_first(lab: Any) -> None:
    world, body, effect = made(lab, {"caster_swivel": {"table_a": {}}}, seed=2)
    assert total_mass(world) == pytest.approx(30.0)
    np.testing.assert_allclose(centre_of_mass(world)[:2], 0.0, atol=5e-3)
    lab.align(world, angle=math.pi / 2)
    pushed = []
    for _ in range(1200):
        pose, twist = body.pose(), body.twist()
        force = np.array([400 * (0.1 - twist.linear[0]), -400 * twist.linear[1] - 3000 * pose.position[1], 0.0])
        body.apply_force(force, pose.point([0, 0, -0.3]))
        world.client.api.applyExternalTorque(
            world.client.body("table_a"), -1, [0, 0, -3000 * pose.yaw - 300 * twist.angular[2]], 1
        )
        world.step()
        pushed.append((pose.position[0], effect.strength()))
    x, angle = np.array(pushed).T
    turning, trailing = (x > 0.005) & (x < 0.06), x > 0.2
    assert angle[turning].max() > 0.8
    assert angle[trailing].max() < 0.1


@pytest.mark.parametrize(
    ("load", "period"),
    [
        ({"motion": "swing", "mass": 6.0, "length": 0.30}, 2 * math.pi * math.sqrt(0.30 / GRAVITY)),
        ({"motion": "slide", "mass": 6.0, "frequency": 0.8, "heading": 0.0}, 1 / 0.8),
    ],
)
def test_a_load_swings_at_its_own_frequency_in_a_body_held_still(lab: Any, load: Any, period: float) -> None:
    told = load | {"damping_ratio": 0.0}
    world, body, effect = made(lab, {"sloshing_load": {"table_a": told}})
    assert total_mass(world) == pytest.approx(30.0)
    lab.run(world, 0.1, lambda: body.apply_force(np.array([40.0, 0, 0]), body.pose().point([0, 0, -0.2])))
    number = world.client.body("table_a")
    world.client.api.createConstraint(
        number, -1, -1, -1, 4, [0, 0, 0], [0, 0, 0], body._client.centre_pose("table_a").position
    )
    away = []
    lab.run(world, 3.0, lambda: away.append(effect.strength()))
    away = np.array(away[100:])
    assert away.max() > 2e-3
    lows = np.flatnonzero((away[1:-1] < away[:-2]) & (away[1:-1] <= away[2:]) & (away[1:-1] < 0.3 * away.max()))
    assert 2 * np.diff(lows).mean() / 400 == pytest.approx(period, rel=0.03)


def test_a_load_leaves_the_momentum_of_the_whole_alone(lab: Any) -> None:
    for motion in ("swing", "slide"):
        world, body, _ = made(
            lab, {"sloshing_load": {"table_a": {"motion": motion, "mass": 9.0, "damping_ratio": 0.1}}}
        )
        lab.run(world, 0.5, lambda b=body: b.apply_force(np.array([12.0, 0, 0]), b.pose().point([0, 0, -0.2])))
        early: list[float] = []
        lab.run(world, 8.0, lambda b=body, seen=early: seen.append(b.twist().linear[0]))
        assert body.twist().linear[0] == pytest.approx(12.0 * 0.5 / 30, rel=0.03), motion
        assert max(early) > 12.0 * 0.5 / 30 + 0.01, "the load lags behind, and overtakes"


def test_a_slide_ends_at_its_stops(lab: Any) -> None:
    told = {"motion": "slide", "mass": 6.0, "frequency": 0.3, "travel": 0.05, "damping_ratio": 0.02}
    world, body, effect = made(lab, {"sloshing_load": {"table_a": told}})
    away: list[float] = []

    def push() -> None:
        body.apply_force(np.array([60.0, 0, 0]), body.pose().point([0, 0, -0.2]))
        away.append(effect.strength())

    lab.run(world, 0.8, push)
    assert 0.05 < max(away) < 0.07
