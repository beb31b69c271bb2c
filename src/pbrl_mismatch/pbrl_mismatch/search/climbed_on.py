"""Hypotheses climbed on from where others have what they share: the body's own parameters, or an effect's."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, Stages, alone, apart_rows, likeliest_first
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE
from pbrl_mismatch.search.hops import hopped
from pbrl_mismatch.search.hypothesis import BELIEVED, Hypothesis
from pbrl_mismatch.search.library import trace
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.ground import traced
from pbrl_mismatch.search.path.moments import at_moments
from pbrl_mismatch.search.weigh import Weighed

Array = NDArray[np.float64]

POLISHED, POLISHED_OF_SETS, LONGER = 5, 3, 2
"""So many of the likeliest effects, and of the likeliest sets, are climbed on, for so many times the usual steps."""
TRIED_OUT, GO_ON, BEHIND = 4, 4, 50.0
"""Steps that every start of a climb on has, how many starts go on from there, and how far behind the best [nat]."""
EXPLAINS = 10.0
"""What is likelier than the baseline by more explains something [nat]."""
LEADS = 3
"""So many of the likeliest effects lead a baseline to where they have the body's own parameters, and so many of the
sets that explain most lead their parts."""
LED_AHEAD = 3.0
"""A part that was led on by more [nat] leads the sets that it is in."""
LED = 100.0
"""Kinds of baseline that are worse than the best by more [nat], simulated too, are not led: no other top would do. Nor
are effects tried on richer kinds than the best that are."""
FREEDOM = 1.0
"""An effect that says nothing is less likely than the baseline by about so much at least, for its freedom [nat]."""
FAINT = 2.0
"""What a law has that its limit has not begins so many deviations of its prior below the mean."""
BEYOND_PATH = 50.0
"""Where simulations are likelier than the path by more [nat], as beside a contact, the path has not told when something
came or went."""


def led(bases: list[Fitted], tried: list[Fitted], stages: Stages, options: DiagnoseOptions) -> list[Fitted]:
    """Return the baselines climbed on from where likely effects have mass and wheel, best first.

    Where bodies stick there are many tops. An effect that does nothing but lead to a better one explains nothing.
    """
    likely = likeliest_first(each for each in tried if GRASP_COMPLIANCE not in each.hypothesis.effects)[:LEADS]
    best = likeliest_first(bases)[0]

    def climbed(base: Fitted) -> Fitted:
        found = base
        for each in likely if keeps_up(base, best) else []:
            # One that is no likelier for all its freedom has found no better top.
            found = _climbed_on(found, each, stages, options) if each.evidence > found.evidence - FREEDOM else found
        return found

    with ThreadPoolExecutor(options.workers) as pool:
        return likeliest_first(pool.map(climbed, bases))


def keeps_up(base: Fitted, best: Fitted) -> bool:
    """Tell whether a kind of baseline is about as likely as the best is, or likelier simulated.

    Friction of a simple kind may stand in along the path for what is left out, and simulate badly.
    """
    return base.evidence > best.evidence - LED or base.simulated > best.simulated


def polished(
    weighed: tuple[Weighed, ...],
    tried: list[Fitted],
    stages: Stages,
    options: DiagnoseOptions,
    most: int = POLISHED,
    *,
    hops: bool = True,
) -> list[Fitted]:
    """Return what was tried, the likeliest climbed on, also from what the best one has for the baseline's parameters.

    A law that is right may be held up where the wrong baseline put it: mass and wheel are then where another law, which
    explains much too, has found them.
    """
    best = next((each.fitted for each in weighed if each.effects and GRASP_COMPLIANCE not in each.effects), None)
    if best is None:
        return tried
    none = max((each.fitted.evidence for each in weighed if not each.effects), default=-math.inf)
    # Where nothing explains anything yet, a law that is right may still be on its way: all go on.
    names = [each.effects for each in weighed if each.effects][: most if best.evidence > none + EXPLAINS else None]
    chosen = {id(each.fitted) for each in weighed if each.effects in names}
    if any(EFFECTS[name].touches is not None for name in best.hypothesis.effects):
        # A contact of one shape shows the others where it is.
        chosen |= {id(each) for each in tried if each.hypothesis.effects == best.hypothesis.effects}
    jobs = [each for each in tried if id(each) in chosen and GRASP_COMPLIANCE not in each.hypothesis.effects]
    with ThreadPoolExecutor(options.workers) as pool:
        found = list(pool.map(lambda each: _climbed_on(each, best, stages, options), jobs))
    found = hopped(found, stages.fitted[-1], options) if hops else found
    better = dict(zip(map(id, jobs), found, strict=True))
    return [better.get(id(each), each) for each in tried]


def _climbed_on(fitted: Fitted, best: Fitted, stages: Stages, options: DiagnoseOptions) -> Fitted:
    """Return a hypothesis climbed on from where it is, and from where another has the body's own parameters."""
    objective = Objective(fitted.hypothesis, stages.fitted[-1], options.sensor_floor)
    starts = [starts_from(fitted, best), *([elsewhen(fitted, best)] if is_part(best, fitted) else [])]
    coordinates, begins = (np.concatenate(each) for each in zip(*starts, strict=True))
    first = climb(objective, coordinates, begins, iterations=TRIED_OUT, rough=True)
    # Where no start has any evidence none is behind.
    order = first.ranked[~(first.evidence[first.ranked] < first.evidence[first.best] - BEHIND)]
    likely = first.take(order[apart_rows(first.coordinates[order], fitted.hypothesis.spread, GO_ON)])
    more = LONGER * options.iterations[-1] - TRIED_OUT
    peak = climb(objective, likely.coordinates, likely.nuisance, iterations=more)
    better = peak.evidence[peak.best] > fitted.simulated
    found = replace(fitted, peak=alone(peak)) if better else fitted
    if found.traced is None or best.traced is None or not best.traced.evidence > found.traced.evidence:
        return found
    reached = found.traced.coordinates, best.hypothesis, best.traced.coordinates
    # Each has a path of its own.
    for along in np.unique([_crossed(fitted.hypothesis, *reached, all_shared=each) for each in (False, True)], axis=0):
        other = traced(fitted.hypothesis, along[None], stages.fitted[-1], options.sensor_floor)
        if found.traced is None or other.evidence > found.traced.evidence:
            found = replace(found, traced=other)
    return found


