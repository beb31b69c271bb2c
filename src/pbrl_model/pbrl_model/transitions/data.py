"""Transitions (s, a, s'): what agents observe and learners learn from (thesis section 5.1, equations 16 and 23).

A state is that of the centres of mass of K bodies in world, (x, y, theta, vx, vy, omega) each [m, m, rad, m/s, m/s,
rad/s]; an action is a wrench (fx, fy, tau) [N, N, N m] at the centre of mass of one target body, world axes, constant
over a duration [s]. Learners of single bodies see them one body at a time (`BodyTransitions`) and, where they are
invariant to pose, as displacements in the frame of the body at the transition's start (equation 20).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

FEATURES = ("vx", "vy", "omega", "fx", "fy", "tau", "duration")
OUTPUTS = ("dx", "dy", "dtheta", "dvx", "dvy", "domega")


@dataclass(frozen=True)
class Transitions:
    """Observed transitions of K bodies; rows in the order in which they were observed.

    Attributes:
        state: (n, K, 6) before.
        target: (n,) index of the body that the wrench acts on.
        wrench: (n, 3) at the target's centre of mass, world axes, constant.
        duration: (n,) [s].
        next_state: (n, K, 6) after.

    Raises:
        ModelError: a shape does not fit, a value is not finite, a duration is not above zero, or a target is not a
            body. No rows at all are legal: nothing has been observed yet.
    """

    state: Array
    target: Integers
    wrench: Array
    duration: Array
    next_state: Array

    def __post_init__(self) -> None:
        action = checked_action(self.state, self.target, self.wrench, self.duration)
        after = finite("next_state", self.next_state, action[0].shape)
        for field, value in zip(fields(self), (*action, after), strict=True):
            object.__setattr__(self, field.name, value)

    def __len__(self) -> int:
        return len(self.target)

    @property
    def bodies(self) -> int:
        """Number of bodies K."""
        return self.state.shape[1]

    def __getitem__(self, rows: slice | Sequence[int] | Integers | NDArray[np.bool_]) -> Transitions:
        """Return the chosen rows; a slice, indices or a mask."""
        chosen = rows if isinstance(rows, slice) else np.atleast_1d(np.asarray(rows))
        return Transitions(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def body(self, index: int) -> BodyTransitions:
        """Return one body's part of every transition; where it is not the target its wrench is zero.

        Raises:
            ModelError: there is no such body.
        """
        check_body(index, self.bodies)
        wrench = np.where((self.target == index)[:, None], self.wrench, 0.0)
        return BodyTransitions(self.state[:, index], wrench, self.duration, self.next_state[:, index])


def concatenate(parts: Sequence[Transitions]) -> Transitions:
    """Join transitions of the same bodies in order.

    Raises:
        ModelError: there are no parts, or their numbers of bodies differ.
    """
    counts = sorted({part.bodies for part in parts})
    if len(counts) != 1:
        raise ModelError(f"transitions: expected parts with one number of bodies, got {counts or 'no parts'}")
    return Transitions(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(parts[0])))


@dataclass(frozen=True)
class BodyTransitions:
    """One body's transitions.

    Attributes:
        start: (n, 6) state of the centre of mass before.
        wrench: (n, 3) at the centre of mass, world axes; zero where another body is pushed.
        duration: (n,) [s].
        end: (n, 6) state after.
    """

    start: Array
    wrench: Array
    duration: Array
    end: Array

    def __len__(self) -> int:
        return len(self.duration)

    @property
    def features(self) -> Array:
        """Return the (n, 7) inputs of equation 20; see `body_features`."""
        return body_features(self.start, self.wrench, self.duration)

    @property
    def displacements(self) -> Array:
        """Return the (n, 6) outputs of equation 20; see `displacements`."""
        return displacements(self.start, self.end)

    def first(self, n: int) -> BodyTransitions:
        """Return the first n rows."""
        return BodyTransitions(self.start[:n], self.wrench[:n], self.duration[:n], self.end[:n])

    def informative(self) -> BodyTransitions:
        """Return the rows in which the body is pushed or moves: a body left at rest that stays says nothing of it."""
        rows = self.wrench.any(axis=1) | self.start[:, 3:].any(axis=1) | (self.start != self.end).any(axis=1)
        return BodyTransitions(self.start[rows], self.wrench[rows], self.duration[rows], self.end[rows])


def body_features(start: Array, wrench: Array, duration: Array) -> Array:
    """Return (n, 7) velocity, wrench and duration of equation 20, vectors turned into the body's axes at the start."""
    velocity, force = turn(start[:, 3:5], -start[:, 2]), turn(wrench[:, :2], -start[:, 2])
    return np.column_stack([velocity, start[:, 5], force, wrench[:, 2], duration])


