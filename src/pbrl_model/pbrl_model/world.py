"""The world model in pymunk: every body, contact and joints. Readable; the reference for `kernel.py`.

How each engine does what the thesis's model (equation 22) asks for:

- *Wheel* (anisotropic friction). Chipmunk has none. A wheel is two velocity constraints at the wheel's
  point, along the wheel's x and along its y axis, each with a force of at most `mu * mass * g`. Here each is
  a `PinJoint` to the static body whose far end is set anew before every solve, one metre from the wheel's
  point along the axis: the joint's direction is then the axis, and with `max_bias = 0` its length is
  never corrected, so that only the velocity is constrained. A `GrooveJoint`, which looks made for
  this, will not do: it projects the impulse of a full pivot on the groove's normal n and comes to rest where
  n.M.v = 0, M being the 2 x 2 effective mass at the point, not where n.v = 0; a wheel would creep sideways.
  The kernel has the same two rows and the same limits, and solves for them in closed form.
- *Distance joint to the world*. A `PinJoint` with the given length, a `PivotJoint` where it is zero, and
  Chipmunk's own error correction. The kernel has the same rows and the same correction.
- *Friction of the whole body on the floor*. Neither a joint nor Chipmunk's: after each step the velocities shrink by a
  common share, here and in the kernel alike; see there.
- *Distance joint between bodies, contact, restitution, contact friction*: Chipmunk's; the kernel knows one
  body that touches nothing. Chipmunk multiplies the coefficients of two touching shapes; the room's are 1, so that
  against a wall a body's own coefficients hold.

Where the two engines do the same thing they agree as far as Chipmunk's sweeps have converged. Over 500 steps of random
bodies and pushes: to 1e-9 m with 100 sweeps for a free body, a wheel, or a joint alone. A wheel and a joint on one body
converge slowly, the more so the nearer they are to each other: within 1e-6 m after 6000 sweeps where they lie 0.2 m
apart, a hundred thousand where they all but coincide; with 100 sweeps it is this world that is up to 2 cm off, the
kernel being the limit of the sweeps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pymunk
from numpy.typing import ArrayLike, NDArray

from pbrl_model.errors import ModelError
from pbrl_model.geometry import MassProperties, check_polygon, convex_parts, mass_properties
from pbrl_model.kernel import GRAVITY
from pbrl_model.parameters import BodyParameters

Array = NDArray[np.float64]

ITERATIONS = 100  # sweeps a step; Chipmunk's default of 10 leaves a wheel that sticks at millimetres a second
COLLISION_SLOP = 1e-3  # [m] Chipmunk's 0.1 is meant for pixels
WALL_THICKNESS = 0.02  # [m] radius of a wall's capsule
LEVER = 1.0  # [m] from the wheel's point to the far end of its joints; any length gives the same direction


@dataclass(frozen=True)
class BodySpec:
    """One body as the world is told of it.

    Attributes:
        name: unique in the world.
        footprint: (k, 2) [m] in the body's frame.
        parameters: mass, wheel and hinge.
        pose: (3,) x, y, theta of the body's frame in world.
        velocity: (3,) vx, vy of the centre of mass [m/s], omega [rad/s].
        restitution: 0..1.
        contact_friction: Coulomb coefficient against other bodies.
        mass_properties: None: of the footprint with uniform density.
    """

    name: str
    footprint: Array
    parameters: BodyParameters
    pose: Array
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    restitution: float = 0.0
    contact_friction: float = 0.5
    mass_properties: MassProperties | None = None


@dataclass
class _Member:
    """A body in the space with what is needed to speak of it in its own frame."""

    body: pymunk.Body
    com: pymunk.Vec2d
    mu_ground: float


class PhysicsWorld:
    """Bodies on a floor seen from above, stepped by Chipmunk.

    Args:
        dt: length of a step [s].
        iterations: sweeps of the solver in each step.
    """

    def __init__(self, dt: float = 0.01, iterations: int = ITERATIONS) -> None:
        if not (math.isfinite(dt) and dt > 0.0):
            raise ModelError(f"world: expected dt above zero [s], got {dt!r}")
        self.dt = dt
        self._space = pymunk.Space()
        self._space.iterations = iterations
        self._space.collision_slop = COLLISION_SLOP
        self._members: dict[str, _Member] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies, in the order in which they were added."""
        return tuple(self._members)

    @property
    def space(self) -> pymunk.Space:
        """The pymunk space, for what is not offered here; friction on the floor is not in it."""
        return self._space

    def add_body(self, spec: BodySpec) -> None:
        """Put a body into the world, with its wheel and its hinge.

        Raises:
            ModelError: the name is taken, or the body is not physical.
        """
        if spec.name in self._members:
            raise ModelError(f"world: expected a new name, got {spec.name!r} twice")
        _check_spec(spec)
        mass, properties = spec.parameters.mass, spec.mass_properties or mass_properties(spec.footprint)
        com = pymunk.Vec2d(*properties.com.tolist())
        body = pymunk.Body(mass, mass * properties.inertia_per_mass)
        x, y, theta = (float(value) for value in spec.pose)
        body.angle = theta
        body.position = pymunk.Vec2d(x, y) + com.rotated(theta)
        body.velocity = float(spec.velocity[0]), float(spec.velocity[1])
        body.angular_velocity = float(spec.velocity[2])
        shapes = [
            pymunk.Poly(body, [tuple(p) for p in (part - properties.com).tolist()])
            for part in convex_parts(spec.footprint)
        ]
        for shape in shapes:
            shape.elasticity, shape.friction = spec.restitution, spec.contact_friction
        self._space.add(body, *shapes)
        self._members[spec.name] = _Member(body, com, spec.parameters.mu_ground)
        self._add_wheel(body, com, spec.parameters)
        self._add_hinge(body, com, spec.parameters)

    def add_walls(self, outline: ArrayLike) -> None:
        """Enclose the floor with walls along a closed outline (k, 2) [m] in world."""
        corners = check_polygon(outline)
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            wall = pymunk.Segment(self._space.static_body, tuple(start.tolist()), tuple(end.tolist()), WALL_THICKNESS)
            wall.elasticity = wall.friction = 1.0
            self._space.add(wall)

    def join(
        self, first: str, second: str, anchor_first: Sequence[float], anchor_second: Sequence[float], radius: float
    ) -> None:
        """Keep two bodies' anchors, each in its own body's frame [m], at a distance of `radius` [m]."""
        a, b = self._member(first), self._member(second)
        here = pymunk.Vec2d(*anchor_first) - a.com
        there = pymunk.Vec2d(*anchor_second) - b.com
        self._space.add(_distance_joint(a.body, b.body, here, there, radius))

    def apply_wrench(self, name: str, wrench: ArrayLike) -> None:
        """Push a body during the next step: (fx, fy, tau) at its centre of mass, world axes."""
        fx, fy, tau = np.asarray(wrench, dtype=float).tolist()
        body = self._member(name).body
        body.force = body.force[0] + fx, body.force[1] + fy
        body.torque += tau

    def step(self) -> None:
        """Advance the world by `dt`; wrenches are gone afterwards."""
        self._space.step(self.dt)
        for member in self._members.values():
            if member.mu_ground > 0.0:
                _slow(member.body, member.mu_ground * GRAVITY * self.dt)

    def pose(self, name: str) -> Array:
        """Return the (3,) pose of the body's frame in world."""
        member = self._member(name)
        x, y = member.body.position - member.com.rotated(member.body.angle)
        return np.array([x, y, member.body.angle])

    def com_state(self, name: str) -> Array:
        """Return the (6,) state of the body's centre of mass, as the kernel has it."""
        body = self._member(name).body
        return np.array([*body.position, body.angle, *body.velocity, body.angular_velocity])

    def kinetic_energy(self, name: str) -> float:
        """Return the body's kinetic energy [J]."""
        body = self._member(name).body
        return 0.5 * body.mass * body.velocity.dot(body.velocity) + 0.5 * body.moment * body.angular_velocity**2

    def _member(self, name: str) -> _Member:
        try:
            return self._members[name]
        except KeyError:
            raise ModelError(
                f"world: expected one of {', '.join(self._members) or 'no bodies'}, got {name!r}"
            ) from None

    def _add_wheel(self, body: pymunk.Body, com: pymunk.Vec2d, parameters: BodyParameters) -> None:
        point = pymunk.Vec2d(parameters.wheel_x, parameters.wheel_y) - com
        for turn, mu in ((0.0, parameters.mu_x), (math.pi / 2.0, parameters.mu_y)):
            if mu == 0.0:
                continue
            lever = pymunk.Vec2d(LEVER, 0.0).rotated(parameters.wheel_theta + turn)
            joint = pymunk.PinJoint(self._space.static_body, body, body.local_to_world(point - lever), point)
            joint.max_bias = 0.0
            joint.max_force = mu * parameters.mass * GRAVITY
            joint.collide_bodies = True
            joint.pre_solve = _Realign(body, point - lever)
            self._space.add(joint)

    def _add_hinge(self, body: pymunk.Body, com: pymunk.Vec2d, parameters: BodyParameters) -> None:
        if not parameters.has_hinge:
            return
        anchor = pymunk.Vec2d(parameters.anchor_x, parameters.anchor_y) - com
        hinge = pymunk.Vec2d(parameters.hinge_x, parameters.hinge_y)
        self._space.add(_distance_joint(self._space.static_body, body, hinge, anchor, parameters.hinge_radius))


