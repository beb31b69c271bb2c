"""Every effect of the library fitted to one track, beside the baseline, with evidence and held-out score."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts, cut_windows
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.effect import Effect
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import Peak, climb
from pbrl_mismatch.search.fitted import Fitted, Stages, alone, tops
from pbrl_mismatch.search.grip import GripEvidence
from pbrl_mismatch.search.held import held_starts, holds
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.climb import PathPeak
from pbrl_mismatch.search.path.ground import Ground, ground_of, traced
from pbrl_mismatch.search.path.pins import may_be_pinned
from pbrl_mismatch.search.path.starts import starts_of
from pbrl_mismatch.search.wheels import KEPT, holds_as_pin, is_another, parted_starts, pinned_starts

Array = NDArray[np.float64]

IN_ANOTHER_CHANNEL = frozenset({"grasp_compliance"})
"""Effects that the motion of the body does not show where the wrist's force is known."""
AS_GOOD = 40.0
"""Variants of an effect that are worse than its best by more [nat] are given up."""
CLOSE = (20.0, 10.0)
"""Effects this near to the likeliest [nat] all go on: from the path to windows, and from those to longer ones."""
RESTLESS = 1.12
"""Where no law needs less than this scale of the noise along the path, bodies stick: what holds or stops them is then
simulated whatever the path says of it, and begins also where short simulations have it."""
UNTOLD = 50.0
"""Where a ground is likelier along its path than simulated by more [nat], every effect is simulated: friction stands in
for what holds the body, and its path alone does not tell them apart."""
LEADING = 3
"""So many effects that are the likeliest along the path are simulated to the end."""


