"""From the numbers of a learned model to settings of `concealed`: what would make a body behave so.

Numbers go by the names that reports use. Each maker returns a part of the `concealed` section as plain data; the
scene's own checks say whether such a thing can be.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from bullet_sim.catalogue import Block, CasterSettings, Fixture
from bullet_sim.client import GRAVITY
from bullet_sim.concealed.detent import peak_distance
from bullet_sim.concealed.from_sensors import late_stream, sensor_frame, sensor_offset
from bullet_sim.concealed.hidden_bodies import UnseenBodySettings
from bullet_sim.concealed.told import LEAST_LOAD, TREAD, Told, frictions

WHEEL_RADIUS = 0.05
"""Of a wheel on a strut [m]."""
BALLAST_SHARES = (0.15, 0.3, 0.45, 0.6)
"""Shares of a body's mass that are tried as ballast: the less, the further out it has to stand."""
LEAST_SLIDING = 1e-3
"""Sliding friction of feet that do nothing but stick."""
CRATE_FRICTION, SLIDES = 0.15, 0.9
"""Of an unseen body where a model says nothing, and at most, of what would tip it where it is pushed at its top. Its
mass is what then needs the force that was found."""
LEAST_GIVE = 1e-5
"""Of a hold [m/N]: stiffer ones are all alike, and one that a fit takes below zero is stiff."""
CASTERS, LEAST_BEARING = 4, 0.2
"""Under a table; share of its weight that they bear at least, beside glides and wheels on struts."""
CORNERS = 16
"""Of a disc."""
DISC = -10.0
"""An `unseen_angle` or `obstacle_angle` at or below it means one."""


Maker = Callable[[Told], dict[str, Any]]


def body_itself(told: Told) -> dict[str, Any]:
    """Return what is no effect: mass, one wheel, friction of the whole body.

    Raises:
        ValueError: it hangs on a hinge that is told, which no body of a scene does.
    """
    if "hinge_x" in told.values:
        raise ValueError("expected a body that stands on the floor, got one on a hinge; use concealed.hidden_hinge")
    found: dict[str, Any] = {"mass": {told.name: told["mass"]}}
    if "wheel_x" in told.values:
        found["wheel"] = {told.name: _wheel(told, "")}
    if told.get("mu_ground") > 0.0 and not {"ground_friction", "breakaway_friction"} & set(told.effects):
        found["ground_friction"] = {told.name: {"friction": told["mu_ground"] / told.on_feet}}
    return found


def _wheel(told: Told, key: str) -> dict[str, Any]:
    """Return a wheel on a strut: the direction of less friction is the one in which it rolls."""
    along, across = frictions(told, key)
    heading = told.get(f"wheel{key}_theta")
    locked = along == across
    if along > across:
        along, across, heading = across, along, heading + 0.5 * math.pi
    load = max(LEAST_LOAD, across * told.weight / TREAD)
    return {
        "position": told.place(f"wheel{key}"),
        "heading": math.remainder(heading, 2.0 * math.pi),
        "load": load,
        "sliding_friction": across * told.weight / load,
        "rolling_resistance": 0.0 if locked else along * told.weight * WHEEL_RADIUS / load,
        "radius": WHEEL_RADIUS,
        "locked": locked,
    }


def _second_wheel(told: Told) -> dict[str, Any]:
    return {"second_wheel": {told.name: _wheel(told, "2")}}


def _caster_swivel(told: Told) -> dict[str, Any]:
    """Return casters in the place of a table's feet; how they are turned at the start is left to chance, as of all.

    A wheel's radius is in nothing that was learned: it is a caster's usual one, with the lever that resists as much.
    """
    usual = CasterSettings()
    rubs = bool({"ground_friction", "breakaway_friction"} & set(told.effects)) or told.get("mu_ground") > 0.0
    wheels = [told.load(key) for key in ("", "2") if f"wheel{key}_x" in told.values]
    bears = max(1.0 - sum(wheels) / told.weight - (told.on_feet if rubs else 0.0), LEAST_BEARING)
    trail = told["caster_trail"]
    make = {
        "trail": trail,
        "radius": usual.radius,
        "rolling_resistance": told["caster_roll"] * usual.radius / bears,
        "swivel_friction": told["caster_scrub"] * trail * told.weight / CASTERS,
        "contact_width": told["caster_twist"] * 4.0 * trail / (usual.sliding_friction * bears),
    }
    if "caster_lay" in told.values:
        make["scrub_length"] = told["caster_lay"]
    return {"caster_swivel": {told.name: make}}


