"""What an oracle is told: the truth of a case in the columns of the effects library. For scoring alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bullet_sim.concealed.detent import peak_distance
from bullet_sim.concealed.floor_patch import FloorPatchSettings
from bullet_sim.concealed.sloshing_load import SloshingLoadSettings
from bullet_sim.concealed.truth import wheel_truth
from bullet_sim.scene import Scene
from pbrl_bringup.concealed.draws import CRATE, POST
from pbrl_bringup.concealed.stage import NAME

GRAVITY = 9.81
SPOT = 0.3
"""A way over which tread is laid down [m] that is so long that a caster scrubs as on the spot at any speed."""


def told_values(concealed: Mapping[str, Any], scene: Scene, grip: float = 0.0) -> dict[str, float]:
    """Return the columns of the effects kernel that the truth says something about.

    Args:
        concealed: settings of the effects.
        scene: with everything concealed.
        grip: turn of the sensor's axes against the body's when it was first held [rad].
    """
    values: dict[str, float] = {}
    wheel = scene.concealed.wheel.get(NAME)
    mass = float(scene.concealed.mass.get(NAME, scene.bodies[NAME].nominal_mass))  # type: ignore[union-attr]
    if wheel is not None:
        values |= _wheel(wheel_truth(wheel, mass))
    for effect, settings in concealed.items():
        told = settings[0] if isinstance(settings, list) else settings.get(NAME, settings)
        values |= _VALUES.get(effect, _nothing)(told, scene, mass)
    if "wrench_bias" in concealed:
        values |= _bias(concealed["wrench_bias"], grip)
    return values


def _wheel(truth: dict[str, float]) -> dict[str, float]:
    """Return a wheel's columns; a limit of friction is learned as its logarithm, so that none is a little."""
    return {name: max(value, 1e-4) if name.startswith("mu") else value for name, value in truth.items()}


