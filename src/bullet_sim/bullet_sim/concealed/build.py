"""From the `concealed` part of a scene to what acts in Bullet."""

from __future__ import annotations

from collections.abc import Mapping

from bullet_sim.catalogue import Body, Fixture, OnCasters, PlainTable
from bullet_sim.client import GRAVITY, BulletClient
from bullet_sim.concealed.caster_swivel import CasterSwivel
from bullet_sim.concealed.com_offset import Ballast, ComOffset
from bullet_sim.concealed.detent import Detent
from bullet_sim.concealed.effect import Effect
from bullet_sim.concealed.external_force import ExternalForce
from bullet_sim.concealed.floor_patch import FloorPatch
from bullet_sim.concealed.floor_slope import FloorSlope
from bullet_sim.concealed.foot_friction import BreakawayFriction, GroundFriction, glides
from bullet_sim.concealed.grasp_compliance import GraspCompliance
from bullet_sim.concealed.hidden_bodies import HiddenObstacle, UnseenBody
from bullet_sim.concealed.hidden_hinge import HiddenHinge
from bullet_sim.concealed.options import SENSOR_EFFECTS, Concealed
from bullet_sim.concealed.payload_change import PayloadChange
from bullet_sim.concealed.second_wheel import FixedWheel, wheel_strut
from bullet_sim.concealed.sensor_faults import SensorFault
from bullet_sim.concealed.sloshing_load import SlidingLoad, SloshingLoad, SwingingLoad, sloshing_load
from bullet_sim.concealed.tether import Tether
from bullet_sim.concealed.viscous_drag import ViscousDrag
from bullet_sim.feet import Feet, Foot
from bullet_sim.fittings import Fitting, Strut
from bullet_sim.furniture import Furniture

Fitted = Mapping[str, list[Fitting]]
"""What is built into one body, by the effect that asked for it."""


def fittings_of(name: str, body: Body, concealed: Concealed) -> dict[str, list[Fitting]]:
    """Make what is built into a body: wheels, glides, ballast, loads."""
    fitted: dict[str, list[Fitting]] = {}
    if name in concealed.wheel:
        fitted["wheel"] = [wheel_strut(concealed.wheel[name])]
    if name in concealed.second_wheel:
        fitted["second_wheel"] = [wheel_strut(concealed.second_wheel[name])]
    if name in concealed.com_offset:
        fitted["com_offset"] = [Ballast(concealed.com_offset[name])]
    if name in concealed.sloshing_load:
        fitted["sloshing_load"] = [sloshing_load(concealed.sloshing_load[name])]
    rough = [told[name] for told in (concealed.ground_friction, concealed.breakaway_friction) if name in told]
    own_feet = isinstance(body, PlainTable) and name not in concealed.caster_swivel
    if rough and not own_feet and isinstance(body, OnCasters | PlainTable):
        weight = concealed.mass.get(name, body.nominal_mass) * GRAVITY
        fitted["glides"] = [*glides(_places(body), weight, max(settings.load_share for settings in rough))]
    return fitted


def _places(body: Body) -> list[tuple[float, float]]:
    """Give where a body bears on the floor (n, 2) [m], body's frame."""
    if isinstance(body, OnCasters):
        return list(body.swivels.values())
    if isinstance(body, PlainTable):
        return list(body.feet.values())
    return [(float(x), float(y)) for x, y in body.footprint]


def _mass(body: Furniture, concealed: Concealed) -> float:
    """Give the true mass of a body that can move [kg]."""
    assert not isinstance(body.settings, Fixture)  # the scene's checks leave none
    return concealed.mass.get(body.name, body.settings.nominal_mass)


def let_down_glides(client: BulletClient, body: Furniture, fitted: Fitted) -> None:
    """Make the tips of a body's glides the feet on which it slides."""
    tips = [Foot(glide.tip, glide.place) for glide in fitted.get("glides", []) if isinstance(glide, Strut)]
    if tips:
        body.feet = Feet(client, body.name, tips, body.motion())


def effects_of(
    client: BulletClient, furniture: Mapping[str, Furniture], fitted: Mapping[str, Fitted], concealed: Concealed
) -> list[Effect]:
    """Put what is concealed into a room that is furnished already.

    Args:
        client: the world.
        furniture: the bodies by name.
        fitted: what is built into each of them.
        concealed: what to put in.

    Returns:
        The effects, in the order in which they act.
    """
    effects: list[Effect] = []
    for name, body in furniture.items():
        effects += _built_in(client, body, fitted.get(name, {}), concealed)
        effects += _around(client, body, concealed)
    # Tiles decide over the feet's friction after everything else.
    bodies, tiles = list(furniture.values()), list[FloorPatch]()
    effects += [FloorPatch(client, bodies, patch, str(n), tiles) for n, patch in enumerate(concealed.floor_patch)]
    effects += [HiddenObstacle(client, furniture, body, str(n)) for n, body in enumerate(concealed.hidden_obstacle)]
    effects += [UnseenBody(client, furniture, body, str(n)) for n, body in enumerate(concealed.unseen_body)]
    if concealed.floor_slope is not None:
        effects.append(FloorSlope(client, concealed.floor_slope))
    for name in SENSOR_EFFECTS:
        effects += [SensorFault(name, target, told) for target, told in getattr(concealed, name).items()]
    return effects


def _built_in(client: BulletClient, body: Furniture, fitted: Fitted, concealed: Concealed) -> list[Effect]:
    """Give the effects of what is part of a body."""
    name, effects = body.name, list[Effect]()
    for strut in fitted.get("second_wheel", []):
        if isinstance(strut, Strut):
            effects.append(FixedWheel(body, strut))
    if name in concealed.caster_swivel and body.casters is not None:
        effects.append(CasterSwivel(body, body.casters))
    if body.feet is not None and name in concealed.ground_friction:
        effects.append(GroundFriction(body, body.feet, concealed.ground_friction[name]))
    if body.feet is not None and name in concealed.breakaway_friction:
        effects.append(BreakawayFriction(body, body.feet, concealed.breakaway_friction[name]))
    if name in concealed.com_offset:
        effects.append(ComOffset(body, concealed.com_offset[name], _mass(body, concealed)))
    for load in fitted.get("sloshing_load", []):
        if isinstance(load, SlidingLoad | SwingingLoad):
            effects.append(SloshingLoad(body, load))
    return effects


def _around(client: BulletClient, body: Furniture, concealed: Concealed) -> list[Effect]:
    """Give the effects of what acts on a body from outside."""
    name, effects = body.name, list[Effect]()
    if name in concealed.viscous_drag:
        effects.append(ViscousDrag(client, body, _places(body.settings), concealed.viscous_drag[name]))
    if name in concealed.payload_change:
        effects.append(PayloadChange(client, body, concealed.payload_change[name]))
    if name in concealed.tether:
        effects.append(Tether(client, body, concealed.tether[name]))
    if name in concealed.detent:
        effects.append(Detent(client, body, concealed.detent[name]))
    if name in concealed.hidden_hinge:
        effects.append(HiddenHinge(client, body, concealed.hidden_hinge[name], _mass(body, concealed)))
    if name in concealed.external_force:
        effects.append(ExternalForce(client, body, concealed.external_force[name]))
    if name in concealed.grasp_compliance:
        effects.append(GraspCompliance(body, concealed.grasp_compliance[name]))
    return effects
