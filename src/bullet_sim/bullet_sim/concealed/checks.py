"""Whether what a scene conceals fits what stands in it; faults as one line, by key."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from shapely.geometry import Point, Polygon

from bullet_sim.catalogue import Body, Fixture, OnCasters, PlainTable
from bullet_sim.client import GRAVITY
from bullet_sim.concealed.options import GRIPPERS, SENSOR_EFFECTS, Concealed
from bullet_sim.errors import nearest
from bullet_sim.placing import placed_footprint

ON_LEGS = (
    "wheel",
    "second_wheel",
    "ground_friction",
    "breakaway_friction",
    "com_offset",
    "sloshing_load",
)
"""What is built into a body that has legs."""

MOST_LOAD = 0.8
"""Share of a body's weight that wheels and glides on springs may carry; the rest stays on its feet."""

MOST_INSIDE = 0.6
"""Share of a body's mass that may be ballast or load."""


def check_concealed(concealed: Concealed, bodies: Mapping[str, Body]) -> None:
    """Check names, kinds and weights.

    Raises:
        ValueError: the first fault, one line with its key.
    """
    for effect in type(concealed).model_fields:
        told = getattr(concealed, effect)
        for name in told if isinstance(told, dict) else ():
            _check_name(effect, name, bodies)
    for effect in ("locked_casters", "fixed_wheels"):
        for name, casters in getattr(concealed, effect).items():
            swivels = _on_casters(bodies, name, effect).swivels
            for caster in casters:
                if caster not in swivels:
                    raise ValueError(f"concealed.{effect}.{name}: no caster {caster!r}; {nearest(caster, swivels)}")
    for name in concealed.rolling_resistance:
        _on_casters(bodies, name, "rolling_resistance")
    for effect in ON_LEGS:
        for name in getattr(concealed, effect):
            if not isinstance(bodies[name], OnCasters | PlainTable):
                raise ValueError(f"concealed.{effect}.{name}: expected a body with legs, got a {bodies[name].kind}")
    for name in concealed.caster_swivel:
        if not isinstance(bodies[name], PlainTable):
            kind = bodies[name].kind
            raise ValueError(f"concealed.caster_swivel.{name}: expected a plain_table, got a {kind}; see its casters")
    for name, body in bodies.items():
        _check_weights(concealed, name, body)
        _check_places(concealed, name, body)
    _check_hidden(concealed, bodies)


def _check_name(effect: str, name: str, bodies: Mapping[str, Body]) -> None:
    """Raise ValueError where a key names nothing, or something that cannot be moved."""
    tags = [f"{side}_gripper" for side in GRIPPERS]
    known: Collection[str] = bodies
    if effect in SENSOR_EFFECTS:
        known = {
            "wrench_bias": GRIPPERS,
            "wrench_frame": GRIPPERS,
            "time_offset": [*GRIPPERS, *tags, *bodies],
            "pose_bias": [*tags, *bodies],
        }[effect]
    if name not in known:
        what = "gripper, tag or body" if effect in SENSOR_EFFECTS else "body"
        raise ValueError(f"concealed.{effect}: no {what} {name!r} in this scene; {nearest(name, known)}")
    if isinstance(bodies.get(name), Fixture) and effect not in ("locked_casters", "fixed_wheels", "rolling_resistance"):
        raise ValueError(f"concealed.{effect}.{name}: expected a body that can move, got a fixture")


def _on_casters(bodies: Mapping[str, Body], name: str, effect: str) -> OnCasters:
    body = bodies[name]
    if not isinstance(body, OnCasters):
        raise ValueError(f"concealed.{effect}.{name}: expected a body on casters, got a {body.kind}")
    return body


def _check_weights(concealed: Concealed, name: str, body: Body) -> None:
    """Raise ValueError where struts lift a body off its feet, or its loads weigh more than it."""
    if isinstance(body, Fixture):
        return
    mass = concealed.mass.get(name, body.nominal_mass)
    wheels = [told[name].load for told in (concealed.wheel, concealed.second_wheel) if name in told]
    most = MOST_LOAD * mass * GRAVITY
    if sum(wheels) > most:
        key = "second_wheel" if name in concealed.second_wheel else "wheel"
        raise ValueError(
            f"concealed.{key}.{name}.load: expected at most {most:.0f} N on its wheels (0.8 of its weight), "
            f"got {sum(wheels):.0f} N"
        )
    for key in ("com_offset", "sloshing_load"):
        told = getattr(concealed, key).get(name)
        if told is not None and told.mass > MOST_INSIDE * mass:
            raise ValueError(
                f"concealed.{key}.{name}.mass: expected at most {MOST_INSIDE * mass:.1f} kg (0.6 of the body's), "
                f"got {told.mass:g} kg"
            )


def _check_places(concealed: Concealed, name: str, body: Body) -> None:
    """Raise ValueError where something that belongs to a body is not within its outline."""
    outline = Polygon(body.footprint).buffer(1e-6)
    for key, field in (
        ("wheel", "position"),
        ("second_wheel", "position"),
        ("com_offset", "place"),
        ("sloshing_load", "place"),
        ("payload_change", "place"),
        ("tether", "point"),
        ("detent", "point"),
        ("hidden_hinge", "point"),
        ("external_force", "point"),
    ):
        told = getattr(concealed, key).get(name)
        place = None if told is None else getattr(told, field)[:2]
        if place is not None and not outline.covers(Point(place)):
            raise ValueError(f"concealed.{key}.{name}.{field}: expected a place on the body, got {list(place)}")


def _check_hidden(concealed: Concealed, bodies: Mapping[str, Body]) -> None:
    """Raise ValueError where something hidden stands in a body at the start."""
    for key in ("hidden_obstacle", "unseen_body"):
        for number, hidden in enumerate(getattr(concealed, key)):
            shape = placed_footprint(hidden)
            for name, body in bodies.items():
                meet = max(body.levels[0], hidden.levels[0]) < min(body.levels[1], hidden.levels[1])
                if meet and shape.intersection(placed_footprint(body)).area > 1e-6:
                    raise ValueError(f"concealed.{key}.{number}: expected a place of its own, it overlaps {name}")
