"""Every effect of the library fitted to one track, beside the baseline, with evidence and held-out score."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts, cut_windows
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.effect import Effect
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.fitted import Fitted, Stages
from pbrl_mismatch.search.grip import GripEvidence
from pbrl_mismatch.search.grown import grown, likeliest, survivors
from pbrl_mismatch.search.held import held_starts, holds
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.path.climb import PathPeak
from pbrl_mismatch.search.path.ground import Ground, ground_of, traced
from pbrl_mismatch.search.path.pins import may_be_pinned
from pbrl_mismatch.search.path.starts import starts_of
from pbrl_mismatch.search.wheels import KEPT, holds_as_pin, is_another, parted_starts, pinned_starts

Array = NDArray[np.float64]

IN_ANOTHER_CHANNEL = frozenset({"grasp_compliance"})
"""Effects that the motion of the body does not show where the wrist's force is known."""
CLOSE = 20.0
"""Effects this near to the likeliest [nat] all go on from the path to windows."""
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
    jobs = _jobs(seed, bases, longest, options)
    with ThreadPoolExecutor(options.workers) as pool:
        begun = list(pool.map(partial(_begun, options), jobs))
        before_it = {id(job.base): _of_ground(job, grip) for job in jobs}
        gained = [
            likeliest(each.hypothesis, each, grip) - before_it[id(job.base)]
            for each, job in zip(begun, jobs, strict=True)
        ]
        if max(gained, default=-math.inf) < least:
            return []
        # What a ground with effects, simulated, knows beyond its path, what is laid on it knows as well.
        on_path = [
            gain + (job.base.evidence if job.base.hypothesis.effects else before_it[id(job.base)])
            for gain, job in zip(gained, jobs, strict=True)
        ]
        chosen = _chosen(jobs, begun, on_path, bases, track, options)
        going = [(jobs[k], begun[k], k in chosen.held) for k in chosen.jobs]
        running = list(pool.map(partial(_begun_simulated, stages.fitted[0], options), going))
        # Short windows rank ways to part a wheel no better than the path does: several go on. Of what holds they tell.
        kept = {
            hypothesis.variant: KEPT
            for k, (hypothesis, starts) in zip(chosen.jobs, running, strict=True)
            if _begins_at_wheel(jobs[k], track) and len(starts) > options.keep[0] and k not in chosen.held
        }
        leading = {begun[k].hypothesis.variant for k in chosen.leading} | set(kept)
        done = grown(pool, running, stages, leading, kept, grip, options)
        if len(stages.fitted) < len(options.windows):
            return done  # What is weighed are shorter windows than the path's.
        along = {each.hypothesis.variant: each.coordinates[0] for each in begun}
        starts = [np.array([along[each.hypothesis.variant], each.peak.coordinates[0]]) for each in done]
        return list(pool.map(partial(trace, longest, options), done, starts))


@dataclass(frozen=True)
class _Job:
    """One variant of an effect on one base.

    Attributes:
        name: of the effect.
        variant: which of its sub-models.
        base: what it is laid on.
        ground: the same along its path.
        seed: of its draws.
    """

    name: str
    variant: int
    base: Fitted
    ground: Ground
    seed: np.random.SeedSequence


@dataclass(frozen=True)
class _Chosen:
    """Which jobs go on from the path to simulated windows, by their numbers.

    Attributes:
        jobs: all of them.
        held: those that short simulations tell where to begin.
        leading: those that are simulated to the end.
    """

    jobs: tuple[int, ...]
    held: frozenset[int]
    leading: frozenset[int]


def _jobs(seed: np.random.SeedSequence, bases: Sequence[Fitted], longest: Cuts, options: DiagnoseOptions) -> list[_Job]:
    """Return every variant of every effect on every base that can have it."""
    grounds = [_ground(each, longest, options) for each in bases]
    for ground in grounds:
        _ = ground.first, ground.fine, ground.believed  # threads share them
    found = [
        (name, variant, base, ground)
        for base, ground in zip(bases, grounds, strict=True)
        for name in options.effects
        if name not in base.hypothesis.effects and name not in IN_ANOTHER_CHANNEL and not _same(name, base, options)
        for variant in range(len(EFFECTS[name].variants))
    ]
    return [_Job(*job, own) for job, own in zip(found, seed.spawn(len(found)), strict=True)]