def _ground_friction(told: Told) -> dict[str, Any]:
    if "breakaway_friction" in told.effects:
        return {}
    return {"ground_friction": {told.name: {"friction": _sliding(told) / told.on_feet}}}


def _sliding(told: Told) -> float:
    return max(told.get("slide_mu") + told.get("mu_ground"), LEAST_SLIDING)


def _breakaway_friction(told: Told) -> dict[str, Any]:
    sliding = _sliding(told)
    static = sliding + told["breakaway_mu"]
    share = told.on_feet
    feet = {"static": static / share, "sliding": sliding / share, "speed": told["breakaway_speed"]}
    return {"breakaway_friction": {told.name: feet}}


def _viscous_drag(told: Told) -> dict[str, Any]:
    return {"viscous_drag": {told.name: {"damping": told["drag_linear"]}}}


def _floor_patch(told: Told) -> dict[str, Any]:
    x, y = told.place("patch")
    c, s = math.cos(told.get("patch_theta")), math.sin(told.get("patch_theta"))
    half = [(a * told["patch_length"], b * told["patch_width"]) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    corners = [[x + c * a - s * b, y + s * a + c * b] for a, b in half]
    own = told.get("slide_mu") + told.get("mu_ground")
    tile = {"polygon": corners, "friction": max(own + told["patch_mu"], 0.0) / told.on_feet}
    if "patch_roll" in told.values and "wheel_x" in told.values:
        tile["rolling_resistance"] = told["patch_roll"] * told.weight * WHEEL_RADIUS / told.load("")
    return {"floor_patch": [tile]}


def _floor_slope(told: Told) -> dict[str, Any]:
    x, y = told.place("slope")
    return {"floor_slope": {"angle": math.asin(min(math.hypot(x, y), 1.0)), "heading": math.atan2(y, x)}}


def _com_offset(told: Told) -> dict[str, Any]:
    corners = told.body.footprint
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle, off = 0.5 * (low + high), told.place("com")
    for share in BALLAST_SHARES:
        place = [float(middle[k]) + off[k] / share for k in range(2)]
        if all(low[k] <= place[k] <= high[k] for k in range(2)):
            return {"com_offset": {told.name: {"mass": share * told["mass"], "place": place}}}
    raise ValueError(f"com_offset: expected a centre of mass that ballast on the body can make, got {off} [m] off")


def _payload_change(told: Told) -> dict[str, Any]:
    mass = told["payload_mass"]
    gone = mass < 0.0 or told.get("payload_gone") > 0.0
    box = {"mass": abs(mass), "at": told["payload_time"], "place": told.place("payload"), "taken_off": gone}
    found: dict[str, Any] = {"payload_change": {told.name: box}}
    if mass < 0.0:  # what is taken off was part of the mass that the model has before
        found["mass"] = {told.name: told["mass"] + mass}
    return found


def _sloshing_load(told: Told) -> dict[str, Any]:
    length = GRAVITY / (2.0 * math.pi * told["slosh_frequency"]) ** 2
    load = {
        "mass": told["slosh_mass"],
        "place": [told.get("slosh_x"), told.get("slosh_y")],
        "length": length,
        "height": max(0.6, length + 0.1),
        "damping_ratio": min(told["slosh_damping"], 0.99),
    }
    return {"sloshing_load": {told.name: load}}


def _tether(told: Told) -> dict[str, Any]:
    below = 0.05  # the cord is level: tied under the top, hooked at that height
    cord = {
        "anchor": [*told.place("tether"), told.body.levels[1] - below],
        "point": [*told.place("tether_at"), -below],
        "slack_length": told["tether_length"],
        "stiffness": told["tether_stiffness"],
    }
    return {"tether": {told.name: cord}}


def _detent(told: Told) -> dict[str, Any]:
    magnets = {
        "place": told.place("detent"),
        "point": [told.get("detent_at_x"), told.get("detent_at_y")],
        "force": told["detent_force"],
        "gap": told["detent_width"] / peak_distance(1.0),
    }
    return {"detent": {told.name: magnets}}


def _hidden_hinge(told: Told) -> dict[str, Any]:
    assert not isinstance(told.body, Fixture)
    x, y, theta = told.body.pose
    dx, dy = told["pivot_x"] - x, told["pivot_y"] - y
    c, s = math.cos(theta), math.sin(theta)
    pin = {"point": [c * dx + s * dy, -s * dx + c * dy], "stiffness": told["pivot_stiffness"]}
    if "pivot_damping" in told.values:
        pin["damping_ratio"] = min(told["pivot_damping"], 0.99)
    return {"hidden_hinge": {told.name: pin}}


def _disc(told: Told, name: str) -> list[list[float]]:
    angles = [2.0 * math.pi * k / CORNERS for k in range(CORNERS)]
    radius = told[f"{name}_radius"]
    return [[radius * math.cos(angle), radius * math.sin(angle)] for angle in angles]


def _standing(told: Told, name: str) -> dict[str, Any]:
    """Return the outline of a thing on the floor, a disc or a square, and its pose."""
    half, angle = told[f"{name}_radius"], told.get(f"{name}_angle", DISC)
    square = [[half * x, half * y] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    outline, turn = (square, angle) if angle > DISC else (_disc(told, name), 0.0)
    return {"polygon": outline, "pose": [*told.place(name), turn]}


def _hidden_obstacle(told: Told) -> dict[str, Any]:
    return {"hidden_obstacle": [_standing(told, "obstacle")]}


def _unseen_body(told: Told) -> dict[str, Any]:
    tips = told["unseen_radius"] / float(UnseenBodySettings.model_fields["height"].default)
    friction = min(told.get("unseen_friction", CRATE_FRICTION), SLIDES * tips)
    mass = told["unseen_force"] / (friction * GRAVITY)
    return {"unseen_body": [{**_standing(told, "unseen"), "nominal_mass": mass, "friction": friction}]}


def _external_force(told: Told) -> dict[str, Any]:
    kind = "periodic" if "periodic_frequency" in told.values else "steady"
    if isinstance(told.body, Block):
        raise ValueError("external_force: expected a body with a top to push at, got a block")
    push: dict[str, Any] = {"force": told.place(kind)}
    if kind == "periodic":
        push |= {"period": 1.0 / told["periodic_frequency"], "phase": told["periodic_phase"]}
    for key in ("start", "end"):
        if f"force_{key}" in told.values:
            push[key] = told[f"force_{key}"]
    return {"external_force": {told.name: push}}


def _grasp_compliance(told: Told) -> dict[str, Any]:
    hold = {"stiffness": 1.0 / max(told["grip_compliance"], LEAST_GIVE), "play": max(told.get("grip_play"), 0.0)}
    return {"grasp_compliance": {told.name: hold}}


def _pose_bias(told: Told) -> dict[str, Any]:
    return {"pose_bias": {told.name: {"offset": told.place("tag"), "turn": told.get("tag_theta")}}}


MAKERS: Mapping[str, Maker] = {
    "second_wheel": _second_wheel,
    "ground_friction": _ground_friction,
    "breakaway_friction": _breakaway_friction,
    "viscous_drag": _viscous_drag,
    "floor_patch": _floor_patch,
    "floor_slope": _floor_slope,
    "com_offset": _com_offset,
    "payload_change": _payload_change,
    "sloshing_load": _sloshing_load,
    "tether": _tether,
    "detent": _detent,
    "hidden_hinge": _hidden_hinge,
    "hidden_obstacle": _hidden_obstacle,
    "unseen_body": _unseen_body,
    "external_force": _external_force,
    "grasp_compliance": _grasp_compliance,
    "pose_bias": _pose_bias,
    "caster_swivel": _caster_swivel,
    "wrench_bias": sensor_offset,
    "wrench_frame": sensor_frame,
    "time_offset": late_stream,
}
"""What can be made from numbers, by the effect's name."""
