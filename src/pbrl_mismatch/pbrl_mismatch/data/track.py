"""The episodes of one object laid end to end, with wrenches taken back to the sensors that felt them.

`pbrl_model.sensing` gives the wrench at the centre of mass in world axes. A fault of a sensor acts before that: its
axes turn with the gripper, and its force makes a moment by the lever from the sensor to the centre of mass. Here that
last step is undone, so that the kernel can do it again under every hypothesis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry, Recording
from pbrl_mismatch.data.missing import Missing
from pbrl_mismatch.errors import MismatchError
from pbrl_model.geometry import MassProperties, bounding_box, check_polygon
from pbrl_model.sensing.clock import smooth_gripper
from pbrl_model.sensing.motion import MARGIN, Motion, read_at_rest
from pbrl_model.transforms import yaw_matrices

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CLOSING, ROLLING = 1.0, 0.02
"""The first moments of a grasp [s] are left out where plates close on a body that moves faster than this [m/s]: they
stop it by a knock that is over before poses can tell."""
FEET_SHARE = 0.85
"""Where no casters are told, a body stands on the corners of its bounding box, shrunk by this."""


@dataclass(frozen=True)
class Track:
    """What was felt and seen of one object, in T steps.

    Attributes:
        object: its name.
        motions: the episodes.
        felt: (T, 3) planar wrench in the sensor's axes, at the sensor [N, N, N m].
        mount: (T, 5) cosine and sine of the sensor's turn; its place from the nominal centre of mass [m], world axes;
            how long ago it was read at rest [s].
        seen: (T, 6) smoothed states of the nominal centre of mass.
        clock: (T,) [s].
        begin: (E,) first step of each episode.
        last: (E,) last step of each episode.
        pivot: (E, 3) smoothed pose of the body's frame when the first episode began, for a pin holds one place in all.
        body: (4,) nominal inertia over mass [m^2], centre of mass (x, y) [m], dt [s].
        outline: (k, 2) footprint.
        feet: (F, 2) points that carry the load.
        nominal_mass: [kg], NaN where it was not told.
        missing: stretches that are not to be believed; no window holds any of them.
        unheard: so many more episodes were left out: under way when their force was first recorded.
        sensor: gripper whose sensor felt all of it, and the rotation (3, 3) from the sensor's axes to the body's when
            it first held on; None: several grippers, or one that was not seen.
    """

    object: str
    motions: tuple[Motion, ...]
    felt: Array
    mount: Array
    seen: Array
    clock: Array
    begin: Index
    last: Index
    pivot: Array
    body: Array
    outline: Array
    feet: Array
    nominal_mass: float
    missing: tuple[Missing, ...] = ()
    unheard: int = 0
    sensor: tuple[str, Array] | None = None

    @property
    def dt(self) -> float:
        """Return the step [s]."""
        return float(self.body[3])

    @property
    def seconds(self) -> float:
        """Return how long the object was held [s]."""
        return len(self.clock) * self.dt

    @property
    def oriented(self) -> bool:
        """Tell whether the orientation was observed."""
        return self.motions[0].oriented

    @property
    def gyration(self) -> float:
        """Return the radius of gyration [m], which turns a force scale into a torque scale."""
        return float(np.sqrt(self.body[0]))


def after_closing(motion: Motion) -> Motion:
    """Return an episode without its first moments if the body was not at rest, and it is long enough to spare them."""
    first = round(CLOSING / motion.dt)
    if float(np.hypot(*motion.state[0, 3:5])) < ROLLING or len(motion.wrench) < 5 * first:
        return motion
    kept = motion.pose_time >= motion.time[first]
    return replace(
        motion,
        time=motion.time[first:],
        wrench=motion.wrench[first:],
        pose_time=motion.pose_time[kept],
        pose=motion.pose[kept],
        state=motion.state[first:],
        covariance=motion.covariance[first:],
    )


def lay_track(
    recording: Recording, motions: Sequence[Motion], geometry: BodyGeometry, properties: MassProperties
) -> Track:
    """Lay episodes end to end.

    Args:
        recording: that the motions come from.
        motions: episodes of one object on one grid step.
        geometry: of the object.
        properties: its nominal centre of mass and inertia.

    Raises:
        MismatchError: there is no episode, or they differ in their grid step.
    """
    if not motions:
        raise MismatchError("track: expected at least one episode to diagnose, got none; record a push")
    dt = motions[0].dt
    if any(motion.dt != dt for motion in motions):
        raise MismatchError(f"track: expected episodes on one grid step, got {sorted({m.dt for m in motions})} s")
    first: dict[str, tuple[Array, float]] = {}
    parts = [_sensed(recording, motion, properties.com, first) for motion in motions]
    lengths = np.array([len(motion.wrench) for motion in motions])
    begin = np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64)
    seen = np.concatenate([motion.state[:-1] for motion in motions])
    return Track(
        object=motions[0].object,
        motions=tuple(motions),
        felt=np.concatenate([felt for felt, _ in parts]),
        mount=np.concatenate([mount for _, mount in parts]),
        seen=seen,
        clock=np.concatenate([motion.time[:-1] for motion in motions]),
        begin=begin,
        last=begin + lengths - 1,
        pivot=np.tile(origin_of(seen[0], properties.com), (len(begin), 1)),
        body=np.array([properties.inertia_per_mass, *properties.com, dt]),
        outline=np.ascontiguousarray(check_polygon(geometry.footprint)),
        feet=_feet(geometry),
        nominal_mass=geometry.nominal_mass,
        sensor=_only_sensor(motions, first),
    )


def _only_sensor(motions: Sequence[Motion], first: dict[str, tuple[Array, float]]) -> tuple[str, Array] | None:
    """Return the gripper that held alone, and its sensor's axes in those of the body when it began to."""
    grippers = {gripper for motion in motions for gripper in motion.grippers}
    if len(grippers) != 1 or not grippers <= set(first):
        return None
    (gripper,) = grippers
    rotation, heading = first[gripper]
    return gripper, yaw_matrices(np.array([-heading]))[0] @ rotation


