"""One Bullet client: bodies by name, a fixed step, no hidden damping, the same run for the same inputs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bullet_sim.errors import SimError, nearest
from bullet_sim.quiet import bullet, silenced
from bullet_sim.window import BUILDERS, Window

Array = NDArray[np.float64]

FLOOR = "floor"
"""Name of the body that everything stands on."""

GRAVITY = 9.81
"""Standard acceleration of fall [m/s^2]."""

STEP = 1.0 / 400.0
"""Default physics step [s]. A divisor of 10 ms, so that 100 Hz and 50 Hz streams fall on steps. See `world.py`."""

SOLVER_ITERATIONS, SOLVED = 200, 1e-11
"""Sweeps of the contact solver per step at most, and the change of impulses below which they end.

Where Bullet's own 50 and 1e-7 end them, a wheel that holds 25 N sideways, of the 90 N that its friction could, creeps
sideways by 10 mm/s: like oil, not like rubber. With these it is well below 1 mm/s.
"""


def yaw_quaternion(theta: float) -> Array:
    """Give the quaternion (4,) x y z w of a turn by `theta` [rad] about the vertical."""
    return np.array([0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2)])


def multiply(first: Array, second: Array) -> Array:
    """Give the quaternion (4,) x y z w of `second` followed by `first`, both about fixed axes."""
    x1, y1, z1, w1 = first
    x2, y2, z2, w2 = second
    product = np.array(
        [
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        ]
    )
    return product / np.linalg.norm(product)


def cross(a: Sequence[float] | Array, b: Sequence[float] | Array) -> Array:
    """Give the vector product (3,); numpy's own takes ten times as long for one pair."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@dataclass(frozen=True)
class Pose:
    """Position (3,) [m] and unit quaternion (4,) x y z w of a frame in `world`."""

    position: Array
    quaternion: Array

    @cached_property
    def matrix(self) -> Array:
        """Rotation (3, 3) that takes vectors of the frame to `world`."""
        x, y, z, w = self.quaternion
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def yaw(self) -> float:
        """Heading [rad] of the frame's x axis seen from above."""
        x, y, z, w = self.quaternion
        return math.atan2(2 * (x * y + z * w), 1 - 2 * (y * y + z * z))

    def point(self, local: Sequence[float] | Array) -> Array:
        """Take a point (3,) [m] of the frame to `world`."""
        return self.position + self.matrix @ np.asarray(local, dtype=float)

    def inverse_point(self, world: Sequence[float] | Array) -> Array:
        """Take a point (3,) [m] of `world` to the frame."""
        return self.matrix.T @ (np.asarray(world, dtype=float) - self.position)


@dataclass(frozen=True)
class Twist:
    """Velocity (3,) [m/s] of a frame's origin and angular velocity (3,) [rad/s], both in `world` axes."""

    linear: Array
    angular: Array


class _Api:
    """Bullet's functions bound to one client, bound once each; what is built is built in its window too."""

    def __init__(self, connection: int, window: Window | None) -> None:
        self._connection, self._window = connection, window

    def __getattr__(self, name: str) -> Any:
        function: Callable[..., Any] = partial(getattr(bullet, name), physicsClientId=self._connection)
        if self._window is not None and name.startswith(BUILDERS):
            function = self._window.built_too(name, function)
        setattr(self, name, function)
        return function


