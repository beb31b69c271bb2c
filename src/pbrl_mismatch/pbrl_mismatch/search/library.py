"""Every effect of the library fitted to one track, beside the baseline, with evidence and held-out score."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts, cut_windows
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import Peak, climb
from pbrl_mismatch.search.fitted import Fitted, Stages, alone, apart, scene_of
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.climb import PathPeak, climb_along
from pbrl_mismatch.search.path.contacts import contact_points, with_contacts
from pbrl_mismatch.search.path.ground import Ground, ground_of, traced
from pbrl_mismatch.search.path.pulls import with_pulls
from pbrl_mismatch.search.path.rhythms import with_rhythms
from pbrl_mismatch.search.path.screen import screen
from pbrl_mismatch.search.predictive import BELIEVED

Array = NDArray[np.float64]

IN_ANOTHER_CHANNEL = frozenset({"grasp_compliance"})
"""Effects that the motion of the body does not show where the wrist's force is known."""
AS_GOOD = 40.0
"""Variants of an effect that are worse than its best by more [nat] are given up."""
CLOSE = (20.0, 10.0)
"""Effects this near to the likeliest [nat] all go on: from the path to windows, and from those to longer ones."""
KEPT = frozenset({"wheel_x", "wheel_y", "wheel_theta", "hinge_x", "hinge_y", "hinge_radius"})
"""Columns of a ground that every start has as the ground has them."""
BENT = BELIEVED | {"mu_x", "mu_y"}
"""Columns of a ground that bend to what it lacks: half of the starts have them as they were believed to be."""
RESTLESS = 1.12
"""Where no law needs less than this scale of the noise along the path, bodies stick: dry friction is then simulated
whatever the path says of it."""
UNTOLD = 50.0
"""Where a ground is likelier along its path than simulated by more [nat], every effect is simulated: friction stands in
for what holds the body, and its path alone does not tell them apart."""
LEADING = 3
"""So many effects that are the likeliest along the path are simulated to the end."""
BEGUN, CLIMBED = 3, 5
"""Steps along the path of all starts of a hypothesis, and of the best of them."""


