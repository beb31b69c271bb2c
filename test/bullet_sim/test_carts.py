"""Carts against hand calculation: fixed wheels roll along, hold across, do not swivel; what of a cart is clamped."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bullet_sim.boxes import combine
from bullet_sim.carts import cart_boxes, cart_slabs
from bullet_sim.catalogue import UtilityCart
from bullet_sim.clamp import GripperSpec, find_clamp
from bullet_sim.client import GRAVITY, Pose, yaw_quaternion

CART = {"kind": "utility_cart", "size": [0.90, 0.60], "height": 0.9115, "nominal_mass": 30.0, "pose": [0, 0, 0]}
ALL = ["front_left", "front_right", "rear_left", "rear_right"]
FRONT = ALL[:2]
RADIUS, LEVER, WHEEL, AXLE = 0.0625, 0.00075, 0.55, 0.308
LOW = [0.0, 0.0, -0.8]
"""Where to push so that the load stays on all four wheels alike: near the floor, under the tag."""


def cart_world(lab: Any, fixed: list[str], **options: Any) -> Any:
    return lab.world(lab.scene({"cart": CART}, concealed={"fixed_wheels": {"cart": fixed}}), **options)


@pytest.mark.parametrize("step", [1 / 240, 1 / 400, 1 / 1000])
def test_fixed_wheels_roll_along_themselves_as_the_hand_calculation_says(lab: Any, step: float) -> None:
    world = cart_world(lab, ALL, step=step)
    lab.run(world, 0.5)
    body, before = world.find("cart"), world.twist("cart").linear[0]
    lab.run(world, 1.0, lambda: body.apply_force(np.array([20.0, 0.0, 0.0]), body.pose().point(LOW)))
    expected = (20.0 - LEVER * 30 * GRAVITY / RADIUS) / (30 + 4 * 0.5 * WHEEL)
    assert body.twist().linear[0] - before == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("share", "moves"), [(0.6, False), (0.8, True)])
def test_fixed_wheels_hold_across_up_to_their_friction(lab: Any, share: float, moves: bool) -> None:
    world = cart_world(lab, ALL)
    lab.run(world, 0.25)
    body = world.find("cart")
    force = np.array([0.0, share * 30 * GRAVITY, 0.0])
    lab.run(world, 0.5, lambda: body.apply_force(force, body.pose().point([0.0, 0.0, -0.9115])))
    assert (body.pose().position[1] > 0.05) == moves, "0.7 of its weight is where wheels begin to slide"


def test_a_cart_pushed_sideways_at_its_rear_turns_about_its_axle_and_slides_along_its_wheels_alone(lab: Any) -> None:
    world = cart_world(lab, FRONT, seed=1)
    lab.run(world, 0.25)
    body = world.find("cart")
    slid, start = 0.0, np.array([AXLE, 0.0, 0.0])

    def push() -> None:
        nonlocal slid
        pose, twist = body.pose(), body.twist()
        speed = twist.linear + np.cross(twist.angular, pose.matrix @ start)
        slid += abs(float(speed @ pose.matrix[:, 1])) * world.client.step_time
        body.apply_force(np.array([8.0, 12.0, 0.0]), pose.point([-0.3, 0.0, -0.6]))

    lab.run(world, 1.8, push)
    travelled = float(np.hypot(*(body.pose().point(start) - start)[:2]))
    assert abs(body.pose().yaw) > 0.5
    assert travelled > 0.05
    assert slid < 0.005, "across their wheels they hold"


def test_a_fixed_wheel_does_not_swivel_and_the_others_do(lab: Any) -> None:
    world = cart_world(lab, FRONT, seed=2)
    casters, body = world.find("cart").casters, world.find("cart")
    before = casters.angles()
    assert [link.fixed for link in casters.links] == [True, True, False, False]
    lab.run(world, 1.5, lambda: body.apply_force(np.array([10.0, 10.0, 0.0]), body.pose().point([-0.3, 0.0, -0.6])))
    after = casters.angles()
    np.testing.assert_array_equal(after[:2], [0.0, 0.0])
    assert np.abs(after[2:] - before[2:]).min() > 0.05


def test_a_wheel_scrubs_in_full_on_the_spot_and_less_the_faster_it_rolls(lab: Any) -> None:
    shares = []
    for length in (None, 0.02, 0.01):
        cart = CART | {"casters": {"scrub_length": length}}
        world = lab.world(lab.scene({"cart": cart}, concealed={"fixed_wheels": {"cart": ALL}}))
        body, api = world.find("cart"), world.client.api

        def scrub(world: Any = world, api: Any = api) -> float:
            wheel = world.find("cart").casters.links[0].wheel
            return api.getDynamicsInfo(world.client.body("cart"), wheel)[7] / (0.7 * 0.010 / 4)

        assert scrub() == pytest.approx(1.0)
        lab.run(world, 0.5, lambda body=body: body.apply_force(np.array([60.0, 0.0, 0.0]), body.pose().point(LOW)))
        # On the wheels' own axle line a force couple turns the rolling cart slowly, at 0.2 rad for each metre or so.
        turn = np.array([0.0, 40.0, 0.0])
        lab.run(world, 0.2, lambda body=body, turn=turn: body.apply_force(turn, body.pose().point([-0.45, 0.0, -0.8])))
        shares.append(scrub())
    assert shares[0] == pytest.approx(1.0)
    assert shares[1] < 0.2
    assert shares[2] <= shares[1]


def test_fixed_wheels_touch_the_floor_under_their_places_and_casters_beside_theirs(lab: Any) -> None:
    casters = cart_world(lab, FRONT).find("cart").casters
    places = np.array([link.place for link in casters.links])
    away = np.hypot(*(casters.contacts()[:, :2] - places).T)
    np.testing.assert_allclose(away, [0.0, 0.0, 0.040, 0.040], atol=1e-6)


def test_making_wheels_fixed_leaves_the_other_casters_as_they_were(lab: Any) -> None:
    fixed, free = (cart_world(lab, which, seed=3).find("cart").casters.angles() for which in (FRONT, []))
    np.testing.assert_array_equal(fixed[2:], free[2:])


def test_a_wheel_both_fixed_and_locked_stands_straight_and_does_not_roll(lab: Any) -> None:
    concealed = {"fixed_wheels": {"cart": ALL}, "locked_casters": {"cart": ALL}}
    world = lab.world(lab.scene({"cart": CART}, concealed=concealed))
    lab.run(world, 0.25)
    body = world.find("cart")
    lab.run(world, 0.5, lambda: body.apply_force(np.array([60.0, 0.0, 0.0]), body.pose().point(LOW)))
    assert np.hypot(*body.pose().position[:2]) < 1e-3


def test_a_cart_weighs_what_it_is_told_and_stands_where_it_was_put(lab: Any) -> None:
    world = cart_world(lab, FRONT)
    api, body = world.client.api, world.client.body("cart")
    links = range(-1, api.getNumJoints(body))
    assert sum(api.getDynamicsInfo(body, link)[0] for link in links) == pytest.approx(30.0)
    shelves, bars, posts = 0.36 * (0.8955 + 0.284), 0.12 * 0.8955, 0.16 * (0.156 + 0.8795) / 2
    assert api.getBasePositionAndOrientation(body)[0][2] == pytest.approx(shelves + bars + posts, abs=1e-4)
    lab.run(world, 2.0)
    assert np.abs(world.truth("cart").planar).max() < 0.2e-3
    assert world.find("cart").casters.loads.sum() == pytest.approx(30 * GRAVITY, rel=1e-3)


SPEC = GripperSpec()


@pytest.mark.parametrize(
    ("tip", "heading", "depth", "middle"),
    [
        ((-0.45 + 0.065, 0.1), 0.0, 0.032, (-0.434, 0.1)),  # the rear bar: all of it between the plates
        ((0.45 - 0.065, 0.0), np.pi, 0.032, (0.434, 0.0)),  # the front bar
        ((0.1, -0.30 + 0.065), np.pi / 2, 0.065, (0.1, -0.2675)),  # the shelf's rim on the long side
    ],
)
def test_bars_and_rim_are_clamped(
    lab: Any, tip: tuple[float, float], heading: float, depth: float, middle: tuple[float, float]
) -> None:
    turn = yaw_quaternion(heading - np.pi / 2)
    loose = Pose(np.zeros(3), turn)
    gripper = Pose(np.array([*tip, 0.8955]) - loose.matrix @ SPEC.along(SPEC.plate_end), turn)
    test = find_clamp(cart_world(lab, FRONT).furniture.values(), gripper, SPEC)
    assert test.clamp is not None, test.message
    assert test.clamp.depth == pytest.approx(depth, abs=1e-4)
    np.testing.assert_allclose(test.clamp.contact[:2], middle, atol=1e-4)


def test_a_held_bar_is_the_one_that_was_clamped(lab: Any) -> None:
    body = cart_world(lab, FRONT).find("cart")
    for x, expected in ((-0.434, 0), (0.0, 1), (0.434, 2)):
        assert body.slab_at(np.array([x, 0.1, -0.016])) is body.slabs[expected]


def test_a_cart_without_an_upper_shelf_weighs_the_same_sits_lower_and_has_bars_alone_to_clamp() -> None:
    carts = [UtilityCart.model_validate(CART | {"upper_shelf": there}) for there in (True, False)]
    boxes = [cart_boxes(cart, 28.0) for cart in carts]
    assert [sum(box.mass for box in each) for each in boxes] == pytest.approx([28.0, 28.0])
    heights = [float(combine(each)[0][2]) for each in boxes]
    assert heights[1] < heights[0] - 0.1
    assert [len(cart_slabs(cart)) for cart in carts] == [3, 2]
    middle = [any(np.all(np.abs([0, 0, 0.8955] - box.centre) <= box.half) for box in each) for each in boxes]
    assert middle == [True, False]