class BulletClient:
    """A Bullet world of its own.

    Attributes:
        api: Bullet's functions by their own names, bound to this client.
        step_time: the physics step [s].
        time: simulated seconds since the start.
        bodies: Bullet's body numbers by name.
        window: shows this world; None where none was asked for.
    """

    def __init__(self, *, step: float = STEP, gui: bool = False) -> None:
        if not (math.isfinite(step) and 1e-5 <= step <= 1 / 100):
            raise SimError(f"physics step: expected 0.00001 to 0.01 s, got {step}; leave it out for {STEP} s")
        self.window = Window() if gui else None
        with silenced():
            connection = bullet.connect(bullet.DIRECT)
        self._connection: int | None = connection
        self.api = _Api(connection, self.window)
        self.step_time = step
        self._steps = 0
        self.bodies: dict[str, int] = {}
        self._links: dict[str, dict[str, int]] = {}
        self.api.resetSimulation()
        self.api.setGravity(0, 0, -GRAVITY)
        self.api.setPhysicsEngineParameter(
            fixedTimeStep=step,
            numSolverIterations=SOLVER_ITERATIONS,
            solverResidualThreshold=SOLVED,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            enableConeFriction=1,
            enableFileCaching=0,
        )

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._steps * self.step_time

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """End the client; a second call does nothing."""
        if self._connection is not None:
            self._connection = None
            self.api.disconnect()
            if self.window is not None:
                self.window.close()

    def step(self) -> None:
        """Advance the world by one physics step."""
        self.api.stepSimulation()
        self._steps += 1
        if self.window is not None:
            self.window.follow(self.api)

    def add(self, name: str, body: int) -> int:
        """Name a body that Bullet has made, and take the damping off it that Bullet puts on by default.

        Args:
            name: a name not used yet.
            body: Bullet's number.

        Raises:
            SimError: the name is taken, or Bullet made no body.
        """
        if body < 0:
            raise SimError(f"body {name!r}: Bullet could not make it; check its sizes and masses")
        if name in self.bodies:
            raise SimError(f"body {name!r}: expected a new name, it is taken; rename one of the two")
        links = {self._joint_name(body, index): index for index in range(self.api.getNumJoints(body))}
        for index in (-1, *links.values()):
            self.api.changeDynamics(
                body,
                index,
                linearDamping=0,
                angularDamping=0,
                jointDamping=0,
                activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            )
        self.bodies[name] = body
        self._links[name] = links
        return body

    @property
    def floor_friction(self) -> float:
        """Factor on every sliding friction against the floor; 1 where there is none yet."""
        return float(self.api.getDynamicsInfo(self.bodies[FLOOR], -1)[1]) if FLOOR in self.bodies else 1.0

    def remove(self, name: str) -> None:
        """Take a body out of the world; raise SimError for a name unknown."""
        self.api.removeBody(self.body(name))
        del self.bodies[name], self._links[name]

    def _joint_name(self, body: int, index: int) -> str:
        return str(self.api.getJointInfo(body, index)[1].decode())

    def load_urdf(self, name: str, path: str, pose: Pose, **options: Any) -> int:
        """Load a URDF file as body `name` with its root link's frame at `pose`.

        Cylinders stay cylinders: Bullet's polygons would add a rolling resistance as large as carpet.

        Args:
            name: name for the body.
            path: the file.
            pose: of the root link's inertial frame, as Bullet takes it.
            options: passed to Bullet's `loadURDF`.
        """
        flags = options.pop("flags", 0) | bullet.URDF_USE_IMPLICIT_CYLINDER
        try:
            with silenced():
                body = self.api.loadURDF(path, pose.position.tolist(), pose.quaternion.tolist(), flags=flags, **options)
        except bullet.error as error:
            raise SimError(f"{path}: expected a URDF that Bullet can load, got: {error}") from error
        return self.add(name, body)

    def body(self, name: str) -> int:
        """Give Bullet's number of a named body; raise SimError for a name unknown."""
        try:
            return self.bodies[name]
        except KeyError:
            raise SimError(f"body {name!r} is not in the scene; {nearest(name, self.bodies)}") from None

    def joints(self, name: str) -> dict[str, int]:
        """Give the joint (and child link) numbers of a body by joint name."""
        self.body(name)
        return dict(self._links[name])

    def joint(self, name: str, joint: str) -> int:
        """Give the number of one joint of a body; raise SimError for a name unknown."""
        links = self.joints(name)
        if joint not in links:
            raise SimError(f"body {name!r} has no joint {joint!r}; {nearest(joint, links)}")
        return links[joint]

    def centre_pose(self, name: str) -> Pose:
        """Give the pose of the base link's centre of mass (Bullet's own base frame)."""
        position, quaternion = self.api.getBasePositionAndOrientation(self.body(name))
        return Pose(np.array(position), np.array(quaternion))

    def centre_twist(self, name: str) -> Twist:
        """Give the velocity of the base link's centre of mass."""
        linear, angular = self.api.getBaseVelocity(self.body(name))
        return Twist(np.array(linear), np.array(angular))

    def link_pose(self, name: str, link: int) -> Pose:
        """Give the pose of a link's URDF frame (the frame of its joint); link -1 is not served here."""
        state = self.api.getLinkState(self.body(name), link, computeForwardKinematics=1)
        return Pose(np.array(state[4]), np.array(state[5]))

    def link_twist(self, name: str, link: int) -> tuple[Pose, Twist]:
        """Give pose and velocity of a link's URDF frame."""
        state = self.api.getLinkState(self.body(name), link, computeLinkVelocity=1, computeForwardKinematics=1)
        pose = Pose(np.array(state[4]), np.array(state[5]))
        angular = np.array(state[7])
        linear = np.array(state[6]) + cross(angular, pose.position - np.array(state[0]))
        return pose, Twist(linear, angular)

    def apply_force(self, name: str, link: int, force: Array, point: Array) -> None:
        """Push with `force` (3,) [N] at `point` (3,) [m], both in `world`, during the next step."""
        self.api.applyExternalForce(self.body(name), link, force.tolist(), point.tolist(), bullet.WORLD_FRAME)

    def photograph(
        self,
        eye: Sequence[float],
        target: Sequence[float],
        *,
        width: int = 960,
        height: int = 540,
        field_of_view: float = 50.0,
    ) -> NDArray[np.uint8]:
        """Take a picture with Bullet's software renderer, which needs no display.

        Args:
            eye: (3,) [m] where the camera stands, in `world`.
            target: (3,) [m] what it looks at.
            width: of the picture [px].
            height: of the picture [px].
            field_of_view: vertical [deg].

        Returns:
            (height, width, 3) red green blue.

        Raises:
            SimError: no direction to look in, or no picture to take.
        """
        if not math.dist(eye, target) > 1e-6 or not (1 <= width <= 8192 and 1 <= height <= 8192):
            raise SimError(f"picture: expected two places and 1 to 8192 px, got {eye}, {target}, {width} x {height}")
        up = (0, 0, 1) if math.hypot(eye[0] - target[0], eye[1] - target[1]) > 1e-6 else (0, 1, 0)
        view = bullet.computeViewMatrix(eye, target, up)
        projection = bullet.computeProjectionMatrixFOV(field_of_view, width / height, 0.05, 50.0)
        image = self.api.getCameraImage(
            width,
            height,
            view,
            projection,
            lightDirection=(0.5, -1, 8),  # nearly overhead: walls would darken half the room
            lightDistance=10,
            shadow=1,
            renderer=bullet.ER_TINY_RENDERER,
        )
        pixels = np.asarray(image[2], dtype=np.uint8).reshape(height, width, 4)
        return np.ascontiguousarray(pixels[:, :, :3])
