"""What the grippers' poses say: whether the hold gives way, or the body's poses come late against the gripper's.

The place of the gripper's point against the contact is a linear law of the force, of its direction and of the speed,

    q = q_0 + R(a) e + R(-h) b + C f + p f / |f| + T v + noise,

with a place q_0 of its own for each grasp; Bayesian linear regression has the evidence in closed form. An edge turns
between the plates, by `a`: where the gripper's point is on it is known but for an error e, of each grasp too. The
camera may see body and gripper off against each other by b in the world, which turns against the body as its heading
h does. A tag that is glued on with an offset moves the contact that it makes one see: as the edge turns between the
plates about the true one, the gripper's point swings about it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.stats import chi2

from pbrl_mismatch.data.grip import GripTrack
from pbrl_mismatch.effects.grasp_compliance import PARAMETERS
from pbrl_mismatch.effects.pose_bias import PARAMETERS as TAG_PARAMETERS
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.fitted import Fitted
from pbrl_mismatch.search.grip_noise import RANK, GripNoise, grip_noise
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Reduced
from pbrl_mismatch.search.one_sided import one_sided
from pbrl_mismatch.search.p_values import unless_unbelievable
from pbrl_model.transforms import plane_rotations

Array = NDArray[np.float64]

BETWEEN = GRASP_COMPLIANCE, LATENESS, TAG_OFFSET = "grasp_compliance", "time_offset", "pose_bias"
"""Effects that show between gripper and body."""
HELD_SOFTLY = f" + {GRASP_COMPLIANCE}/0"
"""What a hold that gives way adds to the name of the variant that it is laid on."""
TAG = tuple(parameter.column for parameter in TAG_PARAMETERS)
NEW_RUBBER, NEW_RUBBER_SPREAD = 5e-5, 3e-5
"""Compliance of a hold that is as it should be [m/N]."""
SOFT_FORCE = 0.5
"""A force has a direction from about here on [N]."""
FREE_PLACE, POINT_SPREAD, CAMERA_SPREAD = 0.1, 0.01, 0.01
"""Standard deviations of where a grasp is, which is not known, of the gripper's point and of the camera's error [m]."""
LATE_SPREAD = 0.12
"""Of a delay that is a fault, as in the effect `time_offset` [s]."""
GIVES, PLAYS, LEARNED = 0, 1, 3
"""Columns of what is learned beside the grasps' places, and how many there are."""
SHOWS = 0.1
"""Where grippers and camera are is told by the readings in directions in which they have so much of what is believed
to say, as a precision."""


@dataclass(frozen=True)
class GripLaw:
    """What the grippers' poses say where a hold gives way or does not, and a stream is late or is not.

    Attributes:
        evidence: its log evidence [nat], up to a common constant.
        mean: (3,) compliance [m/N], play [m] and lateness [s].
        covariance: (3, 3) of those.
        tag_pull: (3,) slope of the log evidence in a tag's offset (x, y [m], turn [rad]), from none.
        tag_precision: (3, 3) its curvature, taken negative.
    """

    evidence: float
    mean: Array
    covariance: Array
    tag_pull: Array
    tag_precision: Array

    def of_tag(self, mean: Array, covariance: Array) -> float:
        """Return how much likelier than with no offset the readings are with one of (3,), known to (3, 3) [nat]."""
        root = np.linalg.cholesky(covariance + 1e-12 * np.eye(3))
        inner = np.eye(3) + root.T @ self.tag_precision @ root
        at_mean = float(self.tag_pull @ mean - 0.5 * mean @ self.tag_precision @ mean)
        slope = root.T @ (self.tag_pull - self.tag_precision @ mean)
        gained = 0.5 * float(slope @ np.linalg.solve(inner, slope))
        return at_mean + gained - 0.5 * float(np.linalg.slogdet(inner)[1])


