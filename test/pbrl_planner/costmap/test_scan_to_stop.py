"""From scans to commands: what the laser sees of room, person and its own cart, and what the controller makes of it."""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.cart import CartBody, CartController, CartPercept, CartPlan, CartSettings, Cause, DriveStatus
from pbrl_control.planar import Array, compose
from pbrl_planner.costmap import Costmap, CostmapSettings, RangeScan

LASER = np.array([0.275, 0.0, 0.0])
TICK = 0.05


def body() -> CartBody:
    half = 0.334
    robot = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    cart = np.array([[0.0, -0.3], [0.9, -0.3], [0.9, 0.3], [0.0, 0.3]])
    aside = np.array([[0.0, 0.25], [0.0, -0.25]])
    return CartBody(robot, cart, (0.65, 0.0), aside + np.array([0.284, 0.0]), aside)


def see(pose: Array, segments: Array, time: float, rng: np.random.Generator) -> RangeScan:
    """Cast beams against segments (n, 2, 2)."""
    angles = np.linspace(-2.2, 2.2, 221)
    directions = np.column_stack((np.cos(angles + pose[2]), np.sin(angles + pose[2])))[:, None]
    a, along = segments[None, :, 0] - pose[:2], segments[None, :, 1] - segments[None, :, 0]
    cross = directions[..., 0] * along[..., 1] - directions[..., 1] * along[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (a[..., 0] * along[..., 1] - a[..., 1] * along[..., 0]) / cross
        share = (a[..., 0] * directions[..., 1] - a[..., 1] * directions[..., 0]) / cross
    far = np.where((far > 0.0) & (share >= 0.0) & (share <= 1.0), far, np.inf).min(axis=1)
    return RangeScan(time, -2.2, angles[1] - angles[0], (0.1, 30.0), far + rng.normal(0.0, 0.008, len(far)))


def ring(corners: Array) -> Array:
    return np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)


def rectangle(left: float, bottom: float, right: float, top: float) -> Array:
    return np.array([[left, bottom], [right, bottom], [right, top], [left, top]])


def legs(outline: Array) -> Array:
    """Return the cart's four legs, 4 cm thick, as segments: all of it that is as low as the laser."""
    middle = outline.mean(axis=0)
    inner = middle + (outline - middle) * 0.93
    return np.concatenate([ring(leg + rectangle(-0.02, -0.02, 0.02, 0.02)) for leg in inner])


def test_a_person_stops_it_its_own_cart_does_not_and_it_goes_on_when_the_person_is_gone(
    rng: np.random.Generator,
) -> None:
    mine, settings = body(), CartSettings(patience=20.0)
    turned = np.linspace(0.0, 0.8, 30)
    path = np.column_stack(
        (1.5 * np.sin(turned), 1.5 * (1 - np.cos(turned)), turned, 0.3 * np.sin(turned / 0.8 * 3.14))
    )
    controller = CartController(CartPlan.timed(path, settings.limits), mine, settings)
    costmap = Costmap(CostmapSettings())
    room = ring(rectangle(-1.5, -1.6, 4.5, 3.5))
    person = ring(rectangle(2.2, 1.1, 2.5, 1.4))
    state, seen, own = path[0].copy(), [], 0
    for k in range(400):
        now = TICK * k
        there = 1.0 <= now < 8.0
        outlines = mine.outlines(state[:3], state[3])
        things = [room, legs(outlines[1]), *([person] if there else [])]
        laser = compose(state[:3], LASER)
        costmap.recentre(*state[:2])
        cart = np.array([*mine.grip, state[3]]) + rng.normal(0.0, 0.003, 3)
        scan = see(laser, np.concatenate(things), now, rng)
        own += costmap.observe(scan, laser, mine.seen_outlines(state[:3], cart)).own
        if now > 10.0 and seen[-1][1].status is DriveStatus.BLOCKED:
            # The cart's legs can hide where the person was from the laser.
            costmap.clear_unseen(now, 2.0)
        field = costmap.field(now)
        command = controller.step(now, CartPercept(state[:3], now, float(state[3]), 0.0, now, field.time, field))
        seen.append((now, command, min(_gap(outline, person) for outline in outlines)))
        if command.status is DriveStatus.ARRIVED:
            break
        c, s = math.cos(state[2]), math.sin(state[2])
        vx, vy, omega = command.twist
        state = state + TICK * np.array([c * vx - s * vy, s * vx + c * vy, omega, command.articulation_rate])
    while_there = [each for each in seen if 1.0 <= each[0] < 8.0]
    assert own > 1000
    assert min(gap for _, _, gap in while_there) > 0.01
    assert while_there[-1][1].status is DriveStatus.BLOCKED and while_there[-1][1].cause is Cause.OBSTACLE
    assert {command.status for now, command, _ in seen if now < 1.0} == {DriveStatus.MOVING}
    assert seen[-1][1].status is DriveStatus.ARRIVED


def _gap(outline: Array, segments: Array) -> float:
    """Return how far a convex outline's sides are from segments (n, 2, 2), by points along them [m]."""
    share = np.linspace(0.0, 1.0, 12)[:, None]
    one = np.concatenate([a + share * (b - a) for a, b in ring(outline)])
    other = np.concatenate([a + share * (b - a) for a, b in segments])
    return float(np.hypot(*(one[:, None] - other[None]).transpose(2, 0, 1)).min())
