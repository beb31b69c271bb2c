"""Hypotheses fitted over windows that grow, and held against windows that were left out of the fit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts, cut_windows, held_out_blocks, inside, touching
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.effect import Scene
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import Peak, climb
from pbrl_mismatch.search.heldout import Score, held_out_score
from pbrl_mismatch.search.hypothesis import BELIEVED, Hypothesis
from pbrl_mismatch.search.objective import Objective, scattered
from pbrl_mismatch.search.path.along import lay_along
from pbrl_mismatch.search.path.climb import climb_along
from pbrl_mismatch.search.path.ground import FINE, Traced, traced_score
from pbrl_mismatch.search.path.turned import turned
from pbrl_model.fitting.guesses import axle, circle, pivot

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BASELINE_STARTS, BASELINE_STEPS, KEPT_OF_BASELINE = 20, 8, 4
"""A baseline is climbed along the path from so many starts, in so many steps; so many go on to windows."""
WHOLE = 4
"""Steps from the best of the kept windows to that of all."""
MOVING = 0.02
"""Slower than this [m/s] is not taken for the speed of a push."""


@dataclass(frozen=True)
class Split:
    """The longest windows split for a prediction of what was not fitted to.

    Attributes:
        kept: windows to fit to.
        scored: windows that are held out.
        both: those and the kept.
        told: the same time in windows of one block's length, whose errors are told.
        is_kept, is_scored: (W,) of all windows of this length.
    """

    kept: Cuts
    scored: Cuts
    both: Cuts
    told: Cuts
    is_kept: Mask
    is_scored: Mask


@dataclass(frozen=True)
class Stages:
    """Windows of growing length.

    Attributes:
        fitted: windows by length.
        splits: of each length for held-out prediction; none where there is nothing to spare.
    """

    fitted: tuple[Cuts, ...]
    splits: tuple[Split, ...]

    @property
    def split(self) -> Split | None:
        """Return that of the longest windows, or None."""
        return self.splits[-1] if self.splits else None

    def without_longest(self) -> Stages:
        """Return the others."""
        return Stages(self.fitted[:-1], self.splits[:-1])


@dataclass(frozen=True)
class Fitted:
    """One hypothesis after its fit.

    Attributes:
        hypothesis: what was fitted.
        peak: its best point alone, over the longest windows.
        score: on what was held out of a fit to the rest, or None where that was not done.
        short: (K,) best coordinates over the shortest windows, which what is left out bends least; None: not kept.
        shorter: its best point alone over the next shorter windows; None: not kept.
        beside: log evidence of what the grippers' poses say beside the motion [nat].
        traced: its fit along the recorded path, over the longest windows; None: not made, or of other windows.
        draws: (n, K) coordinates that the recording allows; None: not drawn, the peak's Gaussian stands for them.
    """

    hypothesis: Hypothesis
    peak: Peak
    score: Score | None
    short: Array | None = None
    shorter: Peak | None = None
    beside: float = 0.0
    traced: Traced | None = None
    draws: Array | None = None

    @property
    def row(self) -> Array:
        """Return (WIDTH,) the parameter row."""
        return self.hypothesis.rows(self.peak.coordinates)[0]

    @property
    def evidence(self) -> float:
        """Return the log evidence [nat].

        Simulated windows and the recorded path are two approximations of one integral: a simulation runs away where
        feet stick and let go, the path is as uncertain as its smoothing. Both err by losing, so that the better counts.
        """
        return self.of_motion + self.beside

    @property
    def of_motion(self) -> float:
        """Return the part of the log evidence that is not beside the motion [nat]."""
        return self.simulated if self.traced is None else max(self.simulated, self.traced.evidence)

    @property
    def simulated(self) -> float:
        """Return the log evidence of the motion over simulated windows [nat]."""
        return float(self.peak.evidence[0])

    def over_shorter(self) -> Fitted:
        """Return this as it was over the next shorter windows, if that is known."""
        return self if self.shorter is None else replace(self, peak=self.shorter, shorter=None, traced=None)

    @property
    def noise_scale(self) -> float:
        """Return the scale of the noise that it needs, at least one."""
        simulated = float(self.peak.sigma[0])
        return simulated if self.traced is None else min(simulated, self.traced.noise_scale)

    @property
    def usual_scale(self) -> float:
        """Return the scale of the noise that its windows need as a rule: their geometric mean, at least one.

        It is what the likelihood pays for. A window in which a simulation runs away, as where a contact is met a moment
        early, counts for the one that it is; in the root mean square it would count for all.
        """
        paid = self._paid if self.traced is None else min(self._paid, self.traced.paid)
        return math.exp(paid / float(self.peak.objective.counts.sum()))

    @property
    def unexplained(self) -> float:
        """Return how much likelier its poses would be, were what it leaves of them no more than noise [nat].

        Noise alone scatters, and the scale of a window follows it upwards: that much is not counted.
        """
        paid = self._paid if self.traced is None else min(self._paid, self.traced.paid)
        return max(paid - sum(map(scattered, self.peak.objective.counts)), 0.0)

    @property
    def _paid(self) -> float:
        """Return what simulated windows pay by their scales [nat]."""
        return -0.5 * float(self.peak.objective.counts @ np.log(self.peak.weight[0]))


def cut_stages(track: Track, options: DiagnoseOptions) -> Stages:
    """Cut a track into windows of every length, with blocks held out where it is long enough.

    Raises:
        ModelError: no window has enough poses.
    """
    cut = [cut_windows(track, length) for length in options.windows]
    fitted = tuple(cut)
    blocks = held_out_blocks(track, options.block, options.every)
    longest, splits = cut_windows(track, options.block), []
    for cuts in cut:
        out, within, touched = inside(longest, blocks), inside(cuts, blocks), touching(cuts, blocks)
        if not (out.any() and within.any()) or touched.all():
            return Stages(fitted, ())
        kept, scored, both = cuts.take(~touched), cuts.take(within), cuts.take(within | ~touched)
        splits.append(Split(kept, scored, both, longest.take(out), ~touched, within))
    return Stages(fitted, tuple(splits))


def scene_of(track: Track, row: Array) -> Scene:
    """Return what priors are scaled by, with the mass of a baseline's row where none was told.

    The told one counts where there is one: a baseline that lacks what holds a body back makes it many times heavier.
    """
    lower, upper = track.outline.min(axis=0), track.outline.max(axis=0)
    half = 0.5 * (upper - lower)
    size = float(np.hypot(*half))
    low, high = track.seen[:, :2].min(axis=0), track.seen[:, :2].max(axis=0)
    force = np.hypot(track.felt[:, 0], track.felt[:, 1])
    speed = np.hypot(track.seen[:, 3], track.seen[:, 4])
    moving = speed > MOVING
    return Scene(
        middle=0.5 * (low + high),
        reach=0.5 * (high - low) + size,
        centroid=0.5 * (lower + upper),
        com=track.body[1:3],
        half=half,
        mass=float(row[COLUMN["mass"]]) if math.isnan(track.nominal_mass) else track.nominal_mass,
        force=max(float(np.sqrt(np.mean(force**2))), 0.5),
        speed=max(float(np.sqrt(np.mean(speed[moving] ** 2))) if moving.any() else 0.0, MOVING),
        start=float(track.clock[0]),
        seconds=float(track.clock[-1] - track.clock[0]),
    )


def fit_from(hypothesis: Hypothesis, stages: Stages, starts: Array, options: DiagnoseOptions) -> Fitted:
    """Climb from starts (n, K) over windows that grow, keeping the best."""
    u, peak, short, shorter = starts[: options.candidates], None, None, None
    for stage, (cuts, iterations) in enumerate(zip(stages.fitted, options.iterations, strict=True)):
        rough = stage + 2 < len(stages.fitted)
        shorter = peak
        peak = climb(Objective(hypothesis, cuts, options.sensor_floor), u, iterations=iterations, rough=rough)
        short = peak.coordinates[peak.best] if short is None else short
        if stage + 1 < len(stages.fitted):
            u = tops(peak, options.keep[stage + 1])
    if peak is None:
        raise MismatchError("search: expected at least one length of window, got none")
    return Fitted(hypothesis, alone(peak), None, short, None if shorter is None else alone(shorter))


def tops(peak: Peak, count: int) -> Array:
    """Return the coordinates (n, K) of so many of the likeliest points of a climb that are apart, best first."""
    return apart(peak.coordinates[peak.ranked], peak.objective.hypothesis.spread, count)


def apart(coordinates: Array, spread: Array, count: int) -> Array:
    """Return the first points of a list, leaving out those next to one that is already in."""
    return coordinates[apart_rows(coordinates, spread, count)]


def apart_rows(coordinates: Array, spread: Array, count: int) -> NDArray[np.int64]:
    """Return which points of a list `apart` returns."""
    kept: list[int] = []
    for k, point in enumerate(coordinates):
        if all(np.max(np.abs(point - coordinates[other]) / spread) > 0.02 for other in kept):
            kept.append(k)
        if len(kept) == count:
            break
    return np.array(kept, dtype=np.int64)


def fit_baseline(
    rng: np.random.Generator, track: Track, hypothesis: Hypothesis, stages: Stages, options: DiagnoseOptions
) -> Fitted:
    """Fit one kind of baseline from draws of its prior and from what the motion alone suggests.

    What it lacks bends what is believed of a body, and then the rest: it is climbed a second time from what it is with
    that held, which is often better.
    """
    starts = _baseline_starts(rng, track, hypothesis)
    mass = float(hypothesis.base[COLUMN["mass"]])
    along = lay_along(cut_windows(track, max(options.windows)), track.seen, mass, options.sensor_floor, FINE)

    def climbed(kind: Hypothesis, starts: Array) -> Fitted:
        found = climb_along(along, kind, starts, BASELINE_STEPS)
        order = np.argsort(-found.evidence, kind="stable")
        kept = turned(along, kind, apart(found.coordinates[order], kind.spread, KEPT_OF_BASELINE))
        return fit_from(kind, stages, kept, options.model_copy(update={"candidates": len(kept)}))

    found, held = climbed(hypothesis, starts), hypothesis.fixed(BELIEVED)
    if len(held.parameters) in (0, len(hypothesis.parameters)):
        return found
    firm = climbed(held, held.coordinates(hypothesis.rows(starts)))
    reached = [firm.peak.coordinates[0], *([] if firm.short is None else [firm.short])]
    again = [hypothesis.laid_on(held, each, hypothesis.mean[None]) for each in reached]
    return max((found, fit_from(hypothesis, stages, np.concatenate(again), options)), key=lambda each: each.evidence)


def _baseline_starts(rng: np.random.Generator, track: Track, hypothesis: Hypothesis) -> Array:
    """Return starts (n, K) of a baseline: draws of its prior, some with a wheel where the motion has an axle."""
    starts, columns = hypothesis.sample_felt(rng, BASELINE_STARTS), hypothesis.columns
    if "wheel_x" in columns:
        x, y = columns.index("wheel_x"), columns.index("wheel_y")
        com = track.body[1:3]
        starts[:3, [x, y]] = pivot(track.motions, com)
        angle, place = axle(track.motions, com)
        starts[3:6, [x, y]] = place
        if "wheel_theta" in columns:
            starts[3:6, columns.index("wheel_theta")] = angle
    return starts


def hinge_guess(track: Track) -> dict[str, float] | None:
    """Return the circle that recorded positions lie on, as a hinge's first guess; None for a line."""
    found = circle(track.motions)
    if found is None:
        return None
    centre, radius = found
    return {"hinge_x": float(centre[0]), "hinge_y": float(centre[1]), "hinge_radius": radius}


