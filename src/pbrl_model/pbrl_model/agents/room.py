"""The true world of a domain: pushes are carried out with every contact, until all is at rest again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.agents.domain import DT, Domain, Scene
from pbrl_model.engines.contact_world import ContactScene, contact_scene, rollout_contact
from pbrl_model.transitions.data import Transitions, observed

Array = NDArray[np.float64]

REST = 1e-3  # [m/s], [rad/s] slower than this is at rest
STILL = 0.01  # [m] less is not seen to be a motion
PATIENCE = 4.0  # [s] as long as this things that were let go are watched
GLANCE = 0.1  # [s] between looks whether all is at rest
ITERATIONS = 30  # sweeps a step: a wheel, and contacts of a few bodies


@dataclass(frozen=True)
class Push:
    """What one action did: three states of all K bodies.

    Attributes:
        target: index of the pushed body.
        wrench: (3,) world axes.
        duration: [s] of the push.
        coasting: [s] from its end until all was at rest.
        before: (K, 6) at rest.
        released: (K, 6) at the end of the push.
        after: (K, 6) at rest again.
    """

    target: int
    wrench: Array
    duration: float
    coasting: float
    before: Array
    released: Array
    after: Array

    @property
    def stood_still(self) -> bool:
        """Tell whether the push did not move the body visibly."""
        return float(np.hypot(*(self.after - self.before)[self.target, :2])) < STILL

    def transitions(self) -> Transitions:
        """Return the push and the coasting after it, two rows in which the wrench is constant.

        A body that the push did not move does not coast: of what only noise moved the push alone is told.
        """
        if self.stood_still:
            return Transitions(
                self.before[None],
                np.array([self.target]),
                self.wrench[None],
                np.array([self.duration]),
                self.released[None],
            )
        return Transitions(
            np.array([self.before, self.released]),
            np.full(2, self.target),
            np.array([self.wrench, np.zeros(3)]),
            np.array([self.duration, self.coasting]),
            np.array([self.released, self.after]),
        )

    def whole(self) -> Transitions:
        """Return one row from rest to rest, as learners without physics take it: the wrench stands for all of it."""
        return Transitions(
            self.before[None], np.array([self.target]), self.wrench[None], np.array([self.duration]), self.after[None]
        )


class Room:
    """A domain that is being played: the bodies as they stand, and the physics that moves them.

    Args:
        domain: scene and truth.
        start: (K, 6) state; None: that of the scene.
    """

    def __init__(self, domain: Domain, start: Array | None = None) -> None:
        self._scene = contact_world(domain.scene)
        self.state = np.array(domain.scene.start if start is None else start)
        truth = [domain.truth[name] for name in domain.scene.names]
        self._rows = np.array(
            [[*each.parameters.to_vector(), each.restitution, each.contact_friction] for each in truth]
        )

    def push(self, target: int, wrench: Array, duration: float) -> Push:
        """Push a body with a constant wrench (3,) in world axes, let go, and wait until everything is at rest."""
        before = self.state
        released = self._roll(target, wrench, round(duration / DT))
        after, glances = released, 0
        while glances * GLANCE < PATIENCE and (glances == 0 or np.abs(after[:, 3:]).max() > REST):
            self.state = after
            after, glances = self._roll(target, np.zeros(3), round(GLANCE / DT)), glances + 1
        self.state = after.copy()
        self.state[:, 3:] = 0.0
        return Push(target, wrench, duration, glances * GLANCE, before, released, after)

    def _roll(self, target: int, wrench: Array, steps: int) -> Array:
        forces = np.zeros((steps, len(self.state), 3))
        forces[:, target] = wrench
        rolled = rollout_contact(self._scene, self._rows, self.state, forces, DT, iterations=ITERATIONS, parallel=False)
        return rolled[0, -1]


class Observer:
    """What an agent sees of pushes: states with white noise of the same size in every component.

    Args:
        rng: source of the noise.
        domain: whose noise it is.
    """

    def __init__(self, rng: np.random.Generator, domain: Domain) -> None:
        self._rng, self._sigma = rng, domain.noise
        self._levers = np.sqrt([thing.inertia_per_mass for thing in domain.scene.things])

    def look(self, state: Array) -> Array:
        """Return states (K, 6) at rest as they are seen; that they are at rest is seen without noise."""
        seen = self._noisy(state)
        seen[:, 3:] = 0.0
        return seen

    def watch(self, push: Push, before: Array) -> Push:
        """Return a push as it is seen, from `before` (K, 6) as it was seen."""
        released = self._noisy(push.released)
        return Push(push.target, push.wrench, push.duration, push.coasting, before, released, self.look(push.after))

    def _noisy(self, state: Array) -> Array:
        if self._sigma == 0.0:
            return state.copy()
        rows = Transitions(state[None], np.zeros(1, dtype=np.int64), np.zeros((1, 3)), np.ones(1), state[None])
        return np.array(observed(self._rng, rows, self._sigma, self._levers).next_state[0])


def contact_world(scene: Scene) -> ContactScene:
    """Return the scene as the contact engine takes it."""
    return contact_scene([thing.footprint for thing in scene.things], [scene.outline, *scene.walls])


def jittered(rng: np.random.Generator, domain: Domain) -> Array:
    """Return (K, 6) a start of the domain in which the things with goals stand a little differently.

    What is pinned to the floor is turned about its pin.
    """
    state = domain.scene.start
    for row, thing in zip(state, domain.scene.things, strict=True):
        change = np.array(domain.jitter) * rng.uniform(-1.0, 1.0, 3)
        if thing.goal is None:
            continue
        physics = domain.truth[thing.name].parameters
        row[2] += change[2]
        if physics.has_hinge:
            c, s = np.cos(row[2]), np.sin(row[2])
            x, y = physics.anchor_x, physics.anchor_y
            row[:2] = physics.hinge_x - c * x + s * y, physics.hinge_y - s * x - c * y
        else:
            row[:2] += change[:2]
    return state
