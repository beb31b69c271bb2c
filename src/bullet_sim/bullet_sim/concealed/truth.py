"""The truth of a scene in numbers, for whoever scores: bodies in the world model's terms, effects as they were set."""

from __future__ import annotations

import math
from typing import Any

from bullet_sim.catalogue import Fixture
from bullet_sim.client import GRAVITY
from bullet_sim.concealed.options import EFFECTS
from bullet_sim.concealed.second_wheel import FixedWheelSettings
from bullet_sim.errors import SimError, nearest
from bullet_sim.scene import Scene


def baseline_truth(scene: Scene, name: str) -> dict[str, float]:
    """Give mass and wheel of a body by the names that a fit reports.

    Args:
        scene: with its concealed part.
        name: of a body that can move.

    Returns:
        `mass` [kg], and where the body has a `wheel` also `wheel_x`, `wheel_y` [m], `wheel_theta` [rad], `mu_x`,
        `mu_y`.

    Raises:
        SimError: no body of this name, or one that cannot move.
    """
    if name not in scene.bodies:
        raise SimError(f"body {name!r} is not in the scene; {nearest(name, scene.bodies)}")
    mass = _mass(scene, name)
    wheel = scene.concealed.wheel.get(name)
    return {"mass": mass} | ({} if wheel is None else wheel_truth(wheel, mass))


def _mass(scene: Scene, name: str) -> float:
    body = scene.bodies[name]
    if isinstance(body, Fixture):
        raise SimError(f"body {name!r}: expected one that can move, it is a fixture")
    return scene.concealed.mass.get(name, body.nominal_mass)


def wheel_truth(wheel: FixedWheelSettings, mass: float) -> dict[str, float]:
    """Give a wheel in the world model's terms; `mass` [kg] is that of the whole body."""
    share = wheel.load / (mass * GRAVITY)
    rolling = wheel.sliding_friction if wheel.locked else wheel.rolling_resistance / wheel.radius
    return {
        "wheel_x": wheel.position[0],
        "wheel_y": wheel.position[1],
        "wheel_theta": wheel.heading,
        "mu_x": rolling * share,
        "mu_y": wheel.sliding_friction * share,
    }


def effect_truth(scene: Scene) -> dict[str, dict[str, Any]]:
    """Give what was set of each effect, by key as in a recording's activities.

    Returns:
        Settings by name under `tether.table_a` and the like. Added are, for `second_wheel`, what `wheel_truth` gives;
        for `com_offset`, `com_x` and `com_y` [m] of the whole body; for `hidden_hinge`, `hinge_x` and `hinge_y` [m] in
        `world`; for `floor_slope`, `slope_x` and `slope_y`, its gradient downhill.
    """
    truth: dict[str, dict[str, Any]] = {}
    for effect in EFFECTS:
        told = getattr(scene.concealed, effect)
        if isinstance(told, dict):
            named = {f"{effect}.{target}": settings for target, settings in told.items()}
        elif isinstance(told, tuple):
            named = {f"{effect}.{number}": settings for number, settings in enumerate(told)}
        else:
            named = {} if told is None else {f"{effect}.room": told}
        truth |= {key: settings.model_dump() for key, settings in named.items()}
    _add_derived(scene, truth)
    return truth


def _add_derived(scene: Scene, truth: dict[str, dict[str, Any]]) -> None:
    """Add what follows from settings and body together."""
    concealed = scene.concealed
    for name, wheel in concealed.second_wheel.items():
        truth[f"second_wheel.{name}"] |= wheel_truth(wheel, _mass(scene, name))
    for name, ballast in concealed.com_offset.items():
        share = ballast.mass / _mass(scene, name)
        truth[f"com_offset.{name}"] |= {"com_x": share * ballast.place[0], "com_y": share * ballast.place[1]}
    for name, hinge in concealed.hidden_hinge.items():
        x, y, theta = scene.bodies[name].pose
        cos, sin = math.cos(theta), math.sin(theta)
        place = {
            "hinge_x": x + cos * hinge.point[0] - sin * hinge.point[1],
            "hinge_y": y + sin * hinge.point[0] + cos * hinge.point[1],
        }
        truth[f"hidden_hinge.{name}"] |= place
    if concealed.floor_slope is not None:
        tangent, heading = math.tan(concealed.floor_slope.angle), concealed.floor_slope.heading
        truth["floor_slope.room"] |= {"slope_x": tangent * math.cos(heading), "slope_y": tangent * math.sin(heading)}
