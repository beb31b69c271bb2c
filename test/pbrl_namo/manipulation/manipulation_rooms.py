"""Rooms and beliefs for the tests of manipulation, and a judge of plans who knows nothing of kernels."""

from __future__ import annotations

import numpy as np
import shapely

from pbrl_control.planar import Array, compose, inverse, rotation
from pbrl_namo.beliefs import ObjectBelief, belief_of_draws
from pbrl_namo.manipulation import ManipulationPlan
from pbrl_namo.regions import free_space
from pbrl_namo.scene import Movable, NamoScene

WHEEL = ("mass", "wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y", "mu_ground")
ANGLED = np.array([[-0.6, -0.6], [0.6, -0.6], [0.6, -0.1], [-0.1, -0.1], [-0.1, 0.6], [-0.6, 0.6]])
HOLLOW = np.array(
    [[-0.9, -0.6], [0.9, -0.6], [0.9, 0.6], [0.6, 0.6], [0.6, -0.2], [-0.6, -0.2], [-0.6, 0.6], [-0.9, 0.6]]
)


def box(width: float, height: float, middle: tuple[float, float] = (0.0, 0.0)) -> Array:
    x, y = width / 2.0, height / 2.0
    return np.array([[-x, -y], [x, -y], [x, y], [-x, y]]) + middle


def two_tables() -> NamoScene:
    """A room of 6 m by 4 m that two tables split (thesis figure 43): 0.45, 0.8 and 0.45 m are left between all."""
    return NamoScene.of(
        box(6.0, 4.0, (3.0, 2.0)),
        {},
        {"square": Movable(box(0.8, 0.8), 0.75, 33.0), "long": Movable(box(0.75, 1.5), 0.75, 38.0)},
        {"square": np.array([3.0, 0.85, 0.0]), "long": np.array([3.0, 2.8, 0.0])},
        np.array([0.9, 2.0, 0.0]),
        np.array([5.2, 2.0, np.nan]),
    )


def doorway() -> NamoScene:
    """Two rooms, with a desk behind the door between them: it has to be pushed in, and then aside."""
    return NamoScene.of(
        np.array([[2.12, 0.0], [6.4, 0.0], [6.4, 4.0], [2.12, 4.0]]),
        {"low": box(0.15, 1.2, (4.0, 0.6)), "high": box(0.15, 1.2, (4.0, 3.4))},
        {"desk": Movable(box(0.75, 1.5), 0.75, 33.0)},
        {"desk": np.array([3.4, 2.0, 0.0])},
        np.array([5.6, 2.0, np.pi]),
        np.array([2.8, 0.7, np.nan]),
    )


def rolling(thing: Movable, mass: float = 30.0, friction: float = 0.02) -> ObjectBelief:
    """Return the belief that a thing surely rolls."""
    return belief_of_draws(thing, ("mass", "mu_ground"), np.array([[mass, friction]] * 20))


def pinned(thing: Movable, x: float, y: float, ground: float = 0.02, spread: float = 0.0) -> ObjectBelief:
    """Return the belief that a thing has a locked caster at a point."""
    rng, count = np.random.default_rng(5), 40
    mass = np.full(count, thing.mass)
    places = np.array([x, y]) + spread * rng.standard_normal((count, 2))
    rest = np.tile([0.3, 0.25, 0.25, ground], (count, 1))
    return belief_of_draws(thing, WHEEL, np.column_stack((mass, places, rest)))


def stuck(thing: Movable) -> ObjectBelief:
    """Return the belief that a thing is bolted to the floor, as far as a robot goes."""
    return belief_of_draws(thing, ("mass", "mu_x", "mu_y", "mu_ground"), np.array([[300.0, 0.9, 0.9, 0.9]] * 20))


def screw(pose: Array, twist: Array, time: float) -> Array:
    """Return the pose (3,) after a constant twist in the body's axes, by many small steps of the middle's velocity."""
    steps = 2000
    here = np.array(pose, dtype=float)
    for _ in range(steps):
        half = here[2] + 0.5 * twist[2] * time / steps
        here[:2] += rotation(half) @ twist[:2] * time / steps
        here[2] += twist[2] * time / steps
    return here


def judge(scene: NamoScene, radius: float, plan: ManipulationPlan, then: tuple[str, ...] = ()) -> str:
    """Return what is wrong with a plan, by exact polygons alone; empty where nothing is."""
    pose = scene.poses[plan.object]
    others = shapely.union_all([*scene.fixed.values(), *(o for n, o in scene.outlines.items() if n != plan.object)])
    shapely.prepare(others)
    room = scene.room.buffer(1e-6)
    there = np.array(pose, dtype=float)
    for motion in plan.motions:
        for _ in range(20):
            there = screw_closed(there, motion.twist, motion.duration / 20.0)
            base = compose(there, compose(inverse(pose), plan.stand))
            covered = shapely.union(scene.movable[plan.object].at(there), shapely.Polygon(scene.robot.at(base)))
            if covered.intersection(others).area > 1e-6:
                return f"at {there} something is hit"
            if not room.covers(covered):
                return f"at {there} a wall is hit"
    if np.hypot(*(there - plan.end)[:2]) > 1e-6 or abs(np.sin(there[2] - plan.end[2])) > 1e-6:
        return f"it ends at {there}, told was {plan.end}"
    leave = compose(there, compose(inverse(pose), plan.drive_to))
    free = free_space(scene.moved({plan.object: there}), radius, leave_out=then)
    start, end = free.index(leave[:2]), free.index(plan.target)
    return "" if start is not None and start == end else f"no way from {leave} ({start}) to {plan.target} ({end})"


def screw_closed(pose: Array, twist: Array, time: float) -> Array:
    """Return what `screw` does, about the point that stays where it is."""
    if abs(twist[2]) < 1e-9:
        return pose + np.array([*(rotation(float(pose[2])) @ twist[:2] * time), 0.0])
    centre = np.array([-twist[1], twist[0]]) / twist[2]
    turned = rotation(float(pose[2])) @ centre
    theta = float(pose[2] + twist[2] * time)
    return np.array([*(pose[:2] + turned - rotation(theta) @ centre), theta])
