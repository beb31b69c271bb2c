"""Every effect of the library fitted to one track, beside the baseline, with evidence and held-out score."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.data.residual import residual_wrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import Peak, climb, most_promising
from pbrl_mismatch.search.contacts import contact_points, with_contacts
from pbrl_mismatch.search.fitted import (
    Fitted,
    Stages,
    alone,
    apart,
    scene_of,
)
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.pulls import with_pulls
from pbrl_mismatch.search.screen import Lacking, screen

Array = NDArray[np.float64]

IN_ANOTHER_CHANNEL = frozenset({"grasp_compliance"})
"""Effects that the motion of the body does not show where the wrist's force is known."""
AS_GOOD = 40.0
"""Variants of an effect that are worse than its best by more [nat] are given up."""
CLOSE = (20.0, 10.0)
"""Effects this near to the likeliest [nat] all go on to longer windows: after the shortest, and after others."""


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
    drawn = [name for name in effect.variants[variant] if name not in effect.linear]
    count = max(options.draws * len(drawn) // (3 * len(lacking)), 1)
    starts = []
    for each in lacking:
        draws = hypothesis.sample_prior(rng, max(count // 4, 8) if effect.remembers else count)
        for k, column in enumerate(hypothesis.columns):
            if column in base.hypothesis.columns:
                draws[:, k] = each.coordinates[base.hypothesis.columns.index(column)]
        if effect.touches is not None:
            x, y, radius = (hypothesis.columns.index(column) for column in effect.touches)
            draws = with_contacts(rng, draws, (x, y, radius), *contact_points(each.track, each.residual))
        if effect.pulls:
            x, y, *at = (hypothesis.columns.index(name) for name in effect.pulls if name in hypothesis.columns)
            point = (at[0], at[1]) if at else None
            cord = hypothesis.columns.index(effect.cord) if effect.cord else None
            draws = with_pulls(rng, draws, (x, y), point, cord, each.track, each.residual)
        ranked, misfit = screen(each, hypothesis, effect, draws)
        share = -(-options.candidates // len(lacking))
        starts.append(apart(ranked[np.argsort(misfit, kind="stable")], hypothesis.spread, share))
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
        if name not in base.hypothesis.effects and name not in IN_ANOTHER_CHANNEL and not _same(name, base, options)
        for variant in range(len(EFFECTS[name].variants))
    ]
    seeds = seed.spawn(len(jobs))

    def begin(k: int) -> tuple[Hypothesis, Array]:
        name, variant, base, lack = jobs[k]
        return starts_of(np.random.default_rng(seeds[k]), name, variant, base, lack, options)

    with ThreadPoolExecutor(options.workers) as pool:
        slopes = {id(base): _nuisance_slopes(base, stages.fitted[0], options) for base in bases}
        begun = pool.map(begin, range(len(jobs)))
        under = [slopes[id(base)] for _, _, base, _ in jobs]
        peaks = list(pool.map(partial(_first_look, stages.fitted[0], options), begun, under))
        running = [(peak.objective.hypothesis, peak.coordinates) for peak in peaks]
        before: list[Peak | None] = [None] * len(running)
        for stage in range(len(stages.fitted)):
            last = stage + 1 == len(stages.fitted)
            if stage > 0:
                rough = stage + 2 < len(stages.fitted)
                climbed = partial(_climbed, stages.fitted[stage], options.iterations[stage], options, rough)
                peaks = list(pool.map(climbed, running))
            if last:
                break
            chosen = _survivors(
                [hypothesis for hypothesis, _ in running], peaks, options.survivors[stage], CLOSE[min(stage, 1)]
            )
            before = [peaks[k] for k in chosen]
            running = [
                (
                    running[k][0],
                    apart(_ordered(peaks[k]).coordinates, running[k][0].spread, options.keep[stage + 1]),
                )
                for k in chosen
            ]
        done = zip(running, peaks, before, strict=True)
        return [
            Fitted(job[0], alone(peak), None, None, None if shorter is None else alone(shorter))
            for job, peak, shorter in done
        ]


def _same(name: str, base: Fitted, options: DiagnoseOptions) -> bool:
    """Tell whether an effect on a base is what some baseline is: a first wheel is no second one."""
    wheels = [kind for kind in options.baseline if "wheel" in kind or "caster" in kind]
    return name == "second_wheel" and bool(wheels) and "wheel_x" not in base.hypothesis.columns


def _nuisance_slopes(base: Fitted, cuts: Cuts, options: DiagnoseOptions) -> Array:
    """Return (W, R, NUISANCES) how starts and steady wrenches move a base's poses in windows."""
    objective = Objective(base.hypothesis, cuts, options.sensor_floor)
    return objective.linearise(base.peak.coordinates, objective.at_rest(1)).spread[0]


def _first_look(cuts: Cuts, options: DiagnoseOptions, job: tuple[Hypothesis, Array], slopes: Array) -> Peak:
    """Climb from the most promising starts of a hypothesis over the shortest windows."""
    hypothesis, starts = job
    objective = Objective(hypothesis, cuts, options.sensor_floor)
    u, z = most_promising(objective, starts, slopes, options.keep[0])
    spread = np.broadcast_to(slopes, (len(u), *slopes.shape))
    return climb(objective, u, z, iterations=options.iterations[0], rough=True, spread=spread)


def _climbed(cuts: Cuts, iterations: int, options: DiagnoseOptions, rough: bool, job: tuple[Hypothesis, Array]) -> Peak:
    return climb(Objective(job[0], cuts, options.sensor_floor), job[1], iterations=iterations, rough=rough)


def _ordered(peak: Peak) -> Peak:
    return peak.take(np.argsort(-peak.evidence, kind="stable"))


def _survivors(hypotheses: Sequence[Hypothesis], peaks: Sequence[Peak], most: int, close: float) -> list[int]:
    """Return which hypotheses go on: the likeliest of each of so many effects, and others that are as good."""
    evidence = np.array([float(np.nan_to_num(peak.evidence, nan=-np.inf).max()) for peak in peaks])
    best: dict[tuple[str, ...], float] = {}
    for hypothesis, value in zip(hypotheses, evidence, strict=True):
        best[hypothesis.effects] = max(best.get(hypothesis.effects, -np.inf), float(value))
    ranked = sorted(best, key=lambda effects: -best[effects])
    # Over short windows little is told apart: where all are close, more go on.
    ranked = [name for place, name in enumerate(ranked) if place < most or best[name] > best[ranked[0]] - close]
    return [
        k
        for k, hypothesis in enumerate(hypotheses)
        if hypothesis.effects in ranked and evidence[k] >= best[hypothesis.effects] - AS_GOOD
    ]