def likeliest_first(fits: Iterable[Fitted]) -> list[Fitted]:
    """Return hypotheses, the highest evidence first; what is equal stays in its order."""
    return sorted(fits, key=lambda each: -each.evidence)


def alone(peak: Peak) -> Peak:
    """Return the best of its points."""
    return peak.take(np.array([peak.best]))


def judged(fitted: Fitted, stages: Stages, options: DiagnoseOptions, *, even: bool = False) -> Fitted:
    """Fit anew to what is not held out, and score how the rest is predicted.

    The fit begins at the best points of all windows, so that what is compared is how well a law predicts and not how
    well it is found in less.

    Args:
        fitted: to all windows.
        stages: windows.
        options: settings.
        even: fit by common least squares, as one does who suspects nothing.
    """
    if stages.split is None:
        return fitted
    starts = [fitted.peak.coordinates[0]] + ([fitted.short] if fitted.short is not None else [])
    if fitted.traced is not None and len(fitted.traced.coordinates) == len(starts[0]):
        starts.append(fitted.traced.coordinates)
    split, begun = stages.split, fitted.peak.nuisance[:1]
    objective = Objective(fitted.hypothesis, split.kept, options.sensor_floor, even)
    # Where a contact is met or missed by how a window begins, no climb leads from the one to the other.
    at_rest = objective.at_rest(len(starts))
    begins = np.concatenate([at_rest, at_rest + begun[:, split.is_kept]])
    peak = climb(objective, np.array(starts * 2), begins, iterations=options.iterations[-1])
    best = alone(peak)
    score = held_out_score(best, 0, split.scored, split.told, begun[:, split.is_scored])
    # Given the kept windows, the others are as likely as all over the kept: the same number by another way.
    begins = begun.repeat(2, axis=0)
    begins[:, split.is_kept], begins[0, split.is_scored] = best.nuisance, 0.0
    whole = climb(
        replace(objective, cuts=split.both),
        best.coordinates.repeat(2, axis=0),
        begins[:, split.is_kept | split.is_scored],
        iterations=WHOLE,
    )
    others = [float(whole.evidence[whole.best] - best.evidence[0])]
    if fitted.traced is not None:
        others.append(traced_score(fitted.traced, split.kept, split.both, options.sensor_floor))
    score = replace(score, log_score=max(score.log_score, *others))
    return replace(fitted, score=score)