def _nothing(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {}


def _second_wheel(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    wheel = _wheel(wheel_truth(scene.concealed.second_wheel[NAME], mass))
    return {f"wheel2_{name.removeprefix('wheel_')}": value for name, value in wheel.items()}


def _caster(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    make = scene.concealed.caster_swivel[NAME]
    return {
        "caster_trail": make.trail,
        "caster_roll": make.rolling_resistance / make.radius,
        "caster_scrub": make.swivel_friction / make.trail / (mass * GRAVITY / 4.0),
        "caster_twist": make.sliding_friction * make.contact_width / 4.0 / make.trail,
        "caster_lay": make.scrub_length or SPOT,
    }


def _ground(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {"slide_mu": told["friction"]}


def _breakaway(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {
        "slide_mu": told["sliding"],
        "breakaway_mu": told["static"] - told["sliding"],
        "breakaway_speed": told["speed"],
    }


def _drag(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    half = 0.45 * np.array(scene.bodies[NAME].size)  # type: ignore[union-attr]
    return {"drag_linear": told["damping"], "drag_turn": told["damping"] * float(half @ half)}


def _patch(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    corners = np.array(told["polygon"])
    first, second = corners[1] - corners[0], corners[2] - corners[1]
    middle = corners.mean(axis=0)
    turn = math.atan2(first[1], first[0])
    # A rectangle is the same turned by half a turn; its prior is about no turn.
    turn -= math.pi * round(turn / math.pi)
    wheel = scene.concealed.wheel.get(NAME)
    lever = told.get("rolling_resistance", FloorPatchSettings.model_fields["rolling_resistance"].default)
    return {
        "patch_mu": told["friction"],
        **({} if wheel is None else {"patch_roll": lever / wheel.radius * wheel.load / (mass * GRAVITY)}),
        "patch_x": float(middle[0]),
        "patch_y": float(middle[1]),
        "patch_length": float(np.hypot(*first)) / 2.0,
        "patch_width": float(np.hypot(*second)) / 2.0,
        "patch_theta": turn,
    }


def _slope(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    tangent = math.tan(told["angle"])
    return {"slope_x": tangent * math.cos(told["heading"]), "slope_y": tangent * math.sin(told["heading"])}


def _com(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    share = told["mass"] / mass
    return {"com_x": share * told["place"][0], "com_y": share * told["place"][1]}


def _payload(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {
        "payload_mass": told["mass"],
        "payload_time": told["at"],
        "payload_x": told["place"][0],
        "payload_y": told["place"][1],
    }


def _slosh(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {
        "slosh_mass": told["mass"],
        "slosh_frequency": math.sqrt(GRAVITY / told["length"]) / (2.0 * math.pi),
        "slosh_damping": told.get("damping_ratio", SloshingLoadSettings.model_fields["damping_ratio"].default),
        "slosh_x": told["place"][0],
        "slosh_y": told["place"][1],
    }


def _tether(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {
        "tether_stiffness": told["stiffness"],
        "tether_length": told["slack_length"],
        "tether_x": told["anchor"][0],
        "tether_y": told["anchor"][1],
        "tether_at_x": told["point"][0],
        "tether_at_y": told["point"][1],
    }


def _detent(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {
        "detent_force": told["force"],
        "detent_x": told["place"][0],
        "detent_y": told["place"][1],
        "detent_at_x": told["point"][0],
        "detent_at_y": told["point"][1],
        "detent_width": peak_distance(told["gap"]),
    }


def _hinge(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    x, y, theta = scene.bodies[NAME].pose
    c, s = math.cos(theta), math.sin(theta)
    px, py = told["point"]
    return {
        "pivot_stiffness": told["stiffness"],
        "pivot_x": x + c * px - s * py,
        "pivot_y": y + s * px + c * py,
        "pivot_damping": 0.2,
    }


def _obstacle(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    corners = np.array(told["polygon"])
    middle, side = corners.mean(axis=0), corners[1] - corners[0]
    turn = math.atan2(side[1], side[0])
    # A square is the same turned by a quarter of a turn; its prior is about no turn.
    turn -= 0.5 * math.pi * round(turn / (0.5 * math.pi))
    return {
        "obstacle_x": float(middle[0]),
        "obstacle_y": float(middle[1]),
        "obstacle_radius": POST,
        "obstacle_angle": turn,
    }


def _unseen(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {
        "unseen_x": told["pose"][0],
        "unseen_y": told["pose"][1],
        "unseen_radius": CRATE,
        "unseen_angle": told["pose"][2],
        "unseen_force": told["nominal_mass"] * GRAVITY * told["friction"],
        "unseen_friction": told["friction"],
    }


def _external(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    values: dict[str, float] = {}
    kind = "steady" if told.get("period") is None else "periodic"
    values |= {f"{kind}_x": told["force"][0], f"{kind}_y": told["force"][1], f"{kind}_torque": 0.0}
    if told.get("period") is not None:
        values |= {"periodic_frequency": 1.0 / told["period"], "periodic_phase": 0.0}
    if "start" in told:
        values |= {"force_start": told["start"], "force_end": told["end"]}
    return values


def _bias(told: Any, grip: float) -> dict[str, float]:
    """Return an offset as the library has it: of what acts on the body, in the body's axes when it was first held."""
    side = next(iter(told.values()))
    kind = "drift" if "force_drift" in side else "bias"
    force, torque = (side[what + ("_drift" if kind == "drift" else "")] for what in ("force", "torque"))
    c, s = math.cos(grip), math.sin(grip)
    values = {
        f"{kind}_x": s * force[1] - c * force[0],
        f"{kind}_y": -s * force[0] - c * force[1],
        f"{kind}_torque": -torque[2],
    }
    if kind == "drift":
        return values
    return {**values, "bias_start": side["start"] + 0.5 * side["rise"]}


def _frame(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    side = next(iter(told.values()))
    return {"force_scale": side["scale"], "sensor_turn": -side["turn"][2]}


def _late(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    poses = "delay" in told
    delay = told["delay"] if poses else next(iter(told.values()))["delay"]
    return {"time_offset": delay if poses else -delay}


def _tag(told: Any, scene: Scene, mass: float) -> dict[str, float]:
    return {"tag_x": told["offset"][0], "tag_y": told["offset"][1], "tag_theta": told["turn"]}


_VALUES = {
    "second_wheel": _second_wheel,
    "caster_swivel": _caster,
    "ground_friction": _ground,
    "breakaway_friction": _breakaway,
    "viscous_drag": _drag,
    "floor_patch": _patch,
    "floor_slope": _slope,
    "com_offset": _com,
    "payload_change": _payload,
    "sloshing_load": _slosh,
    "tether": _tether,
    "detent": _detent,
    "hidden_hinge": _hinge,
    "hidden_obstacle": _obstacle,
    "unseen_body": _unseen,
    "external_force": _external,
    "wrench_frame": _frame,
    "time_offset": _late,
    "pose_bias": _tag,
}