def _ground(base: Fitted, longest: Cuts, options: DiagnoseOptions) -> Ground:
    """Return what effects are laid on along its path, traced where that was not done yet."""
    if base.traced is not None:
        return Ground(base.traced, longest, options.sensor_floor)
    return ground_of(base.hypothesis, base.peak.coordinates[0], longest, options.sensor_floor)


def _begun(options: DiagnoseOptions, job: _Job) -> PathPeak:
    """Return where a job begins, climbed along the path."""
    return starts_of(np.random.default_rng(job.seed), job.name, job.variant, job.base, job.ground, options)


def _chosen(
    jobs: Sequence[_Job],
    begun: Sequence[PathPeak],
    on_path: Sequence[float],
    bases: Sequence[Fitted],
    track: Track,
    options: DiagnoseOptions,
) -> _Chosen:
    """Choose by what the path says (on_path, [nat]), and beside that what it says nothing of."""
    laid = [each.hypothesis for each in begun]
    stands_in = any(_path_above_simulation(base) > UNTOLD for base in bases)
    chosen = set(survivors(laid, on_path, len(EFFECTS) if stands_in else options.shortlist, CLOSE))
    restless = min((each.noise_scale for each in begun), default=1.0) > RESTLESS
    if restless:
        chosen |= {k for k, job in enumerate(jobs) if holds(job.name)}
    asked = [k for k, job in enumerate(jobs) if job.base is bases[0] or not job.base.hypothesis.effects]
    pins = {k for k in asked if EFFECTS[jobs[k].name].pins and may_be_pinned(track)}
    another = {k for k in asked if is_another(jobs[k].name, jobs[k].base)}
    # A pin is so stiff that a path a millimetre off says nothing of it; and the first of two wheels has taken on
    # what both do, so that along its path the second has nothing to explain.
    every = of_every_shape([(job.name, id(job.base)) for job in jobs], sorted(chosen | pins | another))
    held = {k for k in asked if restless and holds(jobs[k].name)} - another
    return _Chosen(tuple(every), frozenset(held), frozenset({*pins, *survivors(laid, on_path, LEADING, 0.0)}))


def _begun_simulated(
    shortest: Cuts, options: DiagnoseOptions, going: tuple[_Job, PathPeak, bool]
) -> tuple[Hypothesis, Array]:
    """Return a job with starts (n, K) for simulations: those along the path, and where it says little others before.

    Args:
        shortest: windows that a simulation can follow from a wrong place.
        options: settings.
        going: the job, where it begins along the path, and whether short simulations tell of it.
    """
    job, found, held = going
    base, hypothesis = job.base, found.hypothesis
    rng = np.random.default_rng(job.seed.spawn(1)[0])
    if is_another(job.name, base):
        two = parted_starts(rng, hypothesis, base, shortest, options)
        return hypothesis, np.concatenate([two, found.coordinates])
    starts = _with_simulated_ground(found, EFFECTS[job.name], base)
    if holds_as_pin(job.name, base, shortest.track):
        starts = np.concatenate([pinned_starts(rng, hypothesis, base, shortest, options), starts])
    if held:
        stopped = held_starts(rng, hypothesis, job.variant, base, job.ground, shortest, options)
        starts = np.concatenate([stopped, starts])
    return hypothesis, starts


def _begins_at_wheel(job: _Job, track: Track) -> bool:
    """Tell whether a job begins where its base's wheel is parted, or where it is off the pin that it stood in for."""
    return is_another(job.name, job.base) or holds_as_pin(job.name, job.base, track)


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


def _of_ground(job: _Job, grip: GripEvidence | None) -> float:
    """Return the evidence of a job's ground along its path, with what the grippers' poses say of it [nat]."""
    return job.ground.evidence + (job.base.beside if grip is not None else 0.0)
