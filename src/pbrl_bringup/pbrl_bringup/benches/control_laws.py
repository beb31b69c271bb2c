"""What the body controller is held to without a simulator: Jacobians, limits, its tick, steering over long paths."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.paths import config_file, workspace
from pbrl_control.body_jacobian import body_jacobian
from pbrl_control.controller import BodyController
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.planar import compose, inverse, rotation, shift, turn, wrap
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_control.types import BodyCommand, BodyState, Hold, PlanarTwist

Array = NDArray[np.float64]

STEP = 1e-6
"""Of finite differences [rad, m]."""
PERIOD = 0.005
"""Of the controller [s]."""
QUIET = {side: np.zeros(6) for side in SIDES}
LEVER = 0.4
"""From the contact to the object's origin [m]."""


def robot() -> tuple[RobotKinematics, ControllerSettings]:
    """Return the robot's kinematics and the settings that are installed."""
    settings = load_section(config_file("params", "body_controller"), ControllerSettings, "settings")
    return RobotKinematics.from_file(workspace() / "urdf/krang/krang.urdf"), settings


def jacobian_error(rng: np.random.Generator, count: int) -> float:
    """Return the largest difference of analytic Jacobians to central differences over random postures [m, rad]."""
    kinematics, _ = robot()
    worst = 0.0
    for _ in range(count):
        posture = _random_posture(rng, kinematics)
        for side in SIDES:
            worst = max(worst, _gripper_error(kinematics, posture, side))
        worst = max(worst, _body_error(rng.uniform(-1.5, 1.5, 3), rng.uniform(-0.8, 0.8, 2)))
    return worst


def _random_posture(rng: np.random.Generator, kinematics: RobotKinematics) -> Posture:
    arms = [rng.uniform(kinematics.limits(side).lower, kinematics.limits(side).upper) for side in SIDES]
    return Posture(rng.uniform(0.3, 2.8), rng.uniform(-0.7, 0.7), *arms)


def _gripper_error(kinematics: RobotKinematics, posture: Posture, side: str) -> float:
    gripper = kinematics.grippers(posture)[side]
    worst = 0.0
    for joint in range(7):
        ends = []
        for sign in (1.0, -1.0):
            change = np.zeros(7)
            change[joint] = sign * STEP
            ends.append(kinematics.grippers(_moved(posture, {side: change}))[side])
        middles = [np.array([*end.planar[:2], end.height]) for end in ends]
        linear = (middles[0] - middles[1]) / (2.0 * STEP)
        turned = (ends[0].pose.rotation - ends[1].pose.rotation) @ gripper.pose.rotation.T / (2.0 * STEP)
        angular = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) / 2
        column = np.concatenate((linear, angular))
        worst = max(worst, float(np.abs(gripper.jacobian[:, joint] - column).max()))
    return worst


def _body_error(pose: Array, contact: Array) -> float:
    """Return the error of equation 42 for one gripper that holds at a contact."""
    jacobian = body_jacobian(pose[None], contact[None])
    worst = 0.0
    for column in range(5):
        ends = []
        for sign in (1.0, -1.0):
            rate = np.zeros(5)
            rate[column] = sign * STEP
            grip = compose(pose, np.array([*contact, 0.0])) + rate[2:]
            held = compose(grip, inverse(np.array([*contact, 0.0])))
            ends.append(compose(np.array([rate[0], 0.0, rate[1]]), held))
        change = (ends[0] - ends[1]) / (2.0 * STEP)
        change[2] = wrap(float(ends[0][2] - ends[1][2])) / (2.0 * STEP)
        worst = max(worst, float(np.abs(jacobian[:, column] - turn(change, -pose[2])).max()))
    return worst