class _Realign:
    """Before every solve, carry the far end of a wheel's joint along with the body."""

    def __init__(self, body: pymunk.Body, far_end: pymunk.Vec2d) -> None:
        self._body = body
        self._far_end = far_end

    def __call__(self, joint: pymunk.Constraint, space: pymunk.Space) -> None:
        joint.anchor_a = self._body.local_to_world(self._far_end)


def _slow(body: pymunk.Body, loss: float) -> None:
    """Take `loss` [m/s] from a body's speed in the metric of its inertia, all velocities by the same share."""
    speed = math.sqrt(body.velocity.dot(body.velocity) + body.angular_velocity**2 * body.moment / body.mass)
    kept = 1.0 - loss / speed if speed > loss else 0.0
    body.velocity = body.velocity * kept
    body.angular_velocity *= kept


def _distance_joint(
    a: pymunk.Body, b: pymunk.Body, anchor_a: pymunk.Vec2d, anchor_b: pymunk.Vec2d, radius: float
) -> pymunk.Constraint:
    if not (math.isfinite(radius) and radius >= 0.0):
        raise ModelError(f"world: expected a joint's radius of at least zero [m], got {radius!r}")
    if radius == 0.0:
        return pymunk.PivotJoint(a, b, anchor_a, anchor_b)
    joint = pymunk.PinJoint(a, b, anchor_a, anchor_b)
    joint.distance = radius
    return joint