def starts_of(
    rng: np.random.Generator, name: str, variant: int, base: Fitted, ground: Ground, options: DiagnoseOptions
) -> PathPeak:
    """Return one variant of an effect on top of a fitted hypothesis, climbed along the path, likeliest first.

    Args:
        rng: of the draws.
        name: effect.
        variant: which of its sub-models.
        base: what it is laid on.
        ground: the same along its path.
        options: settings.
    """
    effect = EFFECTS[name]
    track, lacks = ground.cuts.track, ground.lacks
    hypothesis = base.hypothesis.with_effect(effect, scene_of(track, base.row), variant)
    drawn = [name for name in effect.variants[variant] if name not in effect.linear]
    count = max(options.draws * len(drawn) // 3, 2)
    draws = hypothesis.sample_prior(rng, max(count // 4, 8) if effect.remembers else count)
    afresh = np.arange(len(draws)) % 2 == 1
    for k, column in enumerate(hypothesis.columns):
        if column in base.hypothesis.columns:
            # What an effect did, the ground has taken on as far as it could: half begin at what was believed before.
            draws[:, k] = np.where(
                afresh & (column not in KEPT),
                hypothesis.mean[k] if column in BENT else draws[:, k],
                ground.coordinates[base.hypothesis.columns.index(column)],
            )
    if effect.touches is not None:
        x, y, radius = (hypothesis.columns.index(column) for column in effect.touches)
        draws = with_contacts(rng, draws, (x, y, radius), *contact_points(track, lacks))
    if effect.pulls:
        x, y, *at = (hypothesis.columns.index(name) for name in effect.pulls if name in hypothesis.columns)
        point = (at[0], at[1]) if at else None
        cord = hypothesis.columns.index(effect.cord) if effect.cord else None
        draws = with_pulls(rng, draws, (x, y), point, cord, track, lacks)
    if effect.rhythm is not None and effect.rhythm[0] in hypothesis.columns:
        frequency, phase = (hypothesis.columns.index(name) for name in effect.rhythm)
        draws = with_rhythms(rng, draws, frequency, phase, lacks, track.gyration)
    ranked, misfit = screen(ground, hypothesis, effect, draws)
    halves = [half for half in (~afresh, afresh) if half.any()]
    starts = np.concatenate([_best_of(ranked, misfit, half, hypothesis, options) for half in halves])
    along = ground.fine.along if effect.remembers else ground.climbed
    begun = climb_along(along if effect.remembers else ground.first.along, hypothesis, starts, BEGUN)
    best = begun.coordinates[np.argsort(-begun.evidence, kind="stable")]
    return climb_along(along, hypothesis, apart(best, hypothesis.spread, options.keep[0]), CLIMBED)


def _best_of(
    draws: Array, misfit: Array, among: NDArray[np.bool_], hypothesis: Hypothesis, options: DiagnoseOptions
) -> Array:
    """Return the best draws among some of them."""
    order = np.argsort(misfit[among], kind="stable")
    return apart(draws[among][order], hypothesis.spread, -(-options.candidates // 2))


def search_library(
    seed: np.random.SeedSequence, track: Track, bases: Sequence[Fitted], stages: Stages, options: DiagnoseOptions
) -> list[Fitted]:
    """Fit every effect on top of every base, in threads; the bytes do not depend on how many.

    All are climbed along the recorded path, over the longest windows; the likeliest are then simulated, over windows
    that grow.

    Args:
        seed: of every draw.
        track: what was recorded.
        bases: fitted baselines, or hypotheses that already have effects.
        stages: windows.
        options: settings.
    """
    longest = cut_windows(track, max(options.windows))
    grounds = [ground_of(each.hypothesis, each.peak.coordinates[0], longest, options.sensor_floor) for each in bases]
    for ground in grounds:
        _ = ground.climbed, ground.first, ground.fine
    jobs = [
        (name, variant, base, ground)
        for base, ground in zip(bases, grounds, strict=True)
        for name in options.effects
        if name not in base.hypothesis.effects and name not in IN_ANOTHER_CHANNEL and not _same(name, base, options)
        for variant in range(len(EFFECTS[name].variants))
    ]
    seeds = seed.spawn(len(jobs))

    def begin(k: int) -> PathPeak:
        return starts_of(np.random.default_rng(seeds[k]), *jobs[k], options)

    with ThreadPoolExecutor(options.workers) as pool:
        begun = list(pool.map(begin, range(len(jobs))))
        stands_in = any(_path_above_simulation(base) > UNTOLD for base in bases)
        most = len(EFFECTS) if stands_in else options.shortlist
        chosen = _survivors([each.hypothesis for each in begun], begun, most, CLOSE[0])
        if min(each.noise_scale for each in begun) > RESTLESS:
            chosen = sorted({*chosen, *(k for k, (name, *_) in enumerate(jobs) if EFFECTS[name].sticks)})
        running = [(begun[k].hypothesis, begun[k].coordinates) for k in chosen]
        first = _survivors([each.hypothesis for each in begun], begun, LEADING, 0.0)
        leading = {begun[k].hypothesis.variant for k in first}
        before: list[Peak | None] = [None] * len(running)
        for stage in range(len(stages.fitted)):
            rough = stage + 2 < len(stages.fitted)
            climbed = partial(_climbed, stages.fitted[stage], options.iterations[stage], options, rough)
            peaks = list(pool.map(climbed, running))
            if stage + 1 == len(stages.fitted):
                break
            chosen = _survivors([each for each, _ in running], peaks, options.survivors[stage], CLOSE[1])
            # What the path says of long windows, short ones cannot take back.
            chosen = sorted({*chosen, *(k for k, (each, _) in enumerate(running) if each.variant in leading)})
            before = [peaks[k] for k in chosen]
            running = [
                (
                    running[k][0],
                    apart(_ordered(peaks[k]).coordinates, running[k][0].spread, options.keep[stage + 1]),
                )
                for k in chosen
            ]
        done = [
            Fitted(job[0], alone(peak), None, None, None if shorter is None else alone(shorter))
            for job, peak, shorter in zip(running, peaks, before, strict=True)
        ]
        if len(stages.fitted) < len(options.windows):
            return done  # What is weighed are shorter windows than the path's.
        along = {each.hypothesis.variant: each.coordinates[0] for each in begun}
        starts = [np.array([along[each.hypothesis.variant], each.peak.coordinates[0]]) for each in done]
        return list(pool.map(partial(trace, longest, options), done, starts))


def trace(longest: Cuts, options: DiagnoseOptions, fitted: Fitted, starts: Array) -> Fitted:
    """Return a fitted hypothesis with its fit along the recorded path, from starts (n, K)."""
    return replace(fitted, traced=traced(fitted.hypothesis, starts, longest, options.sensor_floor))


def _path_above_simulation(base: Fitted) -> float:
    """Return how much likelier a hypothesis is along its path than simulated [nat]."""
    return base.traced.evidence - float(base.peak.evidence[0]) if base.traced is not None else 0.0


def _same(name: str, base: Fitted, options: DiagnoseOptions) -> bool:
    """Tell whether an effect on a base is what some baseline is: a first wheel is no second one."""
    wheels = [kind for kind in options.baseline if "wheel" in kind or "caster" in kind]
    return name == "second_wheel" and bool(wheels) and "wheel_x" not in base.hypothesis.columns


def _climbed(cuts: Cuts, iterations: int, options: DiagnoseOptions, rough: bool, job: tuple[Hypothesis, Array]) -> Peak:
    return climb(Objective(job[0], cuts, options.sensor_floor), job[1], iterations=iterations, rough=rough)


def _ordered(peak: Peak) -> Peak:
    return peak.take(np.argsort(-peak.evidence, kind="stable"))


def _survivors(
    hypotheses: Sequence[Hypothesis], peaks: Sequence[Peak | PathPeak], most: int, close: float
) -> list[int]:
    """Return which hypotheses go on: the likeliest of each of so many effects, and others that are as good."""
    evidence = np.array([float(np.nan_to_num(peak.evidence, nan=-np.inf).max()) for peak in peaks])
    best: dict[tuple[str, ...], float] = {}
    for hypothesis, value in zip(hypotheses, evidence, strict=True):
        best[hypothesis.effects] = max(best.get(hypothesis.effects, -np.inf), float(value))
    ranked = sorted(best, key=lambda effects: -best[effects])
    # Where all are close, more go on.
    ranked = [name for place, name in enumerate(ranked) if place < most or best[name] > best[ranked[0]] - close]
    return [
        k
        for k, hypothesis in enumerate(hypotheses)
        if hypothesis.effects in ranked and evidence[k] >= best[hypothesis.effects] - AS_GOOD
    ]
