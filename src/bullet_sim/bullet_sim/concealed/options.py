"""The `concealed` part of a scene: what is true and not told, one key an effect."""

from __future__ import annotations

from pydantic import Field

from bullet_sim.concealed.caster_swivel import CasterSwivelSettings
from bullet_sim.concealed.com_offset import ComOffsetSettings
from bullet_sim.concealed.detent import DetentSettings
from bullet_sim.concealed.external_force import ExternalForceSettings
from bullet_sim.concealed.floor_patch import FloorPatchSettings
from bullet_sim.concealed.floor_slope import FloorSlopeSettings
from bullet_sim.concealed.foot_friction import BreakawayFrictionSettings, GroundFrictionSettings
from bullet_sim.concealed.grasp_compliance import GraspComplianceSettings
from bullet_sim.concealed.hidden_bodies import HiddenObstacleSettings, UnseenBodySettings
from bullet_sim.concealed.hidden_hinge import HiddenHingeSettings
from bullet_sim.concealed.payload_change import PayloadChangeSettings
from bullet_sim.concealed.second_wheel import FixedWheelSettings
from bullet_sim.concealed.sensor_faults import (
    PoseBiasSettings,
    TimeOffsetSettings,
    WrenchBiasSettings,
    WrenchFrameSettings,
)
from bullet_sim.concealed.sloshing_load import SloshingLoadSettings
from bullet_sim.concealed.tether import TetherSettings
from bullet_sim.concealed.viscous_drag import ViscousDragSettings
from bullet_sim.settings import NonNegative, Positive, Settings


class Concealed(Settings):
    """What is true and not told; never on a topic, never in a recording.

    One key an effect, each by body name unless it says otherwise. The first five are no effects: they change what a
    body is within its own class.

    Attributes:
        locked_casters: names of the casters whose wheel and swivel are both braked.
        fixed_wheels: names of the casters that do not swivel: their wheels roll along the body's x alone.
        mass: true mass [kg] where it is not the nominal one.
        rolling_resistance: true lever f [m] of all casters of a body where it is not its `casters`' one.
        wheel: the one wheel that a body of the model's own class may have.
        second_wheel: one more.
        caster_swivel: casters in the place of a plain table's feet.
        ground_friction: feet that slide with friction.
        breakaway_friction: feet that stick.
        viscous_drag: films under the feet.
        floor_patch: tiles of the floor, a list.
        floor_slope: the tilt of the room.
        com_offset: ballast.
        payload_change: a box that is put on or taken off.
        sloshing_load: a load that swings or slides.
        tether: a cord to a hook.
        detent: a magnetic catch.
        hidden_hinge: a pin.
        hidden_obstacle: fixed bodies, a list.
        unseen_body: movable bodies, a list.
        external_force: a push from outside.
        grasp_compliance: how softly it is held.
        wrench_bias: offset and drift of a force sensor, by gripper.
        wrench_frame: scale and turn of a force sensor, by gripper.
        time_offset: delay of a stream: by gripper for its force sensor, by body or `<gripper>_gripper` for a tag.
        pose_bias: where a tag really is, by body or `<gripper>_gripper`.
    """

    locked_casters: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    fixed_wheels: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    mass: dict[str, Positive] = Field(default_factory=dict)
    rolling_resistance: dict[str, NonNegative] = Field(default_factory=dict)
    wheel: dict[str, FixedWheelSettings] = Field(default_factory=dict)
    second_wheel: dict[str, FixedWheelSettings] = Field(default_factory=dict)
    caster_swivel: dict[str, CasterSwivelSettings] = Field(default_factory=dict)
    ground_friction: dict[str, GroundFrictionSettings] = Field(default_factory=dict)
    breakaway_friction: dict[str, BreakawayFrictionSettings] = Field(default_factory=dict)
    viscous_drag: dict[str, ViscousDragSettings] = Field(default_factory=dict)
    floor_patch: tuple[FloorPatchSettings, ...] = ()
    floor_slope: FloorSlopeSettings | None = None
    com_offset: dict[str, ComOffsetSettings] = Field(default_factory=dict)
    payload_change: dict[str, PayloadChangeSettings] = Field(default_factory=dict)
    sloshing_load: dict[str, SloshingLoadSettings] = Field(default_factory=dict)
    tether: dict[str, TetherSettings] = Field(default_factory=dict)
    detent: dict[str, DetentSettings] = Field(default_factory=dict)
    hidden_hinge: dict[str, HiddenHingeSettings] = Field(default_factory=dict)
    hidden_obstacle: tuple[HiddenObstacleSettings, ...] = ()
    unseen_body: tuple[UnseenBodySettings, ...] = ()
    external_force: dict[str, ExternalForceSettings] = Field(default_factory=dict)
    grasp_compliance: dict[str, GraspComplianceSettings] = Field(default_factory=dict)
    wrench_bias: dict[str, WrenchBiasSettings] = Field(default_factory=dict)
    wrench_frame: dict[str, WrenchFrameSettings] = Field(default_factory=dict)
    time_offset: dict[str, TimeOffsetSettings] = Field(default_factory=dict)
    pose_bias: dict[str, PoseBiasSettings] = Field(default_factory=dict)


WITHIN_CLASS = ("locked_casters", "fixed_wheels", "mass", "rolling_resistance", "wheel")
"""Keys that are no effects."""

EFFECTS = tuple(key for key in Concealed.model_fields if key not in WITHIN_CLASS)
"""Names of the effects, as design and reports have them."""

SENSOR_EFFECTS = ("wrench_bias", "wrench_frame", "time_offset", "pose_bias")
"""Effects that are named after grippers, streams and tags."""

GRIPPERS = ("left", "right")
"""Names of grippers."""
