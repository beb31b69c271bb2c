"""Plain tables: the model's own class of body, and the wheel that it may have."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bullet_sim.client import GRAVITY
from bullet_sim.errors import SimError

PLAIN = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [0, 0, 0]}
WHEEL = {"position": [0.2, 0.45], "heading": 0.4}


def plain_world(lab: Any, concealed: dict[str, Any] | None = None, *, seed: int = 0, **keys: Any) -> Any:
    world = lab.world(lab.scene({"table_a": PLAIN | keys}, concealed=concealed or {}), seed=seed)
    lab.run(world, 0.1)
    return world


def test_it_is_an_even_board_for_force_and_moment(lab: Any) -> None:
    for concealed in ({}, {"wheel": {"table_a": WHEEL | {"sliding_friction": 1e-6}}}):
        world = plain_world(lab, concealed)
        body = world.find("table_a")
        lab.run(world, 0.5, lambda body=body: body.apply_force(np.array([6.0, 0, 0]), body.pose().point([0, 0.5, 0])))
        spin = body.twist().angular[2]
        centre = body.pose().position
        assert spin == pytest.approx(-6.0 * 0.5 * 0.5 / (30 * (0.8**2 + 1.4**2) / 12), rel=0.01)
        lab.run(world, 0.5)
        moved = body.pose().position - centre
        assert np.hypot(*moved[:2]) / 0.5 == pytest.approx(6.0 * 0.5 / 30, rel=0.01), "the middle is where its mass is"


def test_without_a_wheel_it_coasts_for_ever(lab: Any) -> None:
    world = plain_world(lab)
    body = world.find("table_a")
    lab.run(world, 0.3, lambda: body.apply_force(np.array([20.0, 5.0, 0]), body.pose().point([0.1, 0.5, 0])))
    before = body.twist()
    lab.run(world, 3.0)
    after = body.twist()
    np.testing.assert_allclose(after.linear[:2], before.linear[:2], atol=1e-4)
    assert after.angular[2] == pytest.approx(before.angular[2], abs=1e-4)


def test_a_wheel_rolls_along_its_heading_and_holds_across_up_to_its_friction(lab: Any) -> None:
    world = plain_world(lab, {"wheel": {"table_a": WHEEL}})
    body = world.find("table_a")
    place, heading = np.array([*WHEEL["position"], 0.0]), WHEEL["heading"]
    along, across = [], []

    def push() -> None:
        pose, twist = body.pose(), body.twist()
        body.apply_force(pose.matrix @ [8.0, 10.0, 0.0], pose.point([-0.3, 0.2, -0.1]))
        speed = twist.linear + np.cross(twist.angular, pose.matrix @ place)
        angle = pose.yaw + heading
        along.append(math.cos(angle) * speed[0] + math.sin(angle) * speed[1])
        across.append(-math.sin(angle) * speed[0] + math.cos(angle) * speed[1])

    lab.run(world, 2.0, push)
    assert max(np.abs(along)) > 0.3
    assert max(np.abs(across)) < 0.01 * max(np.abs(along))


@pytest.mark.parametrize("heading", [0.0, 0.4, 1.2])
def test_a_wheel_that_holds_does_not_creep(lab: Any, heading: float) -> None:
    wheel = {"position": [0.1, -0.04], "heading": heading, "load": 120.0}
    world = plain_world(lab, {"wheel": {"table_a": wheel}})
    body, place = world.find("table_a"), np.array([0.1, -0.04, 0.0])
    across = np.array([-math.sin(heading), math.cos(heading), 0.0])
    start, crept = body.pose(), 0.0

    def push() -> None:
        nonlocal crept
        pose, twist = body.pose(), body.twist()
        # Against the 84 N that its friction can hold, and a little along it.
        body.apply_force(pose.matrix @ (25.0 * across + [0.5, 0.0, 0.0]), pose.point([*place[:2], -0.3]))
        crept += float(across @ pose.matrix.T @ (twist.linear + np.cross(twist.angular, pose.matrix @ place))) / 400.0

    lab.run(world, 2.0, push)
    assert np.hypot(*(body.pose().position - start.position)[:2]) > 0.002, "it rolls"
    assert abs(crept) < 0.001


def test_a_wheel_slides_with_the_friction_of_its_own_load_wherever_the_body_is_pushed(lab: Any) -> None:
    for height in (-0.05, -0.6):
        wheel = {"position": [0.0, 0.0], "heading": 0.0, "load": 60.0, "sliding_friction": 0.5}
        world = plain_world(lab, {"wheel": {"table_a": wheel}})
        body = world.find("table_a")
        lab.run(world, 1.0, lambda b=body, h=height: b.apply_force(np.array([0, 45.0, 0]), b.pose().point([0, 0, h])))
        assert body.twist().linear[1] == pytest.approx((45.0 - 0.5 * 60.0) / 30, rel=0.02)


def test_a_wheel_with_rolling_resistance_brakes_as_its_lever_says(lab: Any) -> None:
    wheel = {"position": [0.0, 0.0], "load": 100.0, "rolling_resistance": 0.003, "radius": 0.05}
    world = plain_world(lab, {"wheel": {"table_a": wheel}})
    body = world.find("table_a")
    lab.run(world, 1.0, lambda: body.apply_force(np.array([12.0, 0, 0]), body.pose().point([0, 0, -0.2])))
    assert body.twist().linear[0] == pytest.approx((12.0 - 0.003 * 100 / 0.05) / 30.1, rel=0.02)


def test_a_strut_takes_its_load_from_the_feet(lab: Any) -> None:
    world = plain_world(lab, {"wheel": {"table_a": WHEEL | {"load": 90.0}}})
    lab.run(world, 0.2)
    number = world.client.body("table_a")
    strut = world.find("table_a").fittings[0]
    contacts = world.client.api.getContactPoints(bodyA=number)
    assert sum(c[9] for c in contacts if c[3] == strut.tip) == pytest.approx(90.0, rel=0.01)
    assert sum(c[9] for c in contacts) == pytest.approx(30 * GRAVITY, rel=0.01)


def test_a_wheel_too_strong_for_the_body_is_a_one_line_error(lab: Any) -> None:
    with pytest.raises(SimError, match=r"wheel\.table_a\.load: expected at most 235 N on its wheels .* got 300 N"):
        lab.scene({"table_a": PLAIN}, concealed={"wheel": {"table_a": WHEEL | {"load": 300.0}}})
    with pytest.raises(SimError, match=r"wheel\.table_a\.position: expected a place on the body, got \[0\.9"):
        lab.scene({"table_a": PLAIN}, concealed={"wheel": {"table_a": WHEEL | {"position": [0.9, 0.0]}}})
