"""The posterior over the physics of all bodies of a scene at once, with the continuous prior of table 2.

While nothing touches, the likelihood of equation 29 is a product over bodies: each body's own posterior, over classes
and parameters, is then a marginal of the joint one, and joint draws put independent draws side by side. A push in which
bodies touched couples them, and the coefficients of restitution and of contact friction come in: joint draws are then
weighed by what the contact engine makes of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from pbrl_bag.types import BodyGeometry
from pbrl_model.agents.domain import DT, Scene
from pbrl_model.agents.models import learn_options
from pbrl_model.agents.obstacles import edges, obstacles_of, placed
from pbrl_model.agents.planning import Planner, Space
from pbrl_model.agents.room import ITERATIONS, Push, contact_world
from pbrl_model.distributions import LogNormal, TruncatedNormal
from pbrl_model.engines.contact_world import rollout_contact
from pbrl_model.inference.mixture import stratified
from pbrl_model.transitions.classes import transition_class
from pbrl_model.transitions.data import concatenate, state_scale
from pbrl_model.transitions.model import LearnOptions, TransitionPosterior, learn_body

Array = NDArray[np.float64]

NEAR = 0.015  # [m] bodies nearer than this on the way may have touched
CONTACT_SIGMA = 0.01  # [m] what contact is trusted to: it magnifies small differences of pose
ATTEMPTS = 3  # at an inference that says it did not converge
LEAST_SHARE = 0.05  # effective share of joint draws below which a contact's weights are not believed
POOL = 12_800  # joint draws at most that a contact chooses from: one body's prior alone is wide
RESTITUTION = LogNormal(0.1, 1.0)  # table 2
CONTACT_FRICTION = TruncatedNormal(0.3, 0.3, 0.0, 1.0)  # table 2


@dataclass(frozen=True)
class JointPosterior:
    """Draws of all bodies' physics together.

    Attributes:
        names: of the K bodies.
        rows: (N, K, 12) kernel rows, draws of equal weight.
        coefficients: (N, K, 2) restitution, contact friction.
        classes: probabilities of each body's classes.
        converged: (K,) whether each body's own inference did.
        notes: what to know before believing it.
    """

    names: tuple[str, ...]
    rows: Array
    coefficients: Array
    classes: tuple[Mapping[str, float], ...]
    converged: NDArray[np.bool_]
    notes: tuple[str, ...]

    def best_class(self, index: int) -> str:
        """Return the most probable class of a body."""
        return max(self.classes[index], key=lambda name: self.classes[index][name])


class JointLearner:
    """Learns all bodies of a scene from pushes.

    Args:
        rng: source of randomness.
        scene: what is known.
        options: of each body's learner; None: friction on the floor is learned, one core.
    """

    def __init__(self, rng: np.random.Generator, scene: Scene, options: LearnOptions | None = None) -> None:
        self._rng, self._scene = rng, scene
        self._options = options or learn_options()
        self._free: dict[int, list[Push]] = {}
        self._touching: list[Push] = []
        self.posteriors: dict[int, TransitionPosterior] = {}

    @property
    def touching(self) -> int:
        """Number of pushes in which something was touched."""
        return len(self._touching)

    def observe(self, push: Push) -> bool:
        """Keep a push; return whether it touched nothing, as far as the geometry shows."""
        free = not touches(self._scene, push)
        if free:
            self._free.setdefault(push.target, []).append(push)
        else:
            self._touching.append(push)
        return free

    def learn(self, index: int) -> TransitionPosterior | None:
        """Infer one body's own posterior from its free pushes; None where there is none yet."""
        pushes = self._free.get(index)
        if not pushes:
            return None
        data = concatenate([push.transitions() for push in pushes]).body(index)
        before = self.posteriors.get(index)
        for _ in range(ATTEMPTS):
            found = learn_body(self._rng, data, self._geometry(index), self._options, before)
            if found.converged:
                break
            before = None  # what it started from may have led astray
        self.posteriors[index] = found
        return found

    def joint(self, draws: int = 100) -> JointPosterior:
        """Put the bodies' posteriors together and weigh them by the pushes in which something was touched.

        A body that was never pushed freely keeps its prior, and a note says so.
        """
        bodies = len(self._scene.things)
        rows = np.stack([self._drawn(index, draws) for index in range(bodies)], axis=1)
        coefficients = np.stack([self._coefficients(draws) for _ in range(bodies)], axis=1)
        notes, weighed = self._notes(), np.zeros(bodies, dtype=bool)
        for push in self._touching:
            new = _took_part(push) & ~weighed
            weight = self._contact_weight(rows, coefficients, push)
            if _effective(weight) < LEAST_SHARE * draws and new.any():
                rows, coefficients = self._drawn_anew(rows, coefficients, np.flatnonzero(new).tolist())
                weight = self._contact_weight(rows, coefficients, push)
            if _effective(weight) >= LEAST_SHARE * draws:
                weighed |= new
            else:
                name = self._scene.names[push.target]
                notes.append(
                    f"{name}: a push with contact fits {_effective(weight):.1f} of {len(rows)} joint draws; left out"
                )
                weight = np.full(len(rows), 1.0 / len(rows))
            pick = stratified(self._rng, weight, draws)
            rows, coefficients = rows[pick], coefficients[pick]
        classes = tuple(
            self.posteriors[index].class_probabilities
            if index in self.posteriors
            else dict.fromkeys(self._options.classes, 1.0 / len(self._options.classes))
            for index in range(bodies)
        )
        converged = [index in self.posteriors and self.posteriors[index].converged for index in range(bodies)]
        return JointPosterior(self._scene.names, rows, coefficients, classes, np.array(converged), tuple(notes))

    def _notes(self) -> list[str]:
        notes = []
        for index, name in enumerate(self._scene.names):
            if index in self.posteriors:
                notes += [f"{name}: {note}" for note in self.posteriors[index].notes]
            else:
                notes.append(f"{name}: never pushed without touching something; its prior stands")
        return notes

    def _drawn_anew(self, rows: Array, coefficients: Array, bodies: Sequence[int]) -> tuple[Array, Array]:
        """Return more joint draws, with bodies that no contact has tied to anything yet drawn anew."""
        pool = max(len(rows), POOL)
        rows, coefficients = (np.resize(each, (pool, *each.shape[1:])) for each in (rows, coefficients))
        for index in bodies:
            rows[:, index], coefficients[:, index] = self._drawn(index, pool), self._coefficients(pool)
        return rows, coefficients

    def _coefficients(self, draws: int) -> Array:
        """Return (draws, 2) restitution and contact friction of one body, from the prior."""
        return np.stack([RESTITUTION.sample(self._rng, draws), CONTACT_FRICTION.sample(self._rng, draws)], axis=1)

    def _drawn(self, index: int, draws: int) -> Array:
        """Return (draws, 12) rows of one body, in an order of their own, so that bodies are independent."""
        if index in self.posteriors:
            order = self._rng.permutation(len(self.posteriors[index].rows))
            return self.posteriors[index].rows[order[np.arange(draws) % len(order)]]
        settings, thing = self._options, self._scene.things[index]
        start = np.array([[*thing.start, 0.0, 0.0, 0.0]])
        rows = []
        for name in settings.classes:
            kind = transition_class(
                name, self._geometry(index), settings.priors, settings.noise, ground=settings.ground
            )
            rows.append(kind.rows(kind.prior.sample(self._rng, draws), start, np.zeros(2)))
        return np.array([rows[self._rng.integers(len(rows))][number] for number in range(draws)])

    def _contact_weight(self, rows: Array, coefficients: Array, push: Push) -> Array:
        """Return (N,) normalised weights of joint draws by where everything stands after a push with contact."""
        after = simulate_push(self._scene, rows, coefficients, push)
        levers = np.array([state_scale(float(np.sqrt(thing.inertia_per_mass)))[:3] for thing in self._scene.things])
        gap = after[:, :, :3] - push.after[None, :, :3]
        gap[..., 2] -= 2.0 * np.pi * np.round(gap[..., 2] / (2.0 * np.pi))
        squares = ((gap * levers) ** 2).sum(axis=(1, 2))
        log_weight = -0.5 * squares / CONTACT_SIGMA**2
        return np.exp(log_weight - logsumexp(log_weight))

    def _geometry(self, index: int) -> BodyGeometry:
        thing = self._scene.things[index]
        return BodyGeometry(thing.name, thing.footprint, float("nan"), float("nan"), True, thing.start)


