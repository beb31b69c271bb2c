"""What is concealed, drawn at random: each effect anywhere between barely and strongly felt, placed where it acts.

Every function takes the stage, a source of randomness and a strength from 0 (about what an oracle just sees in the
noise) to 1 (strong), and returns the settings of a scene's `concealed` part. Places are chosen along the way that the
table takes if nothing is concealed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from pbrl_bringup.concealed.stage import NAME, Stage, draw_wheel

Array = NDArray[np.float64]
Draw = Callable[[np.random.Generator, Stage, float], dict[str, object]]

GRAVITY = 9.81
DRIFTING = 10.0
"""A drift is as large as a step after so long [s]."""
NEAR_AXLE = 0.01
"""Of a pin from a wheel's axle, as a standard deviation [m]."""
CRATE = 0.15
"""Half the side of an unseen crate [m]."""
POST = 0.05
"""Half the side of a hidden post [m]."""
FREE = 0.02
"""Between a hidden body and the table as it stands at the start [m]."""


def between(low: float, high: float, strength: float) -> float:
    """Return low at strength 0, high at 1, evenly in the logarithm between."""
    return float(low * (high / low) ** strength)


def caster_swivel(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw trailing casters in the place of ball feet."""
    trail = between(0.015, 0.05, strength)
    return {"caster_swivel": {NAME: {"trail": trail, "radius": float(rng.uniform(0.03, 0.045))}}}


def ground_friction(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw feet that slide with friction."""
    return {"ground_friction": {NAME: {"friction": between(0.01, 0.15, strength)}}}


def breakaway_friction(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw feet that stick: the excess at rest over sliding grows with the strength."""
    sliding = float(rng.uniform(0.02, 0.06))
    excess = between(0.02, 0.12, strength)
    return {
        "breakaway_friction": {
            NAME: {"static": sliding + excess, "sliding": sliding, "speed": float(rng.uniform(0.01, 0.03))}
        }
    }


def viscous_drag(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw films under the feet."""
    return {"viscous_drag": {NAME: {"damping": between(12.0, 120.0, strength)}}}


def second_wheel(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw another wheel, or a locked one."""
    place = (rng.uniform(-0.85, 0.85, 2) * stage.half).tolist()
    load = between(0.03, 0.35, strength) * stage.mass * GRAVITY
    told = {"position": place, "heading": float(rng.uniform(-1.5, 1.5)), "load": max(load, 5.0)}
    second: dict[str, object] = {"second_wheel": {NAME: {**told, "locked": bool(rng.random() < 0.4)}}}
    known: dict[str, object] = stage.scene["concealed"]  # type: ignore[assignment]
    if "wheel" in known:
        return second
    # A table of the baseline class may have one wheel: a lone one is nothing that was left out.
    return {**second, "wheel": {NAME: draw_wheel(rng, stage.half, stage.mass)}}


def com_offset(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw ballast off the middle."""
    angle = rng.uniform(0.0, 2.0 * math.pi)
    place = 0.75 * stage.half * np.array([math.cos(angle), math.sin(angle)])
    return {"com_offset": {NAME: {"mass": between(0.06, 0.45, strength) * stage.mass, "place": place.tolist()}}}


def payload_change(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a box that is put on or taken off in mid-push."""
    told = {"mass": between(0.12, 0.8, strength) * stage.mass, "at": _moment(rng, stage, 0.3, 0.7)}
    place = (rng.uniform(-0.2, 0.2, 2) * stage.half).tolist()
    return {"payload_change": {NAME: {**told, "place": place, "taken_off": bool(rng.random() < 0.5)}}}


def sloshing_load(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a load that swings."""
    told = {"mass": between(0.08, 0.5, strength) * stage.mass, "length": float(rng.uniform(0.15, 0.45))}
    return {"sloshing_load": {NAME: {**told, "place": (rng.uniform(-0.3, 0.3, 2) * stage.half).tolist()}}}


def tether(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a cord that becomes taut on the way."""
    point = rng.uniform(-0.9, 0.9, 2) * stage.half
    way = _points(stage, point)
    angle = rng.uniform(0.0, 2.0 * math.pi)
    anchor = way[0] + rng.uniform(0.6, 1.4) * np.array([math.cos(angle), math.sin(angle)])
    away = np.hypot(*(way - anchor).T)
    slack = float(np.quantile(away, rng.uniform(0.3, 0.6)))
    height = float(stage.table.get("height", 0.7775)) - 0.05  # type: ignore[arg-type]
    stretch = max(float(away.max()) - slack, 0.02)
    stiffness = min(between(3.0, 30.0, strength) / stretch, 400.0)
    told = {"anchor": [*anchor.tolist(), height], "point": [*point.tolist(), -0.05]}
    return {"tether": {NAME: {**told, "slack_length": slack, "stiffness": stiffness}}}


def detent(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a magnetic catch that the table passes."""
    point = rng.uniform(-0.8, 0.8, 2) * stage.half
    place = _points(stage, point)[_sample(rng, stage, 0.25, 0.75)]
    told = {"place": place.tolist(), "point": point.tolist(), "gap": float(rng.uniform(0.03, 0.06))}
    return {"detent": {NAME: {**told, "force": between(4.0, 35.0, strength)}}}


def hidden_hinge(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a pin through the table; the stronger the effect, the softer its bushing, and the more it gives.

    A pin that gives nothing is a locked caster that no hand makes slide, and that is of the baseline class. A table
    with a wheel turns about a pin on the wheel's axle and no other: elsewhere it would stand still.
    """
    point = rng.uniform(-0.85, 0.85, 2) * stage.half
    known: dict[str, dict[str, dict[str, Any]]] = stage.scene["concealed"]  # type: ignore[assignment]
    if "wheel" in known:
        wheel = known["wheel"][NAME]
        axle = np.array([-math.sin(wheel["heading"]), math.cos(wheel["heading"])])
        point = wheel["position"] + axle * ((point - wheel["position"]) @ axle) + rng.normal(0.0, NEAR_AXLE, 2)
        point = np.clip(point, -0.9 * stage.half, 0.9 * stage.half)
    return {"hidden_hinge": {NAME: {"point": point.tolist(), "stiffness": between(3000.0, 300.0, strength)}}}


def floor_patch(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a carpet: a rotated rectangle into which feet come on the way."""
    feet = np.array([[x, y] for x in (-1, 1) for y in (-1, 1)]) * (stage.half - 0.06)
    places = np.concatenate([_points(stage, foot)[:: max(1, len(stage.track.time) // 200)] for foot in feet])
    centre = places[rng.integers(len(places))]
    extent, turn = rng.uniform(0.35, 0.8, 2) / 2.0, rng.uniform(0.0, math.pi)
    corners = extent * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    c, s = math.cos(turn), math.sin(turn)
    outline = centre + corners @ np.array([[c, s], [-s, c]])
    return {"floor_patch": [{"polygon": outline.tolist(), "friction": between(0.05, 0.4, strength)}]}


def floor_slope(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a tilted floor."""
    return {"floor_slope": {"angle": between(0.002, 0.03, strength), "heading": float(rng.uniform(-3.1, 3.1))}}


def hidden_obstacle(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a post into which the table runs; the stronger, the deeper its way would lead into it."""
    polygon = _in_the_way(rng, stage, POST, between(0.01, 0.08, strength))
    return {"hidden_obstacle": [{"polygon": polygon}]}


def unseen_body(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a crate that the table meets and pushes on: so smooth below that it slides before it tips."""
    polygon = np.array(_in_the_way(rng, stage, CRATE, 0.1))
    middle = polygon.mean(axis=0)
    tips = CRATE / float(stage.table.get("height", 0.7775))  # type: ignore[arg-type]
    mass, friction = between(5.0, 30.0, strength), float(rng.uniform(0.4, 0.9)) * tips
    told = {"polygon": (polygon - middle).tolist(), "pose": [*middle.tolist(), 0.0]}
    return {"unseen_body": [{**told, "nominal_mass": mass, "friction": friction}]}


def external_force(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a push that is steady for part of the time, or periodic; one that is always there is a slope."""
    angle, size = rng.uniform(-math.pi, math.pi), between(1.0, 12.0, strength)
    told: dict[str, object] = {"force": [size * math.cos(angle), size * math.sin(angle)]}
    if rng.random() < 0.5:
        told["period"] = float(rng.uniform(1.0, 4.0))
    if "period" not in told or rng.random() < 0.5:
        told["start"] = _moment(rng, stage, 0.1, 0.4)
        told["end"] = _moment(rng, stage, 0.6, 0.9)
    return {"external_force": {NAME: told}}


def grasp_compliance(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw worn rubber with play."""
    told = {"stiffness": between(3000.0, 400.0, strength), "play": between(0.002, 0.02, strength)}
    return {"grasp_compliance": {NAME: told}}


def wrench_bias(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw an offset that comes after the sensor was read at rest, at once or little by little."""
    angle, size = rng.uniform(-math.pi, math.pi), between(0.8, 8.0, strength)
    force = [size * math.cos(angle), size * math.sin(angle), 0.0]
    torque = [0.0, 0.0, float(rng.normal() * 0.1 * size)]
    if rng.random() < 0.5:
        start = _moment(rng, stage, 0.02, 0.6)
        return {"wrench_bias": {"left": {"force": force, "torque": torque, "start": start, "rise": 0.3}}}
    drift, turn = [part / DRIFTING for part in force], [part / DRIFTING for part in torque]
    return {"wrench_bias": {"left": {"force_drift": drift, "torque_drift": turn, "start": _first(stage)}}}


def wrench_frame(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a sensor that is turned about its axis, scaled, or both."""
    kind = int(rng.integers(3))
    turn = float(rng.choice([-1, 1])) * between(0.08, 0.5, strength) if kind != 1 else 0.0
    scale = between(1.15, 1.8, strength) if kind != 0 else 1.0
    scale = scale if rng.random() < 0.5 else 1.0 / scale
    return {"wrench_frame": {"left": {"scale": scale, "turn": [0.0, 0.0, turn]}}}


def time_offset(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a stream that is late."""
    which = [NAME, "left"][int(rng.integers(2))]
    return {"time_offset": {which: {"delay": between(0.03, 0.3, strength)}}}


def pose_bias(rng: np.random.Generator, stage: Stage, strength: float) -> dict[str, object]:
    """Draw a tag that is glued on off its place."""
    angle, size = rng.uniform(-math.pi, math.pi), between(0.02, 0.15, strength)
    told = {"offset": [size * math.cos(angle), size * math.sin(angle)], "turn": float(rng.normal() * 0.05)}
    return {"pose_bias": {NAME: told}}


DRAWS: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        second_wheel,
        caster_swivel,
        ground_friction,
        breakaway_friction,
        viscous_drag,
        floor_patch,
        floor_slope,
        com_offset,
        payload_change,
        sloshing_load,
        tether,
        detent,
        hidden_hinge,
        hidden_obstacle,
        unseen_body,
        external_force,
        grasp_compliance,
        wrench_bias,
        wrench_frame,
        time_offset,
        pose_bias,
    )
}


def _first(stage: Stage) -> float:
    """Return when the table first moves [s]."""
    return float(stage.track.time[stage.moving()[0]])


def _sample(rng: np.random.Generator, stage: Stage, low: float, high: float) -> int:
    """Return a sample of the track at which the table moves, some way through."""
    moving = stage.moving()
    return int(moving[int(rng.uniform(low, high) * (len(moving) - 1))])


def _moment(rng: np.random.Generator, stage: Stage, low: float, high: float) -> float:
    return float(stage.track.time[_sample(rng, stage, low, high)])


def _points(stage: Stage, point: Array) -> Array:
    """Return (n, 2) where a point (2,) of the table is along the track [m]."""
    x, y, theta = stage.track.pose.T
    c, s = np.cos(theta), np.sin(theta)
    return np.stack([x + c * point[0] - s * point[1], y + s * point[0] + c * point[1]], axis=1)


def _outline(stage: Stage, sample: int) -> Polygon:
    corners = stage.half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return Polygon(np.stack([_points(stage, corner)[sample] for corner in corners]))


def _in_the_way(rng: np.random.Generator, stage: Stage, size: float, depth: float) -> list[list[float]]:
    """Return a square (4, 2) that the table's outline enters by `depth` [m] somewhere on its way, clear at the start.

    Corners that lead are tried, latest reach first; the square lies beyond the outline's start.
    """
    start = _outline(stage, 0).buffer(FREE)
    corners = stage.half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for _ in range(200):
        corner = corners[rng.integers(4)]
        way = _points(stage, corner)
        sample = _sample(rng, stage, 0.2, 0.95)
        step = way[sample] - way[max(0, sample - 20)]
        if np.hypot(*step) < 1e-3:
            continue
        ahead = step / np.hypot(*step)
        middle = way[sample] + (size - depth) * ahead
        square = Polygon(middle + size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))
        before = max(0, sample - 60)
        clear = not square.intersects(start) and not square.intersects(_outline(stage, before))
        if clear and square.intersects(_outline(stage, sample)):
            return [list(map(float, place)) for place in list(square.exterior.coords)[:4]]
    far = _points(stage, corners[2]).max(axis=0) + 0.3
    return (far + size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])).tolist()