@dataclass(frozen=True)
class GripEvidence:
    """What the grippers' poses say.

    Attributes:
        laws: by whether the hold gives way, and whether the body's poses are late against the gripper's.
        p_value: chance of so large a misfit if the hold is as it should be and no stream late; of one with the force,
            for a hold gives way to no other side. Or of gripper and body so far from where they are told to be, where
            that is unbelievable.
        spread: (3, 3) covariance of compliance [m/N], play [m] and lateness [s] that the readings find in such a hold.
    """

    laws: Mapping[tuple[bool, bool], GripLaw]
    p_value: float
    spread: Array

    @property
    def rigid(self) -> GripLaw:
        """Return that all is as it should be."""
        return self.laws[False, False]

    @property
    def gives(self) -> GripLaw:
        """Return that the hold gives way."""
        return self.laws[True, False]

    @property
    def late(self) -> GripLaw:
        """Return that the body's poses are late."""
        return self.laws[False, True]

    def noncentrality(self, holds: Array) -> Array:
        """Return (P,) squared distances, in spreads, of holds (P, 2) that give more than new rubber [m/N, m]."""
        precision = np.linalg.inv(self.spread)[: PLAYS + 1, : PLAYS + 1]
        return np.einsum("pi,ij,pj->p", holds, precision, holds)

    def beside(self, hypothesis: Hypothesis, coordinates: Array, covariance: Array) -> float:
        """Return the log evidence of the readings for a hypothesis, of which the motion is known [nat].

        A stream that is late may be the body's poses or the wrenches: only the first shows against the gripper.

        Args:
            hypothesis: with effects, and those of a model that was told.
            coordinates: (K,) mean of what its motion says.
            covariance: (K, K).
        """
        effects, columns = {*hypothesis.effects, *hypothesis.told}, hypothesis.columns
        mean, spread = np.zeros(3), np.zeros((3, 3))
        free = [k for k, name in enumerate(TAG) if name in columns]
        there = [columns.index(TAG[k]) for k in free]
        mean[free], spread[np.ix_(free, free)] = coordinates[there], covariance[np.ix_(there, there)]

        def of(late: bool) -> float:
            law = self.laws[GRASP_COMPLIANCE in effects, late]
            return law.evidence + (law.of_tag(mean, spread) if TAG_OFFSET in effects else 0.0)

        return float(np.logaddexp(of(False), of(True)) - np.log(2.0)) if LATENESS in effects else of(False)

    def beyond(self, hypothesis: Hypothesis, coordinates: Array, covariance: Array, among: Collection[str]) -> float:
        """Return how much likelier the readings are with the best of some effects that a hypothesis lacks [nat].

        Where it lacks none of them that would show there it is minus infinity.

        Args:
            hypothesis: that is to explain them.
            coordinates: (K,) mean of what its motion says.
            covariance: (K, K).
            among: names of the effects.
        """
        known = self.beside(hypothesis, coordinates, covariance)
        gained = [-math.inf]
        for name, added in ((GRASP_COMPLIANCE, ()), (LATENESS, ()), (TAG_OFFSET, TAG_PARAMETERS)):
            if name not in among or name in {*hypothesis.effects, *hypothesis.told}:
                continue
            effects = (*hypothesis.effects, name)
            richer = replace(hypothesis, effects=effects, parameters=(*hypothesis.parameters, *added))
            mean = np.concatenate([coordinates, [each.mean for each in added]])
            spread = block_diag(covariance, *([each.spread**2] for each in added))
            gained.append(self.beside(richer, mean, spread) - known)
        return max(gained)


def grip_evidence(grips: GripTrack, delay_spread: float, told: Collection[str] = ()) -> GripEvidence | None:
    """Weigh what may act between gripper and body; None where the readings are too few to say how noisy they are.

    Args:
        grips: readings.
        delay_spread: of a delay that is no fault [s].
        told: effects of a model that was told: a hold that is as they say is as it should be.
    """
    laws, places, seen = _laws(grips)
    known = _place_spread(places.shape[1])
    stiff, soft = (NEW_RUBBER_SPREAD, 1e-9), tuple(p.spread for p in PARAMETERS)
    # Noise from the richest law, freed of all of them: a hold that gives is no worse sensor.
    every = np.column_stack([places, laws])
    noise = grip_noise(grips, every, seen)
    if noise is None:
        return None
    laws, places, seen, tag = (noise.whitened(each) for each in (laws, places, seen, _tag_law(grips)))
    variance = noise.rest / noise.count
    shifted = seen - laws[:, GIVES] * NEW_RUBBER
    design, both = np.column_stack([places, laws]), np.column_stack([shifted, tag])

    def weigh(gives: bool, late: bool) -> GripLaw:
        spread = [*(soft if gives else stiff), LATE_SPREAD if late else delay_spread]
        prior = np.concatenate([known, spread]) ** -2.0
        matrix = design.T @ design / variance + np.diag(prior)
        found = np.linalg.solve(matrix, design.T @ both / variance)
        unlikely = (both - design @ found) / variance
        # What is left, weighed by its own covariance, is what is left times what is unlikely of it.
        value = -0.5 * float(shifted @ unlikely[:, 0]) - 0.5 * float(np.linalg.slogdet(matrix)[1])
        value += 0.5 * float(np.sum(np.log(prior)))
        inverse = np.asarray(np.linalg.inv(matrix), dtype=np.float64)[-3:, -3:]
        mean = np.array([NEW_RUBBER, 0.0, 0.0]) + found[-3:, 0]
        return GripLaw(value, mean, inverse, tag.T @ unlikely[:, 0], tag.T @ unlikely[:, 1:])

    found = {(gives, late): weigh(gives, late) for gives in (False, True) for late in (False, True)}
    usual = np.array(
        [*(soft if GRASP_COMPLIANCE in told else stiff), LATE_SPREAD if LATENESS in told else delay_spread]
    )
    if TAG_OFFSET in told:  # it is as open as where a grasp is
        places, known = np.column_stack([places, tag]), np.append(known, np.full(len(TAG), FREE_PLACE))
    mean, wide = _least_squares(laws, places, shifted, usual, noise)
    # No hold gives way against the force: what looks like that is chance, and is no alarm.
    p_value = one_sided(mean, wide, noise.count)
    off = _misplaced(np.column_stack([places, laws]), shifted, variance, np.concatenate([known, usual]))
    return GripEvidence(found, unless_unbelievable(p_value, off), wide)


