"""What stands in the scenes of the experiments on manipulation: what a controller can be told of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bullet_sim.catalogue import OnCasters
from bullet_sim.scene import Scene
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.robot_fits_trials import holding_casters
from pbrl_control.constraints.object_model import ObjectModel, SwivelCasters
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.planar import compose, rotation
from pbrl_model.kernel import GRAVITY
from pbrl_model.parameters import BodyParameters

Array = NDArray[np.float64]

HALL = ((-4.0, -4.0), (6.0, -4.0), (6.0, 4.0), (-4.0, 4.0))
"""Walls [m]: a base that shunts needs room."""
NEAR = 1e-6
"""Places that are one [m]."""


def told(scene: Scene, name: str) -> ObjectModel:
    """Return the true model of a body on casters, in the world model's terms; casters that swing round are known.

    Raises:
        BringupError: the body stands on no casters.
    """
    body = scene.bodies[name]
    if not isinstance(body, OnCasters):
        raise BringupError(f"{name}: expected a body on casters, got a {body.kind}")
    casters = body.casters
    holding, fixed = holding_casters(scene, name)
    friction = casters.sliding_friction * len(holding) / len(body.swivels)
    mass = scene.concealed.mass.get(name, body.nominal_mass)
    known: dict[str, float] = {"mass": mass, "mu_ground": casters.rolling_resistance / casters.radius}
    if len(holding):
        x, y = np.mean(holding, axis=0).tolist()
        known |= {"wheel_x": x, "wheel_y": y, "mu_x": 0.0 if fixed else friction, "mu_y": friction}
    return ObjectModel.uniform(BodyParameters(**known), body.footprint, _swivelling(body, mass, holding))


def _swivelling(body: OnCasters, mass: float, holding: Array) -> SwivelCasters | None:
    """Return the casters that swing round: bearing and scrub resist at the lever of the trail; None where none do."""
    casters, count = body.casters, len(body.swivels)
    free = [place for place in body.swivels.values() if not (np.abs(holding - place).sum(axis=1) < NEAR).any()]
    load = mass * GRAVITY / count
    lever = casters.swivel_friction / load + casters.sliding_friction * casters.contact_width / 4.0
    if not free or lever == 0.0 or casters.trail == 0.0:
        return None
    return SwivelCasters(np.array(free), lever / casters.trail, 1.0 / count)


def believed_free(model: ObjectModel) -> ObjectModel:
    """Return the model without its wheel: what is believed before anything was learned."""
    plain = BodyParameters(mass=model.mass, mu_ground=model.parameters.mu_ground)
    return ObjectModel.uniform(plain, model.footprint, model.casters)


def in_a_hall(scene: Scene, plan: GraspPlan) -> Scene:
    """Return a scene without near walls, and the robot square before its grips, as one that drove there would be."""
    x, y, yaw = scene.robot.pose
    points = np.mean([grip.point for grip in plan.grips], axis=0)
    body = np.array(scene.bodies[plan.object].pose)
    left = rotation(yaw)[:, 1]
    x, y = np.array([x, y]) + left * (left @ (compose(body, np.array([*points, 0.0]))[:2] - (x, y)))
    robot = scene.robot.model_copy(update={"pose": (float(x), float(y), yaw)})
    return scene.model_copy(update={"robot": robot, "room": scene.room.model_copy(update={"outline": HALL})})