def _check_spec(spec: BodySpec) -> None:
    told = spec.parameters
    # Where there is no hinge its radius is NaN; nothing else may be.
    legal = np.isfinite((told if told.has_hinge else replace(told, hinge_radius=0.0)).to_vector()).all()
    if not legal or told.mass <= 0.0 or min(told.mu_x, told.mu_y, told.mu_ground) < 0.0:
        raise ModelError(
            f"world: expected finite parameters with mass > 0 and mu >= 0 for {spec.name!r}, got {spec.parameters}"
        )
    for name, value in (("pose", spec.pose), ("velocity", spec.velocity)):
        if np.shape(value) != (3,) or not np.isfinite(value).all():
            raise ModelError(
                f"world: expected {name} of {spec.name!r} as 3 finite numbers, got {np.asarray(value).tolist()}"
            )


def simulate_body(spec: BodySpec, wrench: ArrayLike, dt: float = 0.01, iterations: int = ITERATIONS) -> Array:
    """Roll one body out alone: the reference for `rollout_states`.

    Args:
        spec: the body.
        wrench: (T, 3) at the centre of mass, world axes, constant over each step.
        dt: [s].
        iterations: sweeps a step.

    Returns:
        (T + 1, 6) states of the centre of mass.
    """
    world = PhysicsWorld(dt, iterations)
    world.add_body(spec)
    forces = np.asarray(wrench, dtype=float)
    states = np.empty((len(forces) + 1, 6))
    states[0] = world.com_state(spec.name)
    for index, push in enumerate(forces):
        world.apply_wrench(spec.name, push)
        world.step()
        states[index + 1] = world.com_state(spec.name)
    return states