def starts_from(fitted: Fitted, best: Fitted) -> tuple[Array, Array]:
    """Return where a hypothesis is climbed on from: where it is, and what it is with what the best one found.

    Returns:
        Coordinates (n, K), and the windows' nuisances (n, W, NUISANCES) of the one that they are from, or at rest:
        where a contact is met or missed by how a window begins, coordinates alone do not lead back to where they were
        good.
    """
    hypothesis, own, reached = fitted.hypothesis, fitted.peak.coordinates[0], best.peak.coordinates[0]
    begins, begun = fitted.peak.nuisance[0], best.peak.nuisance[0]
    crossed = _crossed(hypothesis, own, best.hypothesis, reached)
    starts = [(own, begins), (crossed, begun)]
    if hypothesis.effects:
        # What the best one bent of mass and delay may be the very thing that another effect explains.
        bent = np.isin(hypothesis.columns, list(BELIEVED))
        starts += [(hypothesis.as_believed(own), begins), (np.where(bent, own, crossed), begun)]
    # Laws that are one another's limits share more than the body: ground friction is breakaway friction without.
    alike = _crossed(hypothesis, own, best.hypothesis, reached, all_shared=True)
    if np.any(alike != crossed):
        alone_in_it = np.isin(hypothesis.columns, best.hypothesis.columns, invert=True)
        faint = np.where(alone_in_it, hypothesis.mean - FAINT * hypothesis.spread, alike)
        starts += [(alike, begun), (faint, begun)]
    if fitted.traced is not None:
        starts += [(fitted.traced.coordinates, begins)]
    coordinates, nuisances = (np.array(each) for each in zip(*starts, strict=True))
    return np.concatenate([coordinates] * 2), np.concatenate([nuisances, np.zeros_like(nuisances)])


def elsewhen(fitted: Fitted, ground: Fitted) -> tuple[Array, Array]:
    """Return starts as `starts_from` does, of what comes or goes beside a ground at other moments.

    The rest is as the ground has it: a load that is put on at a wrong moment moves the contact that it is beside, and
    neither finds back without the other. There are none where the path has told the moment.
    """
    hypothesis, begins = fitted.hypothesis, ground.peak.nuisance[0]
    on_path = math.inf if fitted.traced is None else fitted.traced.evidence
    laid = set(hypothesis.effects) - set(ground.hypothesis.effects) if fitted.simulated > on_path + BEYOND_PATH else ()
    crossed = _crossed(hypothesis, fitted.peak.coordinates[0], ground.hypothesis, ground.peak.coordinates[0])
    moments = [column for name in sorted(laid) for column in EFFECTS[name].moments if column in hypothesis.columns]
    clock = fitted.peak.objective.cuts.track.clock
    starts = [at_moments(crossed[None], hypothesis.columns.index(column), clock)[1:] for column in moments]
    coordinates = np.concatenate([np.zeros((0, len(crossed))), *starts])
    return coordinates, np.broadcast_to(begins, (len(coordinates), *begins.shape))


def _crossed(
    hypothesis: Hypothesis, own: Array, other: Hypothesis, coordinates: Array, *, all_shared: bool = False
) -> Array:
    """Return the coordinates (K,) of a hypothesis with what is the body's, or of effects of both, as another has it.

    With `all_shared` that is so of whatever both have, by its column, in whichever effect.
    """
    crossed = own.copy()
    not_shared = set() if all_shared else set(hypothesis.effects) - set(other.effects)
    effect = {column for name in not_shared for column in columns_of(name)}
    for k, column in enumerate(hypothesis.columns):
        if column in other.columns and column not in effect:
            crossed[k] = coordinates[other.columns.index(column)]
    return crossed


