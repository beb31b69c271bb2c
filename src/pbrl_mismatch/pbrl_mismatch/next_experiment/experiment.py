"""Choose the push with the largest expected information about the surviving hypotheses.

A robot moves its gripper along a path: what it prescribes is where the contact point goes, not the force. So the
outcome of a planned push is both the motion that the body makes and the wrench that the hand feels, and hypotheses
differ in both: where the hand holds fast, they differ in the force that it takes; where the body gives way or turns,
in the pose. To prescribe the wrench instead would let every hypothesis run away from the plan with half the squared
time: motions that no robot would follow, and far too much information. A diagnosis conditions on the felt wrench and
judges the motion; a force that is missing shows to it as the acceleration that it would cause, which is the same
information, since it too knows the wrench only up to the sensor's own error.

Under each hypothesis outcomes are a Gaussian: the mean at the fitted parameters; its covariance from the fit's, carried
through by simulating one standard deviation to both sides along each principal axis, plus the noise of the sensors.
Draws of the parameters are simulated too, for where that is too simple (`information.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.track import Track
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.next_experiment.candidates import Candidates, Reach, candidates_of
from pbrl_mismatch.next_experiment.hand_kernel import CHANNELS, push_all
from pbrl_mismatch.next_experiment.information import information_bounds
from pbrl_mismatch.search.fitted import Fitted
from pbrl_mismatch.search.posterior import Density
from pbrl_mismatch.search.weigh import Weighed
from pbrl_model.sensing.windows import LEAST_NOISE, POSE_RATE

Array = NDArray[np.float64]

SEGMENTS = 6
"""Parts of a push over which an outcome is averaged."""
TRIED, DRAWS = 64, 24
"""Draws of each hypothesis's parameters, and how many of them, by their weight, are simulated."""
GLANCED, LOOKED_INTO = 8, 64
"""Of more pushes than `LOOKED_INTO`, so many draws of each hypothesis say which of them are looked into."""
SURVIVING, MOST_SURVIVORS = 0.01, 5
"""Hypotheses that are less probable are not asked about, nor more than so many."""
ARM = 0.1
"""Share of a force that comes from how the arm is, which nobody knows exactly."""
PAUSE = 2.0
"""Between the end of the recording and the push [s]."""
STIFFEST, DAMPED, RAMP = 0.04, 0.7, 0.3
"""Of the hand: squared step times frequency squared at most, damping ratio, time in which it gets up to speed [s]."""


@dataclass(frozen=True)
class NextExperiment:
    """A push that is worth making.

    Attributes:
        object: its name.
        contact_point: (x, y) on the outline, in the object's frame [m].
        direction: (x, y) in which the hand goes, world axes, of unit length.
        speed: [m/s].
        duration: [s].
        expected_bits: expected information about which hypothesis is true; a lower bound [bit].
        hypotheses: what it is to tell apart.
    """

    object: str
    contact_point: tuple[float, float]
    direction: tuple[float, float]
    speed: float
    duration: float
    expected_bits: float
    hypotheses: tuple[str, ...]

    def to_report(self) -> dict[str, Any]:
        """Return the form of `report.json`."""
        return {
            "object": self.object,
            "contact_point": [round(value, 4) for value in self.contact_point],
            "direction": [round(value, 4) for value in self.direction],
            "speed": self.speed,
            "duration": self.duration,
            "expected_bits": self.expected_bits,
        }

    def sentence(self) -> str:
        """Return what to do, and why, in a sentence."""
        heading = math.degrees(math.atan2(self.direction[1], self.direction[0]))
        return (
            f"to tell {' from '.join(self.hypotheses)}: take {self.object} at ({self.contact_point[0]:.2f}, "
            f"{self.contact_point[1]:.2f}) m of its frame and push towards {heading:.0f} degrees of the world at "
            f"{self.speed:.2f} m/s for {self.duration:.1f} s; expected are {self.expected_bits:.2f} bits"
        )


def survivors(weighed: Sequence[Weighed]) -> tuple[Weighed, ...]:
    """Return the hypotheses that are still possible, their probabilities made to sum to one."""
    kept = [each for each in weighed if each.probability >= SURVIVING][:MOST_SURVIVORS]
    total = sum(each.probability for each in kept)
    return tuple(replace(each, probability=each.probability / total) for each in kept)


def next_experiment(
    rng: np.random.Generator, track: Track, weighed: Sequence[Weighed], reach: Reach | None = None
) -> NextExperiment | None:
    """Return the push that is expected to say most; None where one hypothesis is left, or no push is within reach.

    Args:
        rng: thins out candidates.
        track: what was recorded; a push begins where the object was last seen.
        weighed: hypotheses, likeliest first.
        reach: what the robot can do; None: the defaults, and no walls.
    """
    chosen = reach or Reach()
    left = survivors(weighed)
    pushes = candidates_of(rng, track, chosen)
    if len(left) < 2 or len(pushes) == 0:
        return None
    if len(pushes) > LOOKED_INTO:
        glance, _ = expected_bits(rng, track, left, pushes, chosen, glance=True)
        pushes = pushes.take(np.sort(np.argsort(-glance, kind="stable")[:LOOKED_INTO]))
    low, _ = expected_bits(rng, track, left, pushes, chosen)
    return described(track, left, pushes, low, int(np.argmax(low)))


