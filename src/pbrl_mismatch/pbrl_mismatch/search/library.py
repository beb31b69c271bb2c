"""Every effect of the library fitted to one track, beside the baseline, with evidence and held-out score."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts, cut_windows, held_out_blocks, inside, touching
from pbrl_mismatch.data.residual import residual_wrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.effect import Scene
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import Peak, climb
from pbrl_mismatch.search.contacts import contact_points, with_contacts
from pbrl_mismatch.search.heldout import Score, held_out_score
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.screen import Lacking, screen
from pbrl_model.fitting.guesses import axle, circle, pivot

Array = NDArray[np.float64]

IN_ANOTHER_CHANNEL = frozenset({"grasp_compliance"})
"""Effects that the motion of the body does not show where the wrist's force is known."""
AS_GOOD = 40.0
"""Variants of an effect that are worse than its best by more [nat] are given up."""
MOVING = 0.02
"""Slower than this [m/s] is not taken for the speed of a push."""


@dataclass(frozen=True)
class Stages:
    """Windows of growing length to fit, and what is held out.

    Attributes:
        fitted: windows by length, held-out blocks cut away.
        heldout: windows of one block's length, or None where there is nothing to spare.
    """

    fitted: tuple[Cuts, ...]
    heldout: Cuts | None


@dataclass(frozen=True)
class Fitted:
    """One hypothesis after its fit.

    Attributes:
        hypothesis: what was fitted.
        peak: its best point alone, over the longest windows.
        score: on what was held out, or None.
        short: (K,) best coordinates over the shortest windows, which what is left out bends least; None: not kept.
    """

    hypothesis: Hypothesis
    peak: Peak
    score: Score | None
    short: Array | None = None

    @property
    def row(self) -> Array:
        """Return (WIDTH,) the parameter row."""
        return self.hypothesis.rows(self.peak.coordinates)[0]

    @property
    def evidence(self) -> float:
        """Return the log evidence of the fitted windows, and of the held-out ones given those [nat]."""
        return float(self.peak.evidence[0]) + (self.score.log_score if self.score else 0.0)

    @property
    def noise_scale(self) -> float:
        """Return the scale of the noise that it needs, at least one."""
        return float(self.peak.sigma[0])


def cut_stages(track: Track, options: DiagnoseOptions) -> Stages:
    """Cut a track into windows of every length, with blocks held out where it is long enough.

    Raises:
        ModelError: no window has enough poses.
    """
    blocks = held_out_blocks(track, options.block, options.every)
    longest = cut_windows(track, options.block)
    out = inside(longest, blocks)
    if not out.any() or out.all():
        return Stages(tuple(cut_windows(track, length) for length in options.windows), None)
    fitted = []
    for length in options.windows:
        cuts = cut_windows(track, length)
        fitted.append(cuts.take(~touching(cuts, blocks)))
    if any(len(cuts) == 0 for cuts in fitted):
        return Stages(tuple(cut_windows(track, length) for length in options.windows), None)
    return Stages(tuple(fitted), longest.take(out))


def scene_of(track: Track, row: Array) -> Scene:
    """Return what priors are scaled by, with the mass of a baseline's row."""
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
        half=half,
        mass=float(row[COLUMN["mass"]]),
        force=max(float(np.sqrt(np.mean(force**2))), 0.5),
        speed=max(float(np.sqrt(np.mean(speed[moving] ** 2))) if moving.any() else 0.0, MOVING),
        start=float(track.clock[0]),
        seconds=float(track.clock[-1] - track.clock[0]),
    )


def fit_from(hypothesis: Hypothesis, stages: Stages, starts: Array, options: DiagnoseOptions) -> Fitted:
    """Climb from starts (n, K) over windows that grow, keeping the best; judge on what was held out."""
    u, peak, short = starts[: options.keep[0]], None, None
    for stage, (cuts, iterations) in enumerate(zip(stages.fitted, options.iterations, strict=True)):
        peak = climb(Objective(hypothesis, cuts, options.sensor_floor), u, iterations=iterations)
        order = np.argsort(-peak.evidence, kind="stable")
        short = peak.coordinates[order[0]] if short is None else short
        if stage + 1 < len(stages.fitted):
            u = _apart(peak.coordinates[order], hypothesis.spread, options.keep[stage + 1])
    if peak is None:
        raise MismatchError("search: expected at least one length of window, got none")
    return replace(_judged(hypothesis, peak, stages), short=short)


def _apart(coordinates: Array, spread: Array, count: int) -> Array:
    """Return the first points of a list, leaving out those next to one that is already in."""
    kept: list[Array] = []
    for point in coordinates:
        if all(np.max(np.abs(point - other) / spread) > 0.02 for other in kept):
            kept.append(point)
        if len(kept) == count:
            break
    return np.array(kept)


def fit_baseline(
    rng: np.random.Generator, track: Track, hypothesis: Hypothesis, stages: Stages, options: DiagnoseOptions
) -> Fitted:
    """Fit one kind of baseline from draws of its prior and from what the motion alone suggests."""
    starts = hypothesis.sample_prior(rng, 2 * options.keep[0] + 6)
    columns = hypothesis.columns
    for k, name in enumerate(columns):
        if name in ("mass", "inertia_factor", "delay"):
            starts[:, k] = hypothesis.mean[k]
    if "wheel_x" in columns:
        x, y = columns.index("wheel_x"), columns.index("wheel_y")
        com = track.body[1:3]
        starts[:3, [x, y]] = pivot(track.motions, com)
        angle, place = axle(track.motions, com)
        starts[3:6, [x, y]] = place
        if "wheel_theta" in columns:
            starts[3:6, columns.index("wheel_theta")] = angle
    wide = options.model_copy(update={"keep": (len(starts), *options.keep[1:])})
    return fit_from(hypothesis, stages, starts, wide)