def displacements(start: Array, end: Array) -> Array:
    """Return (n, 6) change of pose and velocity in the body's axes at the start; the turn within (-pi, pi]."""
    change = end - start
    place, velocity = turn(change[:, :2], -start[:, 2]), turn(change[:, 3:5], -start[:, 2])
    dtheta = change[:, 2] - 2.0 * np.pi * np.ceil(change[:, 2] / (2.0 * np.pi) - 0.5)
    return np.column_stack([place, dtheta, velocity, change[:, 5]])


def displaced(start: Array, displacement: Array) -> Array:
    """Return (n, 6) states after displacements (n, 6): the inverse of `displacements`; angles are not wrapped."""
    place, velocity = turn(displacement[:, :2], start[:, 2]), turn(displacement[:, 3:5], start[:, 2])
    return start + np.column_stack([place, displacement[:, 2], velocity, displacement[:, 5]])


def turn(vectors: Array, angle: Array) -> Array:
    """Turn vectors (n, 2) by angles (n,) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]])


def state_scale(lever: float) -> Array:
    """Return (6,) what turns a state's components into metres and metres a second: angles times a lever [m].

    With the radius of gyration for lever, a turn counts as much as the body's mass moves by it.
    """
    return np.array([1.0, 1.0, lever, 1.0, 1.0, lever])


def observed(
    rng: np.random.Generator, transitions: Transitions, sigma: float, levers: ArrayLike, *, of_start: bool = False
) -> Transitions:
    """Add Gaussian noise to what comes after, s' = f(s, a) + eps (thesis equation 21).

    Args:
        rng: source of the noise.
        transitions: as they were.
        sigma: standard deviation of every component, in metres and metres a second [m, m/s].
        levers: (K,) [m] by which a body's noise is divided to be an angle; its radius of gyration makes it the same
            motion of the body's mass.
        of_start: whether what comes before is observed with such noise too.

    Raises:
        ModelError: sigma is negative or not finite, or the levers are not K positive numbers.
    """
    if not (np.isfinite(sigma) and sigma >= 0.0):
        raise ModelError(f"transitions: expected noise of at least zero [m], got {sigma!r}")
    lengths = finite("levers", levers, (transitions.bodies,))
    if not (lengths > 0.0).all():
        raise ModelError(f"transitions: expected levers above zero [m], got {lengths.tolist()}")
    sd = sigma / np.array([state_scale(lever) for lever in lengths])
    after = transitions.next_state + sd * rng.standard_normal(transitions.next_state.shape)
    before = transitions.state
    if of_start:
        before = before + sd * rng.standard_normal(before.shape)
    return Transitions(before, transitions.target, transitions.wrench, transitions.duration, after)


def checked_action(
    state: ArrayLike, target: ArrayLike, wrench: ArrayLike, duration: ArrayLike
) -> tuple[Array, Integers, Array, Array]:
    """Return a state and an action as arrays of one shape: what predictions are asked for.

    Args:
        state: (n, K, 6).
        target: (n,), or one index for all.
        wrench: (n, 3), or (3,) for all.
        duration: (n,) [s], or one for all.

    Raises:
        ModelError: a shape does not fit, a value is not finite, a duration is not above zero, or a target is not a
            body.
    """
    before = np.asarray(state, dtype=float)
    if before.ndim != 3 or before.shape[1] == 0 or before.shape[2] != 6:
        raise ModelError(f"transitions: expected state of shape (n, bodies, 6), got {before.shape}")
    n, bodies = before.shape[:2]
    pushes = finite("wrench", wrench, (n, 3))
    seconds = finite("duration", duration, (n,))
    if not (seconds > 0.0).all():
        raise ModelError(f"transitions: expected durations above zero [s], got {seconds.min():g}")
    return finite("state", before, before.shape), _targets(target, n, bodies), pushes, seconds


def _targets(target: ArrayLike, n: int, bodies: int) -> Integers:
    indices = np.asarray(target)
    if indices.size and indices.dtype.kind not in "iu":
        raise ModelError(f"transitions: expected target as whole numbers, got {indices.dtype}")
    if indices.shape not in ((), (n,)):
        raise ModelError(f"transitions: expected target of shape ({n},), got {indices.shape}")
    if indices.size and not 0 <= indices.min() <= indices.max() < bodies:
        raise ModelError(f"transitions: expected target in 0..{bodies - 1}, got {indices.min()}..{indices.max()}")
    return np.broadcast_to(indices.astype(np.int64), (n,))


def finite(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return finite values, broadcast to a shape.

    Raises:
        ModelError: they do not fit the shape or are not finite.
    """
    array = np.asarray(values, dtype=float)
    try:
        array = np.broadcast_to(array, shape)
    except ValueError:
        raise ModelError(f"transitions: expected {name} of shape {shape}, got {array.shape}") from None
    if not np.isfinite(array).all():
        row = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ModelError(f"transitions: expected finite {name}, got {array[row]} at {row}")
    return array


def check_body(index: int, bodies: int) -> None:
    """Raise `ModelError` for an index that is not one of the bodies'."""
    if not 0 <= index < bodies:
        raise ModelError(f"transitions: expected a body's index in 0..{bodies - 1}, got {index}")