def random_experiment(
    rng: np.random.Generator, track: Track, weighed: Sequence[Weighed], reach: Reach | None = None
) -> NextExperiment | None:
    """Return any push of the same candidates: what choosing has to be better than."""
    chosen = reach or Reach()
    left = survivors(weighed)
    pushes = candidates_of(rng, track, chosen)
    if len(left) < 2 or len(pushes) == 0:
        return None
    one = pushes.take(np.array([rng.integers(len(pushes))]))
    low, _ = expected_bits(rng, track, left, one, chosen)
    return described(track, left, one, low, 0)


def described(track: Track, left: Sequence[Weighed], pushes: Candidates, low: Array, k: int) -> NextExperiment:
    """Return one of the candidates with its bits (C,)."""
    return NextExperiment(
        track.object,
        (float(pushes.contact[k, 0]), float(pushes.contact[k, 1])),
        (float(pushes.direction[k, 0]), float(pushes.direction[k, 1])),
        float(pushes.speed[k]),
        float(pushes.duration[k]),
        float(low[k]),
        tuple(" + ".join(each.effects) or "nothing left out" for each in left),
    )


def expected_bits(
    rng: np.random.Generator,
    track: Track,
    left: Sequence[Weighed],
    pushes: Candidates,
    reach: Reach,
    *,
    glance: bool = False,
) -> tuple[Array, Array]:
    """Return bounds (C,) from below and above of the information that each push would give [bit].

    A push under which a hypothesis cannot be simulated (its numbers overflow) is worth nothing here.

    Args:
        rng: of draws of parameters.
        track: what was recorded.
        left: hypotheses whose probabilities sum to one.
        pushes: C candidates.
        reach: what the hand is like.
        glance: simulate a few draws of each hypothesis alone, for an order of the pushes at a fifth of the cost.

    Raises:
        MismatchError: probabilities do not sum to one.
    """
    probability = np.array([each.probability for each in left])
    if len(left) == 0 or abs(float(probability.sum()) - 1.0) > 1e-6:
        raise MismatchError(f"next experiment: expected probabilities that sum to one, got {probability.tolist()}")
    hand = hand_of(left[0], track, reach)
    told = [_outcomes(rng, each, track, pushes, hand, glance) for each in left]
    mean, spread, draws = (np.array([each[k] for each in told]) for k in range(3))
    fine = np.isfinite(mean).all(axis=(0, -1)) & np.isfinite(spread).all(axis=(0, -2, -1))
    fine &= np.isfinite(draws).all(axis=(0, 1, -1))
    mean[:, ~fine], spread[:, ~fine], draws[:, :, ~fine] = 0.0, 0.0, 0.0
    noise = _sensed(left[0], track, pushes) + _of_the_arm(probability, mean)
    low, high = information_bounds(probability, mean, spread + noise, draws, noise)
    return np.where(fine, low, 0.0), np.where(fine, high, 0.0)


def hand_of(best: Weighed, track: Track, reach: Reach) -> Array:
    """Return the hand (9,) for `push_all`: as stiff as the arm is, and as the simulation's step allows."""
    mass = float(best.fitted.row[COLUMN["mass"]])
    farthest = float(np.max(np.sum((track.outline - track.body[1:3]) ** 2, axis=1)))
    inertia = mass * track.body[0]
    least = 1.0 / (1.0 / mass + farthest / inertia)
    stiffness = min(reach.stiffness, STIFFEST * least / track.dt**2)
    turning = min(reach.turn_stiffness, STIFFEST * inertia / track.dt**2)
    return np.array(
        [
            stiffness,
            2.0 * DAMPED * math.sqrt(stiffness * least),
            turning if reach.gripped else 0.0,
            2.0 * DAMPED * math.sqrt(turning * inertia) if reach.gripped else 0.0,
            reach.most_force,
            reach.most_torque,
            float(reach.gripped),
            reach.friction,
            RAMP,
        ]
    )