def _laws(grips: GripTrack) -> tuple[Array, Array, Array]:
    """Return designs (2 N, 3) of what is learned, (2 N, 4 G + 2) of the grasps' places, and what was seen (2 N,)."""
    size = np.hypot(*grips.force.T)[:, None]
    laws = np.stack([grips.force, grips.force / (size + SOFT_FORCE), grips.velocity], -1)
    belongs = (grips.grasp[:, None] == np.arange(grips.grasp.max() + 1)).astype(float)
    still = np.einsum("ng,ij->nigj", belongs, np.eye(2)).reshape(len(belongs), 2, -1)
    turned = np.einsum("ng,nij->nigj", belongs, plane_rotations(grips.turn)).reshape(len(belongs), 2, -1)
    places = np.concatenate([still, turned, plane_rotations(-grips.heading)], -1)
    return laws.reshape(-1, 3), places.reshape(len(laws) * 2, -1), grips.place.reshape(-1)


def _tag_law(grips: GripTrack) -> Array:
    """Return the design (2 N, 3) of a tag's offset: the seen contact's way off, turned as the gripper is less now."""
    first = np.searchsorted(grips.grasp, grips.grasp)
    swing = plane_rotations(grips.turn - grips.turn[first]) - np.eye(2)
    lever = np.stack([-grips.contact[:, 1], grips.contact[:, 0]], -1)[..., None]
    off = np.concatenate([np.broadcast_to(np.eye(2), (len(lever), 2, 2)), lever], -1)
    return np.asarray((swing @ off).reshape(-1, 3), dtype=np.float64)


def _place_spread(columns: int) -> Array:
    """Return (4 G + 2,) the prior's standard deviations of what says where the grasps are [m]."""
    grasps = (columns - 2) // 2
    return np.concatenate([np.full(grasps, FREE_PLACE), np.full(grasps, POINT_SPREAD), np.full(2, CAMERA_SPREAD)])


def _least_squares(laws: Array, places: Array, seen: Array, usual: Array, noise: GripNoise) -> tuple[Array, Array]:
    """Return what the laws explain beyond the grasps' places (3,), and its covariance if all is as usual (3, 3)."""
    own, size, _ = np.linalg.svd(places, full_matrices=False)
    own = own[:, size > RANK * size[0]]
    free = laws - own @ (own.T @ laws)
    mean, _, _, _ = np.linalg.lstsq(free, seen - own @ (own.T @ seen), rcond=None)
    covariance = noise.rest / noise.count * np.linalg.pinv(free.T @ free) + np.diag(usual**2)
    return np.asarray(mean, dtype=np.float64), np.asarray(covariance, dtype=np.float64)