def hinge_guess(track: Track) -> dict[str, float] | None:
    """Return the circle that recorded positions lie on, as a hinge's first guess; None for a line."""
    found = circle(track.motions)
    if found is None:
        return None
    centre, radius = found
    return {"hinge_x": float(centre[0]), "hinge_y": float(centre[1]), "hinge_radius": radius}


def starts_of(
    rng: np.random.Generator,
    name: str,
    variant: int,
    base: Fitted,
    lacking: Sequence[Lacking],
    options: DiagnoseOptions,
) -> tuple[Hypothesis, Array]:
    """Return one variant of an effect on top of a fitted hypothesis, and where to climb from (n, K).

    Every way of reading what the base lacks gives its share of the starts.
    """
    effect = EFFECTS[name]
    hypothesis = base.hypothesis.with_effect(effect, scene_of(lacking[0].track, base.row), variant)
    count = options.draws * len(effect.variants[variant]) // 3
    starts = []
    for each in lacking:
        draws = hypothesis.sample_prior(rng, max(count // 4 if effect.remembers else count, 8))
        for k, column in enumerate(hypothesis.columns):
            if column in base.hypothesis.columns:
                draws[:, k] = each.coordinates[base.hypothesis.columns.index(column)]
        if effect.touches is not None:
            x, y, radius = (hypothesis.columns.index(column) for column in effect.touches)
            draws = with_contacts(rng, draws, (x, y, radius), *contact_points(each.track, each.residual))
        ranked, misfit = screen(each, hypothesis, effect, draws)
        share = -(-options.keep[0] // len(lacking))
        starts.append(_apart(ranked[np.argsort(misfit, kind="stable")], hypothesis.spread, share))
    return hypothesis, np.concatenate(starts)


def lacking_of(track: Track, fitted: Fitted) -> list[Lacking]:
    """Return what a fitted hypothesis lacks along the motion, at its best and at its best over short windows."""
    ways = [fitted.peak.coordinates[0]]
    if fitted.short is not None:
        ways.append(fitted.short)
    rows = [fitted.hypothesis.rows(way[None])[0] for way in ways]
    return [
        Lacking(track, fitted.hypothesis, way, residual_wrench(track, row)) for way, row in zip(ways, rows, strict=True)
    ]


def search_library(
    seed: np.random.SeedSequence, track: Track, bases: Sequence[Fitted], stages: Stages, options: DiagnoseOptions
) -> list[Fitted]:
    """Fit every effect on top of every base, in threads; the bytes do not depend on how many.

    Args:
        seed: of every draw.
        track: what was recorded.
        bases: fitted baselines, or hypotheses that already have effects.
        stages: windows.
        options: settings.
    """
    lacking = [lacking_of(track, base) for base in bases]
    jobs = [
        (name, variant, base, lack)
        for base, lack in zip(bases, lacking, strict=True)
        for name in options.effects
        if name not in base.hypothesis.effects and name not in IN_ANOTHER_CHANNEL
        for variant in range(len(EFFECTS[name].variants))
    ]
    seeds = seed.spawn(len(jobs))

    def begin(k: int) -> tuple[Hypothesis, Array]:
        name, variant, base, lack = jobs[k]
        return starts_of(np.random.default_rng(seeds[k]), name, variant, base, lack, options)

    with ThreadPoolExecutor(options.workers) as pool:
        running = list(pool.map(begin, range(len(jobs))))
        for stage in range(len(stages.fitted)):
            peaks = list(pool.map(partial(_climbed, stages.fitted[stage], options.iterations[stage], options), running))
            if stage + 1 == len(stages.fitted):
                break
            chosen = _survivors([hypothesis for hypothesis, _ in running], peaks, options.survivors[stage])
            running = [
                (
                    running[k][0],
                    _apart(_ordered(peaks[k]).coordinates, running[k][0].spread, options.keep[stage + 1]),
                )
                for k in chosen
            ]
        return list(pool.map(lambda each: _judged(each[0][0], each[1], stages), zip(running, peaks, strict=True)))


def _climbed(cuts: Cuts, iterations: int, options: DiagnoseOptions, job: tuple[Hypothesis, Array]) -> Peak:
    return climb(Objective(job[0], cuts, options.sensor_floor), job[1], iterations=iterations)


def _ordered(peak: Peak) -> Peak:
    return peak.take(np.argsort(-peak.evidence, kind="stable"))


def _judged(hypothesis: Hypothesis, peak: Peak, stages: Stages) -> Fitted:
    best = peak.take(np.array([peak.best]))
    score = held_out_score(best, 0, stages.heldout) if stages.heldout is not None else None
    return Fitted(hypothesis, best, score)


def _survivors(hypotheses: Sequence[Hypothesis], peaks: Sequence[Peak], most: int) -> list[int]:
    """Return which hypotheses go on: the likeliest of each of so many effects, and others that are as good."""
    evidence = np.array([float(np.nan_to_num(peak.evidence, nan=-np.inf).max()) for peak in peaks])
    best: dict[tuple[str, ...], float] = {}
    for hypothesis, value in zip(hypotheses, evidence, strict=True):
        best[hypothesis.effects] = max(best.get(hypothesis.effects, -np.inf), float(value))
    ranked = sorted(best, key=lambda effects: -best[effects])[:most]
    return [
        k
        for k, hypothesis in enumerate(hypotheses)
        if hypothesis.effects in ranked and evidence[k] >= best[hypothesis.effects] - AS_GOOD
    ]