def _feet(geometry: BodyGeometry) -> Array:
    """Return the points that carry the load: casters where they are told, else near the corners of the outline."""
    if len(geometry.casters) >= 3:
        return np.array(geometry.casters, dtype=float, order="C")  # one that is read-only would be compiled for anew
    lower, upper = bounding_box(geometry.footprint)
    middle, half = 0.5 * (lower + upper), 0.5 * FEET_SHARE * (upper - lower)
    return middle + half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def origin_of(state: Array, com: Array) -> Array:
    """Return the pose of the body's frame (3,) of a state of the centre of mass."""
    c, s = np.cos(state[2]), np.sin(state[2])
    return np.array([state[0] - c * com[0] + s * com[1], state[1] - s * com[0] - c * com[1], state[2]])


def _sensed(
    recording: Recording, motion: Motion, com: Array, first: dict[str, tuple[Array, float]]
) -> tuple[Array, Array]:
    """Return the wrench in the sensor's axes (T, 3) and how the sensor was mounted (T, 5).

    With two grippers there is one sensor in this model, half-way between the two: what acts on the body is the same,
    and a fault is then one that both share.
    """
    middle = 0.5 * (motion.time[1:] + motion.time[:-1])
    centre = 0.5 * (motion.state[1:] + motion.state[:-1])
    turns, places = [], []
    for gripper in motion.grippers:
        turn, place = _mounted(recording, motion, gripper, middle, centre, com, first)
        turns.append(turn)
        places.append(place)
    turn, arm = np.mean(turns, axis=0), np.mean(places, axis=0) - centre[:, :2]
    c, s = np.cos(turn), np.sin(turn)
    fx, fy = motion.wrench[:, 0], motion.wrench[:, 1]
    tau = motion.wrench[:, 2] - (arm[:, 0] * fy - arm[:, 1] * fx)
    start = float(motion.time[0])
    read = np.mean([read_at_rest(recording, gripper, motion.object, start) for gripper in motion.grippers])
    mount = np.column_stack([c, s, arm, motion.time[:-1] - read])
    return np.column_stack([c * fx + s * fy, -s * fx + c * fy, tau]), mount


def _mounted(
    recording: Recording,
    motion: Motion,
    gripper: str,
    middle: Array,
    centre: Array,
    com: Array,
    first: dict[str, tuple[Array, float]],
) -> tuple[Array, Array]:
    """Return turn (T,) [rad] and place (T, 2) [m] of one gripper's sensor.

    Its axes are those of the body when this gripper first held on; in later grasps they are turned as the gripper is
    against then, so that a fault of the sensor is the same in all. `first` keeps its rotation (3, 3), and that turn.
    """
    stream, pose = recording.wrenches[gripper], recording.gripper_poses.get(gripper)
    if pose is not None and stream.frame != "world":
        keep = (pose.time >= motion.time[0] - MARGIN) & (pose.time <= motion.time[-1] + MARGIN)
        cut = type(pose)(pose.time[keep], pose.position[keep], pose.quaternion[keep])
        rotation, position = smooth_gripper(cut, middle)
        began, turned = first.setdefault(gripper, (rotation[0], float(centre[0, 2])))
        relative = rotation @ began.T
        yaw = np.unwrap(np.arctan2(relative[:, 1, 0] - relative[:, 0, 1], relative[:, 0, 0] + relative[:, 1, 1]))
        return yaw + turned, position[:, :2]
    c, s = np.cos(centre[:, 2]), np.sin(centre[:, 2])
    held = [g for g in recording.grasps if g.gripper == gripper and g.object == motion.object]
    contact = min(held, key=lambda g: abs(g.start - motion.time[0])).contact - com
    place = centre[:, :2] + np.stack([c * contact[0] - s * contact[1], s * contact[0] + c * contact[1]], -1)
    world_axes = stream.frame == "world"
    return np.zeros(len(middle)) if world_axes else centre[:, 2], place