def _misplaced(design: Array, seen: Array, variance: float, prior: Array) -> float:
    """Return the chance that grippers' points and camera are so far from where they are told to be (chi-square).

    A tag that is glued on with an offset moves every contact alike, a gripper's frame that is told wrongly its point:
    both show as errors of the places that nobody would believe, whether or not a law of the library has them.

    Args:
        design: (2 N, K) of the grasps' places and of what is learned, whitened.
        seen: (2 N,).
        variance: of the whitened noise [m^2].
        prior: (K,) standard deviations.
    """
    known = prior < FREE_PLACE
    known[-LEARNED:] = False
    other = ~known
    precision, pull = design.T @ design / variance, design.T @ seen / variance
    gain = np.linalg.solve(
        precision[np.ix_(other, other)] + np.diag(prior[other] ** -2.0), precision[np.ix_(other, known)]
    )
    root = np.diag(prior[known])
    # In deviations of what is believed; others are put in at their best.
    information = root @ (precision[np.ix_(known, known)] - precision[np.ix_(known, other)] @ gain) @ root
    off = root @ (pull[known] - gain.T @ pull[other])
    size, axes = np.linalg.eigh(information)
    shown = size > SHOWS
    statistic = float(np.sum((axes.T @ off)[shown] ** 2 / (size * (1.0 + size))[shown]))
    return float(chi2.sf(statistic, int(shown.sum()))) if shown.any() else 1.0


def beside_motion(fitted: Fitted, grip: GripEvidence | None) -> Fitted:
    """Return a fitted hypothesis with what it makes of the grippers' poses counted."""
    if grip is None:
        return fitted
    beside = grip.beside(fitted.hypothesis, fitted.peak.coordinates[0], fitted.peak.covariance(0))
    return replace(fitted, beside=beside)


def moved_on(tried: Sequence[Fitted], grounds: Sequence[Fitted], grip: GripEvidence | None) -> list[Fitted]:
    """Return what was tried with what each makes of the grippers' poses, where fits have got further.

    A hold that gives way is learned from those alone, beside a motion as that was fitted: where what it was laid on has
    come to a better top since, it is laid on that.

    Args:
        tried: hypotheses, in the order that is kept.
        grounds: baselines.
        grip: what the grippers' poses say; None where none was seen.
    """
    if grip is None:
        return list(tried)
    found = [beside_motion(each, grip) for each in tried]
    ground = {each.hypothesis.variant: each for each in sorted([*grounds, *found], key=lambda each: each.evidence)}

    def again(each: Fitted) -> Fitted:
        below = ground.get(each.hypothesis.variant.removesuffix(HELD_SOFTLY))
        if below is None or not each.hypothesis.variant.endswith(HELD_SOFTLY):
            return each
        anew = gives_way(below, grip)
        return anew if anew.evidence > each.evidence else each

    return [again(each) for each in found]


def gives_way(fitted: Fitted, grip: GripEvidence) -> Fitted:
    """Return a fitted hypothesis with a hold that gives way added: what it adds is learned from other data.

    Args:
        fitted: the hypothesis without.
        grip: what the grippers' poses say.
    """
    peak, hypothesis = fitted.peak, fitted.hypothesis
    mean, covariance = grip.gives.mean[: PLAYS + 1], grip.gives.covariance[: PLAYS + 1, : PLAYS + 1]
    base = hypothesis.base.copy()
    base[[COLUMN[p.column] for p in PARAMETERS]] = mean
    richer = replace(
        hypothesis,
        effects=(*hypothesis.effects, GRASP_COMPLIANCE),
        variant=f"{hypothesis.variant}{HELD_SOFTLY}",
        parameters=(*hypothesis.parameters, *PARAMETERS),
        base=base,
    )
    r, k, more = peak.reduced, len(hypothesis.parameters), ((0, 0), (0, 0), (0, len(PARAMETERS)))
    matrix = np.pad(r.matrix, (*more, more[-1]))
    precision = np.linalg.inv(covariance) - np.diag([p.spread**-2.0 for p in PARAMETERS])
    matrix[:, 0, k:, k:] = precision / np.maximum(peak.weight[:, 0, None, None], 1e-12)
    reduced = Reduced(matrix, np.pad(r.vector, more), np.pad(r.gain, ((0, 0), *more)), r.shift, r.log_det)
    coordinates = np.column_stack([peak.coordinates, np.tile(mean, (len(peak.coordinates), 1))])
    objective = replace(peak.objective, hypothesis=richer)
    extended = replace(peak, objective=objective, coordinates=coordinates, reduced=reduced)
    added = beside_motion(replace(fitted, hypothesis=richer, peak=extended, short=None, shorter=None), grip)
    if fitted.shorter is None:
        return added
    return replace(added, shorter=gives_way(replace(fitted, peak=fitted.shorter, shorter=None), grip).peak)
