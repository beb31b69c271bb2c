"""Tables of several kinds in a small room, and what any plan has to keep: shared by these tests."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely import Polygon

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.navigation.floor_map import FloorMap
from pbrl_control.planar import rotation
from pbrl_model.parameters import BodyParameters
from pbrl_model.rollout import com_to_origin, rollout_states
from pbrl_planner.kinodynamic import Goal, KinodynamicPlan, KinodynamicSettings, PushProblem, WrenchLimits

TABLE = np.array([[-0.4, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.4, 0.3]])
ROOM = np.array([[-2.0, -1.5], [2.0, -1.5], [2.0, 1.5], [-2.0, 1.5]])
ROBOT = np.array([[-1.2, -0.25], [-0.5, -0.25], [-0.5, 0.25], [-1.2, 0.25]])
POST = {"post": np.array([[0.1, 0.6], [0.3, 0.6], [0.3, 0.8], [0.1, 0.8]])}
QUICK = KinodynamicSettings(iterations=20_000, time_limit=20.0)
HINGE = (0.0, -1.0)

KINDS = {
    "free": BodyParameters(20.0),
    "feet": BodyParameters(20.0, mu_ground=0.05),
    "fixed wheel": BodyParameters(20.0, wheel_x=0.3, wheel_theta=0.5, mu_x=0.01, mu_y=0.5),
    "locked caster": BodyParameters(20.0, wheel_x=0.35, wheel_y=0.25, mu_x=0.5, mu_y=0.5),
    "hinge": BodyParameters(20.0, hinge_x=HINGE[0], hinge_y=HINGE[1], hinge_radius=0.7, anchor_y=-0.3, mu_ground=0.02),
    "pivot": BodyParameters(20.0, hinge_x=-0.4, hinge_y=-0.3, hinge_radius=0.0, anchor_x=-0.4, anchor_y=-0.3),
}


def problem(kind: str = "feet", **changes: object) -> PushProblem:
    model = ObjectModel.uniform(KINDS[kind], TABLE)
    asked = {
        "model": model,
        "start": np.zeros(3),
        "contact": np.array([-0.4, 0.0]),
        "limits": WrenchLimits(30.0, 30.0, 10.0),
        "floor": FloorMap.of(ROOM, {}),
        "goal": goal_of(kind),
        **changes,
    }
    return PushProblem(**asked)  # type: ignore[arg-type]


def goal_of(kind: str) -> Goal:
    """Return a goal that each kind of table can be brought to: some way along, or some turn about its fixed point."""
    if kind == "locked caster":
        return Goal(lambda pose: float(pose[2]) < -0.6)
    if kind == "pivot":
        return Goal(lambda pose: float(pose[2]) > 0.5)
    if kind == "hinge":
        return Goal(lambda pose: float(pose[0]) > 0.4)
    if kind == "fixed wheel":
        return Goal(lambda pose: float(np.hypot(*pose[:2])) > 0.5)
    return Goal.near(np.array([0.9, 0.3, 0.4]), 0.15, 0.3)


def assert_keeps_the_laws(asked: PushProblem, plan: KinodynamicPlan, settings: KinodynamicSettings = QUICK) -> None:
    """Hold a plan to what any plan has to keep, by other code than the planner's."""
    assert asked.goal.reached(plan.poses[-1])
    assert (np.abs(plan.wrenches) <= asked.limits.array + 1e-12).all()
    counts = np.rint(plan.durations / settings.dt).astype(int)
    np.testing.assert_allclose(plan.durations, counts * settings.dt)
    np.testing.assert_allclose(plan.times, np.arange(counts.sum() + 1) * settings.dt)
    states = simulated(asked, np.repeat(plan.wrenches, counts, axis=0), settings.dt)
    apart = plan.states - states
    apart[:, 2] = np.remainder(apart[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    assert np.abs(apart).max() <= 1e-9
    np.testing.assert_allclose(com_to_origin(plan.states[:, :3], asked.model.com), plan.poses, atol=1e-12)
    assert_free(asked, plan.poses)
    lever = asked.contact - asked.model.com
    for x, y, theta, vx, vy, omega in plan.states:
        assert math.isfinite(x + y)
        arm = rotation(theta) @ lever
        assert np.hypot(vx - omega * arm[1], vy + omega * arm[0]) <= settings.speed + 1e-9
        assert abs(omega) <= settings.yaw_rate + 1e-9
    if settings.come_to_rest:
        gyration = math.sqrt(asked.model.inertia_per_mass)
        assert np.hypot(np.hypot(*plan.states[-1, 3:5]), gyration * plan.states[-1, 5]) <= settings.rest_speed


def simulated(asked: PushProblem, wrenches: np.ndarray, dt: float) -> np.ndarray:
    """Return the states (m, 6) of the world model's own rollout, given a wrench at the contact for each step."""
    lever = asked.contact - asked.model.com
    about_com = wrenches.copy()
    about_com[:, 2] += lever[0] * wrenches[:, 1] - lever[1] * wrenches[:, 0]
    centre = asked.start[:2] + rotation(float(asked.start[2])) @ asked.model.com
    start = np.array([*centre, asked.start[2], *asked.twist])
    row = asked.model.parameters.to_vector()[None]
    body = (asked.model.inertia_per_mass, asked.model.com)
    return rollout_states(row, start[None], about_com[None], *body, dt, parallel=False, body_wrench=True)[0, 0]


def assert_free(asked: PushProblem, poses: np.ndarray) -> None:
    """Check every outline at every pose against the floor's own polygons."""
    obstacles = shapely.union_all(list(asked.floor.obstacles.values()))
    for outline in (asked.model.footprint, asked.holder):
        if outline is None:
            continue
        for pose in poses:
            covered = Polygon(outline @ rotation(float(pose[2])).T + pose[:2])
            assert covered.difference(asked.floor.room).area < 1e-5
            assert covered.intersection(obstacles).area < 1e-5