def _effective(weight: Array) -> float:
    """Return how many draws normalised weights (N,) are worth."""
    return 1.0 / float((weight**2).sum())


def _took_part(push: Push) -> NDArray[np.bool_]:
    """Tell which bodies (K,) a push moved; the pushed one is always among them."""
    moved = np.hypot(*(push.after[:, :2] - push.before[:, :2]).T) > NEAR
    moved[push.target] = True
    return np.asarray(moved)


def simulate_push(scene: Scene, rows: Array, coefficients: Array, push: Push) -> Array:
    """Simulate a push with contact under joint draws.

    Args:
        scene: the room.
        rows: (N, K, 12).
        coefficients: (N, K, 2).
        push: wrench, duration and coasting; from where it began.

    Returns:
        (N, K, 6) states at its end.
    """
    pushing, steps = round(push.duration / DT), round((push.duration + push.coasting) / DT)
    wrench = np.zeros((steps, len(scene.things), 3))
    wrench[:pushing, push.target] = push.wrench
    parameters = np.concatenate([rows, coefficients], axis=2)
    rolled = rollout_contact(
        contact_world(scene), parameters, push.before, wrench, DT, iterations=ITERATIONS, parallel=False
    )
    return rolled[:, -1]


def touches(scene: Scene, push: Push, near: float = NEAR) -> bool:
    """Tell whether the pushed body came near a wall or another body, or another body moved."""
    others = [index for index in range(len(scene.things)) if index != push.target]
    moved = np.hypot(*(push.after[others, :2] - push.before[others, :2]).T)
    if len(others) and moved.max() > near:
        return True
    planner = Planner(scene.things[push.target], space_among(scene, push.before, push.target))
    legs = ((push.before, push.released), (push.released, push.after))
    for begin, end in legs:
        for share in np.linspace(0.0, 1.0, 6):
            pose = (1.0 - share) * begin[push.target, :3] + share * end[push.target, :3]
            if not planner.free(pose, near):
                return True
    return False


def space_among(scene: Scene, state: Array, index: int, without: Sequence[int] = (), margin: float = 0.03) -> Space:
    """Return the floor for one body among walls and the other bodies as they stand.

    Args:
        scene: the room.
        state: (K, >= 3) of all bodies.
        index: of the body that is to move.
        without: bodies taken away in thought.
        margin: kept from every obstacle [m].
    """
    others = [
        placed(thing.footprint, state[other])
        for other, thing in enumerate(scene.things)
        if other != index and other not in without
    ]
    obstacles = obstacles_of([*edges(scene.outline), *scene.walls, *others])
    return Space(scene.outline.min(axis=0), scene.outline.max(axis=0), obstacles, margin)