def over_longest(
    weighed: tuple[Weighed, ...], parts: list[Fitted], stages: Stages, options: DiagnoseOptions
) -> list[Fitted]:
    """Return the sets that explain most of shorter windows, climbed on over the longest ones and along the path.

    Args:
        weighed: over the shorter windows.
        parts: single effects as they were over the longest windows, from where a set is climbed as well.
        stages: the longest windows among them.
        options: settings.
    """
    cuts, sets = stages.fitted[-1], _sets(weighed)

    def climbed(whole: Fitted) -> Fitted:
        hypothesis, own = whole.hypothesis, whole.peak.coordinates[0]
        within = [each for each in parts if is_part(each, whole)]
        crossed = [_crossed(hypothesis, own, each.hypothesis, each.peak.coordinates[0]) for each in within]
        starts = np.unique([own, hypothesis.as_believed(own), *crossed, *_as_elsewhere(whole, sets)], axis=0)
        objective = Objective(hypothesis, cuts, options.sensor_floor)
        peak = alone(climb(objective, starts, iterations=LONGER * options.iterations[-1]))
        return trace(cuts, options, replace(whole, peak=peak, shorter=whole.peak), peak.coordinates)

    with ThreadPoolExecutor(options.workers) as pool:
        return list(pool.map(climbed, sets[:LEADS]))


def _sets(weighed: tuple[Weighed, ...]) -> list[Fitted]:
    """Return the sets, those first that explain most.

    A hold that gives way leads nothing: it is laid on a top as it is and learned beside the motion.
    """
    sets = [each.fitted for each in weighed if len(each.effects) > 1 and GRASP_COMPLIANCE not in each.effects]
    return likeliest_first(sets)


def _as_elsewhere(whole: Fitted, sets: list[Fitted]) -> list[Array]:
    """Return coordinates (K,) of a set with each of its effects as the likeliest other set has it.

    What is sought beside one law may be found beside another that leaves it more to explain: alone it takes the place
    of what acts more strongly, beside that it ends in another hollow.
    """
    hypothesis, own, found = whole.hypothesis, whole.peak.coordinates[0], []
    for name in hypothesis.effects:
        other = next((each for each in sets if name in each.hypothesis.effects and each is not whole), None)
        if other is not None:
            its = dict(zip(other.hypothesis.columns, other.peak.coordinates[0], strict=True))
            law = columns_of(name)
            pairs = zip(hypothesis.columns, own, strict=True)
            found.append(np.array([its.get(column, value) if column in law else value for column, value in pairs]))
    return found


def columns_of(name: str) -> set[str]:
    """Return the columns of an effect's laws."""
    return {column for variant in EFFECTS[name].variants for column in variant}


def is_part(part: Fitted, whole: Fitted) -> bool:
    """Tell whether the one has some of the other's effects and no others."""
    return set(part.hypothesis.effects) < set(whole.hypothesis.effects)


def parts_led(
    weighed: tuple[Weighed, ...], tried: list[Fitted], stages: Stages, options: DiagnoseOptions
) -> list[Fitted]:
    """Return what was tried, the parts of the sets that explain most climbed on from where those have them.

    An effect of which there is nothing may have done no more than lead another to a better top: alone that does as well
    there. Where a set is far less likely than what is likeliest, so are its parts.
    """
    least = max(each.fitted.evidence for each in weighed) - BEHIND
    sets = [each for each in _sets(weighed)[:LEADS] if each.evidence > least]

    def led_on(part: Fitted) -> Fitted:
        found = part
        for whole in sets:
            if is_part(part, whole) and whole.evidence > part.evidence:
                found = _climbed_on(found, whole, stages, options)
        return found

    with ThreadPoolExecutor(options.workers) as pool:
        return list(pool.map(led_on, tried))


def sets_led(
    weighed: tuple[Weighed, ...], before: list[Fitted], tried: list[Fitted], stages: Stages, options: DiagnoseOptions
) -> list[Fitted]:
    """Return what was tried, the likeliest sets climbed on from where parts of theirs were led to by other sets.

    A crate was ten centimetres off, and the load that was tried beside it put on where that mends most; friction beside
    it led it to its place, and there the load has another moment.

    Args:
        weighed: hypotheses, likeliest first.
        before: what was tried as it was before parts were led.
        tried: as it is now, in the same order.
        stages: windows.
        options: settings.
    """
    ahead = [now for now, then in zip(tried, before, strict=True) if now.evidence > then.evidence + LED_AHEAD]
    chosen = {id(each) for each in _sets(weighed)[:POLISHED_OF_SETS]}

    def led_on(then: Fitted, whole: Fitted) -> Fitted:
        found = whole
        for part in ahead if id(then) in chosen else []:
            found = _climbed_on(found, part, stages, options) if is_part(part, whole) else found
        return found

    with ThreadPoolExecutor(options.workers) as pool:
        return list(pool.map(led_on, before, tried))