def _outcomes(
    rng: np.random.Generator, each: Weighed, track: Track, pushes: Candidates, hand: Array, glance: bool
) -> tuple[Array, Array, Array]:
    """Return mean (C, D), the covariance (C, D, D) that comes from not knowing the parameters, and draws (S, C, D).

    At a glance the covariance is that of a few draws.
    """
    peak, hypothesis = each.fitted.peak, each.fitted.hypothesis
    spread = hypothesis.spread
    values, vectors = np.linalg.eigh(peak.covariance(0) / np.outer(spread, spread))
    moves = (vectors * np.sqrt(np.maximum(values, 0.0)) * spread[:, None]).T
    around = np.concatenate([np.zeros((1, len(spread))), *([] if glance else [moves, -moves])])
    drawn = posterior_draws(rng, each.fitted, moves)[:: DRAWS // GLANCED if glance else 1]
    points = np.concatenate([peak.coordinates[0] + around, drawn])
    last = len(track.clock) - 1
    told = np.concatenate([track.seen[last, :3], np.zeros(3)])
    out = np.empty((len(points), len(pushes), SEGMENTS, CHANNELS))
    push_all(
        np.ascontiguousarray(hypothesis.rows(points)),
        np.ascontiguousarray(pushes.contact),
        np.ascontiguousarray(pushes.normal),
        np.ascontiguousarray(pushes.direction),
        np.ascontiguousarray(pushes.speed),
        np.ascontiguousarray(pushes.duration),
        told,
        float(track.clock[last]) + PAUSE,
        track.seen,
        np.array([last, 0, int(track.begin[-1]), last], dtype=np.int64),
        track.pivot[-1],
        track.body,
        track.outline,
        track.feet,
        hand,
        out,
    )
    flat = out.reshape(len(points), len(pushes), -1)
    draws = flat[-len(drawn) :]
    if glance:
        off = (draws - flat[0]) / math.sqrt(len(drawn))
    else:
        off = 0.5 * (flat[1 : 1 + len(moves)] - flat[1 + len(moves) : -len(drawn)])
    return flat[0], np.einsum("kci,kcj->cij", off, off), draws


def posterior_draws(rng: np.random.Generator, fitted: Fitted, moves: Array) -> Array:
    """Return (DRAWS, K) coordinates that the recording allows: Gaussian draws, weighed by it and drawn again.

    Where the recording says nothing of a parameter at the peak (a cord that was slack), the Gaussian is as wide as the
    prior, although other values would have been noticed; their weight is small.

    Args:
        rng: of the draws.
        fitted: the hypothesis; its own draws are taken where it has any.
        moves: (K, K) one standard deviation along each principal axis, in rows.
    """
    if fitted.draws is not None:
        return fitted.draws[rng.choice(len(fitted.draws), DRAWS, replace=False)]
    normal = rng.standard_normal((TRIED, len(moves)))
    normal[0] = 0.0
    points = fitted.peak.coordinates[0] + normal @ moves
    value = Density(fitted.peak)(points) + 0.5 * np.sum(normal**2, axis=1)
    share = np.exp(value - value.max())
    edges = np.cumsum(share / share.sum())
    return points[np.minimum(np.searchsorted(edges, (np.arange(DRAWS) + rng.random()) / DRAWS), TRIED - 1)]


def _sensed(best: Weighed, track: Track, pushes: Candidates) -> Array:
    """Return (C, D, D) covariance of what sensors add: white noise of tags, and errors that last as long as the push.

    A pose is known to the tags' noise over the whole push, a force to the sensor's own error in motion, once over
    the push and once more over each part of it.
    """
    noise = np.array([np.where(np.isfinite(motion.noise), motion.noise, 10.0) for motion in track.motions])
    tag = np.maximum(noise.mean(axis=0), LEAST_NOISE) * best.fitted.noise_scale
    tag[:2] = np.sqrt(np.mean(tag[:2] ** 2))  # the floor has no axes
    floor = best.fitted.peak.objective.floor * np.array([1.0, 1.0, track.gyration])
    lasting = np.concatenate([tag, floor]) ** 2
    counts = np.maximum(POSE_RATE * pushes.duration / SEGMENTS, 1.0)
    out = np.empty((len(pushes), SEGMENTS * CHANNELS, SEGMENTS * CHANNELS))
    for k, count in enumerate(counts):
        white = np.concatenate([tag**2 / count, floor**2])
        out[k] = np.kron(np.ones((SEGMENTS, SEGMENTS)), np.diag(lasting)) + np.kron(np.eye(SEGMENTS), np.diag(white))
    return out


def _of_the_arm(probability: Array, mean: Array) -> Array:
    """Return (C, D, D) covariance of forces because the real arm is not quite the one that is planned with.

    Args:
        probability: (H,).
        mean: (H, C, D) outcomes.
    """
    felt = mean.reshape(*mean.shape[:2], SEGMENTS, CHANNELS)[..., 3:]
    squares = np.stack([np.sum(felt[..., :2] ** 2, -1), np.sum(felt[..., :2] ** 2, -1), felt[..., 2] ** 2], -1)
    variance = np.zeros((mean.shape[1], SEGMENTS, CHANNELS))
    variance[..., 3:] = ARM**2 * np.einsum("h,hcsk->csk", probability, squares)
    return variance.reshape(len(variance), -1)[:, :, None] * np.eye(SEGMENTS * CHANNELS)