def tick_times(count: int, method: str) -> list[float]:
    """Return how long each tick took [s], two arms holding one thing and forces felt."""
    kinematics, settings = robot()
    controller = BodyController(kinematics, settings.model_copy(update={"method": method}))
    posture = _nominal(settings)
    holds = {side: Hold("table", np.array([-LEVER, sign * 0.16])) for side, sign in zip(SIDES, (1, -1), strict=True)}
    rng, times = np.random.default_rng(0), []
    for _ in range(count):
        wrenches = {side: 5.0 * rng.standard_normal(6) for side in SIDES}
        twist = PlanarTwist(*map(float, 0.1 * rng.standard_normal(3)))
        started = time.perf_counter()
        controller.tick(BodyState(posture), {"table": twist}, holds, wrenches, PERIOD)
        times.append(time.perf_counter() - started)
    return times[count // 10 :]


def _nominal(settings: ControllerSettings) -> Posture:
    nominal = np.array(settings.nominal)
    return Posture(2.732, 0.0, nominal, -nominal)


def limit_excess(rng: np.random.Generator, seconds: float) -> dict[str, float]:
    """Return by how much any limit was exceeded in a time of random, broken and late commands; zero: never.

    Args:
        rng: of the commands.
        seconds: of control time.
    """
    kinematics, settings = robot()
    controller = BodyController(kinematics, settings)
    posture, command, now = _nominal(settings), BodyCommand(), 0.0
    excess = dict.fromkeys(("base speed", "base change", "joint speed", "joint change", "joint stop"), 0.0)
    before = np.zeros(16)
    while now < seconds:
        inputs = _hostile(rng)
        for _ in range(int(rng.integers(1, 60))):
            dt = PERIOD if rng.random() < 0.9 else float(rng.choice([0.002, 0.02, 0.05, 0.095]))
            posture, now = _integrated(posture, command, dt), now + dt
            command = controller.tick(BodyState(posture), *inputs, dt)
            sent = np.array([command.base_v, command.base_w, *command.left, *command.right])
            _note(excess, kinematics, settings, posture, sent, before, dt)
            before = sent
    return excess


def _hostile(rng: np.random.Generator) -> tuple[dict[str, PlanarTwist], dict[str, Hold], dict[str, Array]]:
    odd = [0.0, 1e-3, 0.3, -0.3, 5.0, -1e6, np.nan, np.inf]
    values = rng.choice(odd, 4, p=[0.1, 0.1, 0.3, 0.3, 0.1, 0.06, 0.02, 0.02])
    twist = PlanarTwist(*map(float, values))
    holds = {side: Hold("table", rng.normal(size=2), float(rng.normal())) for side in SIDES if rng.random() < 0.5}
    targets = ["table"] if holds else [name for name in ("left_ft", "right_ft", "base") if rng.random() < 0.6]
    wrenches = {side: rng.normal(size=6) * 10.0 ** rng.integers(-1, 6) for side in SIDES if rng.random() < 0.9}
    if rng.random() < 0.05:
        wrenches["left"] = np.full(6, np.nan)
    return ({} if rng.random() < 0.1 else dict.fromkeys(targets, twist)), holds, wrenches


def _integrated(posture: Posture, command: BodyCommand, dt: float) -> Posture:
    return _moved(posture, {side: dt * command.arm(side) for side in SIDES})


def _moved(posture: Posture, changes: Mapping[str, Array]) -> Posture:
    """Return a posture with changes (7,) of some arms' joints [rad]."""
    left, right = (posture.arm(side) + changes.get(side, np.zeros(7)) for side in SIDES)
    return Posture(posture.waist, posture.torso, left, right)


def _note(
    excess: dict[str, float],
    kinematics: RobotKinematics,
    settings: ControllerSettings,
    posture: Posture,
    sent: Array,
    before: Array,
    dt: float,
) -> None:
    """Keep the largest excess of each limit; NaN counts as infinite. A stop, all zeros, may be as sudden as it is."""
    if not np.isfinite(sent).all():
        excess["joint speed"] = np.inf
        return
    limits = [kinematics.limits(side) for side in SIDES]
    speeds = np.array([settings.base.speed, settings.base.yaw_rate, *limits[0].velocity, *limits[1].velocity])
    changes = np.array([settings.base.acceleration, settings.base.yaw_acceleration, *[settings.arm.acceleration] * 14])
    fast = np.abs(sent) - speeds
    sudden = np.abs(sent - before) - changes * dt if sent.any() else np.zeros(16)
    joints = np.concatenate([posture.left, posture.right])
    past = np.maximum(
        joints - np.concatenate([each.upper for each in limits]),
        np.concatenate([each.lower for each in limits]) - joints,
    )
    parts = (fast[:2], sudden[:2], fast[2:], sudden[2:], past)
    for name, part in zip(excess, parts, strict=True):
        value = float(part.max())
        excess[name] = max(excess[name], value if value > 1e-9 else 0.0)


def workspace_margin(steering: str, twist: tuple[float, float, float], way: float) -> dict[str, Any]:
    """Carry an object, two arms on it, along a long way; nothing resists and everything is done as commanded.

    Args:
        steering: of the base.
        twist: of the object's origin in its own axes [m/s, rad/s].
        way: to be covered by the contact [m].

    Returns:
        "margin": least distance of a gripper from the border of its workspace while the object went on [m]; "done":
        share of the way that was covered in twice the time.
    """
    kinematics, settings = robot()
    settings = settings.model_copy(update={"base": settings.base.model_copy(update={"steering": steering})})
    controller, posture = BodyController(kinematics, settings), _nominal(settings)
    contacts = {side: np.array([-LEVER, sign * 0.16]) for side, sign in zip(SIDES, (1.0, -1.0), strict=True)}
    base, asked = np.zeros(3), PlanarTwist(*twist)
    speed = float(np.hypot(*shift(np.array(twist), np.array([-LEVER, 0.0]))[:2]))
    margin, covered, seconds = np.inf, 0.0, 2.0 * way / speed
    for _ in range(round(seconds / PERIOD)):
        grippers = kinematics.grippers(posture)
        between = grippers["left"].planar[:2] - grippers["right"].planar[:2]
        yaw = float(np.arctan2(-between[0], between[1]))
        holds = {side: Hold("table", contacts[side], wrap(yaw - float(grippers[side].planar[2]))) for side in SIDES}
        command = controller.tick(BodyState(posture), {"table": asked}, holds, QUIET, PERIOD)
        base = compose(base, PERIOD * np.array([command.base_v, 0.0, command.base_w]))
        posture = _integrated(posture, command, PERIOD)
        margin = min(margin, *(_margin(settings, side, grippers[side].planar) for side in SIDES))
        covered += controller.share * speed * PERIOD
        if covered >= way:
            break
    return {"margin": margin, "done": min(covered / way, 1.0)}


def _margin(settings: ControllerSettings, side: str, planar: Array) -> float:
    """Return how far the plates are inside of their workspace [m]."""
    program = settings.program
    x, y = planar[0], planar[1] if side == "left" else -planar[1]
    return float(min(x - program.reach_x[0], program.reach_x[1] - x, y - program.reach_y[0], program.reach_y[1] - y))


def heading(angle: float, speed: float) -> tuple[float, float, float]:
    """Return a twist straight on at an angle to the object's x axis."""
    vx, vy = rotation(angle) @ [speed, 0.0]
    return float(vx), float(vy), 0.0