def search_library(
    seed: np.random.SeedSequence,
    track: Track,
    bases: Sequence[Fitted],
    stages: Stages,
    options: DiagnoseOptions,
    least: float = -math.inf,
    grip: GripEvidence | None = None,
) -> list[Fitted]:
    """Fit every effect on top of every base, in threads; the bytes do not depend on how many.

    All are climbed along the recorded path, over the longest windows; the likeliest are then simulated, over windows
    that grow.

    Args:
        seed: of every draw.
        track: what was recorded.
        bases: fitted baselines, or hypotheses that already have effects, the likeliest first.
        stages: windows.
        options: settings.
        least: where no effect is likelier along the path than what it is laid on by more [nat], none is simulated.
        grip: what the grippers' poses say, which counts wherever effects are compared; None where none was seen.

    Returns:
        What was simulated to the end; nothing, where nothing is worth it.
    """
    longest = cut_windows(track, max(options.windows))
    grounds = [ground_of(each.hypothesis, each.peak.coordinates[0], longest, options.sensor_floor) for each in bases]
    for ground in grounds:
        _ = ground.climbed, ground.first, ground.fine, ground.believed
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

    def begin_simulated(k: int) -> tuple[Hypothesis, Array]:
        (name, variant, base, ground), found = jobs[k], begun[k]
        rng = np.random.default_rng(seeds[k].spawn(1)[0])
        if is_another(name, base):
            two = parted_starts(rng, found.hypothesis, base, stages.fitted[0], options)
            return found.hypothesis, np.concatenate([two, found.coordinates])
        starts = _with_simulated_ground(found, EFFECTS[name], base)
        if holds_as_pin(name, base, longest.track):
            starts = np.concatenate([pinned_starts(rng, found.hypothesis, base, stages.fitted[0], options), starts])
        if k in told:
            held = held_starts(rng, found.hypothesis, variant, base, ground, stages.fitted[0], options)
            starts = np.concatenate([held, starts])
        return found.hypothesis, starts

    with ThreadPoolExecutor(options.workers) as pool:
        begun = list(pool.map(begin, range(len(jobs))))
        laid = [each.hypothesis for each in begun]
        before_it = {id(base): _of_ground(base, ground, grip) for base, ground in zip(bases, grounds, strict=True)}
        gained = [
            _likeliest(each.hypothesis, each, grip) - before_it[id(base)]
            for each, (_, _, base, _) in zip(begun, jobs, strict=True)
        ]
        if max(gained, default=-math.inf) < least:
            return []
        # What a ground with effects, simulated, knows beyond its path, what is laid on it knows as well.
        on_path = [
            gain + (base.evidence if base.hypothesis.effects else before_it[id(base)])
            for gain, (_, _, base, _) in zip(gained, jobs, strict=True)
        ]
        stands_in = any(_path_above_simulation(base) > UNTOLD for base in bases)
        most = len(EFFECTS) if stands_in else options.shortlist
        chosen = _survivors(laid, on_path, most, CLOSE[0])
        restless = min(each.noise_scale for each in begun) > RESTLESS
        if restless:
            chosen = sorted({*chosen, *(k for k, (name, *_) in enumerate(jobs) if holds(name))})
        asked = [k for k, (_, _, base, _) in enumerate(jobs) if base is bases[0] or not base.hypothesis.effects]
        pins = [k for k in asked if EFFECTS[jobs[k][0]].pins and may_be_pinned(longest.track)]
        # A pin is so stiff that a path a millimetre off says nothing of it; and the first of two wheels has taken on
        # what both do, so that along its path the second has nothing to explain.
        chosen = sorted({*chosen, *pins, *(k for k in asked if is_another(jobs[k][0], jobs[k][2]))})
        chosen = of_every_shape([(name, id(base)) for name, _, base, _ in jobs], chosen)
        told = {k for k in asked if restless and holds(jobs[k][0]) and not is_another(jobs[k][0], jobs[k][2])}
        running = list(pool.map(begin_simulated, chosen))
        # Short windows rank ways to part a wheel no better than the path does: several go on. Of what holds they tell.
        kept = {
            hypothesis.variant: KEPT
            for k, (hypothesis, starts) in zip(chosen, running, strict=True)
            if len(starts) > options.keep[0] and k not in told
        }
        first = _survivors(laid, on_path, LEADING, 0.0)
        leading = {begun[k].hypothesis.variant for k in (*first, *pins)} | set(kept)
        before: list[Peak | None] = [None] * len(running)
        for stage in range(len(stages.fitted)):
            rough = stage + 2 < len(stages.fitted)
            climbed = partial(_climbed, stages.fitted[stage], options.iterations[stage], options, rough)
            peaks = list(pool.map(climbed, running))
            if stage + 1 == len(stages.fitted):
                break
            simulated = [_likeliest(each, peak, grip) for (each, _), peak in zip(running, peaks, strict=True)]
            chosen = _survivors([each for each, _ in running], simulated, options.survivors[stage], CLOSE[1])
            # What the path says of long windows, short ones cannot take back.
            chosen = sorted({*chosen, *(k for k, (each, _) in enumerate(running) if each.variant in leading)})
            before = [peaks[k] for k in chosen]
            running = [
                (each, tops(peaks[k], kept.get(each.variant, options.keep[stage + 1])))
                for k, each in ((k, running[k][0]) for k in chosen)
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


def of_every_shape(jobs: Sequence[tuple[str, int]], chosen: Sequence[int]) -> list[int]:
    """Return which jobs go on with every variant of the contacts that do: the path shows that one is there, not which.

    A contact is so stiff that a millimetre is tens of newtons: a square post was 60 nat less likely than a disc along
    the path, and 130 nat likelier simulated.

    Args:
        jobs: name of each one's effect, and a number of what it is laid on.
        chosen: those that go on.
    """
    touching = {jobs[k] for k in chosen if EFFECTS[jobs[k][0]].touches is not None}
    return [k for k, job in enumerate(jobs) if k in chosen or job in touching]


def _with_simulated_ground(found: PathPeak, effect: Effect, base: Fitted) -> Array:
    """Return starts (n, K): what was found along the path, and the best of it on its ground as that was simulated.

    A path and a simulation have their tops apart, and a ground's was climbed to for long: what begins at the path's,
    and ends below what it is laid on, had not the steps to come back. The second best along the path makes room for it
    but where a place or a rhythm is sought; on a mere kind of body those all go on, and nothing else.
    """
    sought = effect.place is not None or effect.rhythm is not None
    if sought and not base.hypothesis.effects:
        return found.coordinates
    laid = found.hypothesis.laid_on(base.hypothesis, base.peak.coordinates[0], found.coordinates[:1])
    along = found.coordinates if sought else found.coordinates[:1]
    return np.concatenate([along, laid])


def _path_above_simulation(base: Fitted) -> float:
    """Return how much likelier a hypothesis is along its path than simulated [nat]."""
    return base.traced.evidence - base.simulated if base.traced is not None else 0.0


def _same(name: str, base: Fitted, options: DiagnoseOptions) -> bool:
    """Tell whether an effect on a base is what some baseline is: a first wheel is no second one."""
    wheels = [kind for kind in options.baseline if "wheel" in kind or "caster" in kind]
    return EFFECTS[name].second and bool(wheels) and "wheel_x" not in base.hypothesis.columns


def _climbed(cuts: Cuts, iterations: int, options: DiagnoseOptions, rough: bool, job: tuple[Hypothesis, Array]) -> Peak:
    return climb(Objective(job[0], cuts, options.sensor_floor), job[1], iterations=iterations, rough=rough)


def _of_ground(base: Fitted, ground: Ground, grip: GripEvidence | None) -> float:
    """Return the evidence of a ground along its path, with what the grippers' poses say of it [nat]."""
    return ground.evidence + (base.beside if grip is not None else 0.0)


def _likeliest(hypothesis: Hypothesis, peak: Peak | PathPeak, grip: GripEvidence | None) -> float:
    """Return the evidence of the best point of a hypothesis, with what the grippers' poses say of it [nat]."""
    evidence = np.nan_to_num(peak.evidence, nan=-np.inf)
    if grip is not None and np.isfinite(evidence).any():
        points = [int(k) for k in np.flatnonzero(np.isfinite(evidence))]
        evidence[points] += [grip.beside(hypothesis, peak.coordinates[k], peak.covariance(k)) for k in points]
    return float(evidence.max())


def _survivors(hypotheses: Sequence[Hypothesis], evidence: Sequence[float], most: int, close: float) -> list[int]:
    """Return which hypotheses go on: the likeliest of each of so many effects, and others that are as good.

    Args:
        hypotheses: those that are tried.
        evidence: of each of them [nat].
        most: so many effects go on.
        close: others go on that are this near to the likeliest [nat].
    """
    best: dict[tuple[str, ...], float] = {}
    # Two effects are the same two in either order.
    names = [tuple(sorted(each.effects)) for each in hypotheses]
    for effects, value in zip(names, evidence, strict=True):
        best[effects] = max(best.get(effects, -np.inf), value)
    ranked = sorted(best, key=lambda effects: -best[effects])
    # Where all are close, more go on.
    ranked = [name for place, name in enumerate(ranked) if place < most or best[name] > best[ranked[0]] - close]
    return [k for k, effects in enumerate(names) if effects in ranked and evidence[k] >= best[effects] - AS_GOOD]
