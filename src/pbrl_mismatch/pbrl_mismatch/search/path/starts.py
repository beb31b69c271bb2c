"""Where a hypothesis begins: draws of its prior, some put where the lacking wrench points, climbed along the path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.residual import ResidualWrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.caster_swivel import HEADINGS
from pbrl_mismatch.effects.effect import Effect
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.fitted import Fitted, apart_rows, scene_of
from pbrl_mismatch.search.hypothesis import BENT, OF_FRICTION, Hypothesis
from pbrl_mismatch.search.path.climb import PathPeak, climb_along
from pbrl_mismatch.search.path.contacts import contact_points, with_contacts
from pbrl_mismatch.search.path.ground import Ground
from pbrl_mismatch.search.path.moments import at_moments
from pbrl_mismatch.search.path.pins import with_pins
from pbrl_mismatch.search.path.pulls import with_pulls
from pbrl_mismatch.search.path.regions import tile_friction, with_regions
from pbrl_mismatch.search.path.rhythms import with_rhythms
from pbrl_mismatch.search.path.screen import screen
from pbrl_mismatch.search.path.splits import with_splits
from pbrl_mismatch.search.path.turned import turned
from pbrl_model.kernel import GRAVITY

Array = NDArray[np.float64]

FOUND = frozenset({"wheel_x", "wheel_y", "wheel_theta", "hinge_x", "hinge_y", "hinge_radius"})
"""Columns of a ground's kind that were hard to find."""
PARENTS, NEARBY = 3, (0.15, 0.04)
"""Of the draws of each half so many are drawn about again; how far, in standard deviations of the prior: a second time
what is met, or missed by a centimetre."""
OF_A_CATCH = 4
"""So many times as many draws has one whose point is sought on the body too: both are met within two centimetres."""
BEGUN, CLIMBED = 3, 8
"""Steps along the path of all starts of a hypothesis, and of the best of them."""
ELSEWHERE, ELSEWHERE_ON_IT = (0.4, 1), (0.08, 6)
"""What has borders goes on from the best so far from the likeliest as well [m], from so many of them, and so does a
catch, of its point on the body: of a misfit how far a draw is from its top says more than its place."""


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
    hypothesis = base.hypothesis.with_effect(effect, scene_of(ground.cuts.track, base.row), variant)
    draws, afresh = drawn(rng, hypothesis, effect, variant, base, ground, options)
    ranked, misfit = screen(ground, hypothesis, effect, draws)
    searched = _searched(effect, variant)
    # Edges in time and borders are met by few draws and felt from nearby only: the best ones are drawn about again.
    narrow = effect.touches is not None or _is_catch(effect)
    for nearby in (NEARBY if narrow else NEARBY[:1]) if searched else ():
        orders = [_in_order(misfit, half) for half in (~afresh, afresh)]
        likely = np.concatenate([order[_parents(ranked[order], hypothesis, effect)] for order in orders])
        parents = np.resize(likely, len(draws))
        moved = np.isin(hypothesis.columns, searched) * nearby * hypothesis.spread
        near = hypothesis.believable(ranked[parents] + moved * rng.standard_normal((len(draws), len(moved))))
        again, rest = screen(ground, hypothesis, effect, near)
        ranked, misfit = np.concatenate([ranked, again]), np.concatenate([misfit, rest])
        afresh = np.concatenate([afresh, afresh[parents]])
    halves = [ranked[_in_order(misfit, half)] for half in (~afresh, afresh) if half.any()]
    starts = [half[going_on(half, hypothesis, effect, -(-options.candidates // 2))] for half in halves]
    along = ground.climbed if effect.remembers else ground.first.along
    begun = climb_along(along, hypothesis, np.concatenate(starts), BEGUN)
    best = begun.coordinates[each_first(begun.evidence, [len(each) for each in starts])]
    kept = best[going_on(best, hypothesis, effect, options.keep[0])]
    if set(effect.variants[variant]) & set(HEADINGS):
        kept = turned(ground.climbed, hypothesis, kept)
    found = climb_along(ground.climbed, hypothesis, kept, CLIMBED)
    # At the top a misfit says what a place is worth: of those that were gone on with beside the best, one more is left.
    most = options.keep[0] + int(len(kept) > options.keep[0])
    found = found.take(np.argsort(-found.evidence, kind="stable")[:most])
    moments = [hypothesis.columns.index(column) for column in effect.moments if column in hypothesis.columns]
    for moment in moments * len(moments):  # of two, each is sought again with the other where that was found
        elsewhen = at_moments(found.coordinates, moment, ground.cuts.track.clock)
        begun = _likeliest(climb_along(ground.climbed, hypothesis, elsewhen, BEGUN), options.candidates)
        found = _likeliest(climb_along(ground.climbed, hypothesis, begun.coordinates, CLIMBED), most)
    return found


def _likeliest(found: PathPeak, count: int) -> PathPeak:
    """Return so many of the likeliest points that are apart."""
    ranked = found.take(np.argsort(-found.evidence, kind="stable"))
    return ranked.take(apart_rows(ranked.coordinates, found.hypothesis.spread, count))


def _is_catch(effect: Effect) -> bool:
    """Tell whether a point of the body is drawn to a place that it passes."""
    return bool(effect.pulls) and effect.cord is None


def _seeks_a_point(effect: Effect, columns: tuple[str, ...]) -> bool:
    """Tell whether a catch's point on the body is free too."""
    return _is_catch(effect) and set(effect.pulls) <= set(columns)


def _searched(effect: Effect, variant: int) -> list[str]:
    """Return the columns of a variant that are drawn, the others are solved for."""
    return [column for column in effect.variants[variant] if column not in effect.linear]


def drawn(
    rng: np.random.Generator,
    hypothesis: Hypothesis,
    effect: Effect,
    variant: int,
    base: Fitted,
    ground: Ground,
    options: DiagnoseOptions,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return draws (n, K), and which of them have the ground's own columns as they were believed to be (n,)."""
    track, columns, kept = ground.cuts.track, hypothesis.columns, _kept()
    count = max(options.draws * len(_searched(effect, variant)) // 3, 2)
    if _seeks_a_point(effect, columns):
        count *= OF_A_CATCH
    if effect.remembers and effect.touches is None:
        count = max(count // 4, 8)  # each costs twice as much, and its place is not to be found
    draws = hypothesis.sample_prior(rng, count)
    afresh = np.arange(len(draws)) % 2 == 1
    believed = ground.hypothesis.as_believed(ground.coordinates)
    for k, column in enumerate(columns):
        if column in ground.hypothesis.columns:
            # What an effect did, the ground has taken on as far as it could: half begin at what was believed before.
            own = ground.hypothesis.columns.index(column)
            before = np.full(count, believed[own]) if column in BENT else draws[:, k]
            if column in OF_FRICTION:
                # The wheel's friction too: half of those begin with a wheel that rolls.
                before[1::4] = min(believed[own], hypothesis.mean[k])
            draws[:, k] = np.where(afresh & (column not in kept), before, ground.coordinates[own])
    for half, lacks in ((~afresh, ground.lacks), (afresh, ground.believed)):
        draws[half] = _placed(rng, draws[half], columns, effect, track, lacks)
    if effect.touches is not None:
        x, y, radius = (columns.index(column) for column in effect.touches)
        # What a body is taken for may hide a touch, or make one: where it is, both wrenches say.
        both = [contact_points(track, each, met=effect.remembers) for each in (ground.lacks, ground.believed)]
        places, normals = (np.concatenate(each) for each in zip(*both, strict=True))
        draws = with_contacts(rng, draws, (x, y, radius), places, normals)
    if effect.second and "wheel_x" in columns:
        draws = with_splits(rng, draws, columns, scene_of(track, base.row).size)
    if effect.pins is not None:
        draws = with_pins(rng, draws, (columns.index(effect.pins[0]), columns.index(effect.pins[1])), track)
    if effect.region is not None:
        x, y, length, width, angle = (columns.index(column) for column in effect.region)
        tiles = tile_friction(track, ground.believed, GRAVITY * scene_of(track, base.row).mass, ground.row)
        draws = with_regions(rng, draws, (x, y, length, width, angle), *tiles)
    return draws, afresh


def _kept() -> frozenset[str]:
    """Return columns of a ground that every start has as the ground has them: where something is was hard to find."""
    places = (
        column
        for effect in EFFECTS.values()
        for column in (*(effect.place or ()), *(effect.touches or ()), *effect.pulls, *(effect.region or ()))
    )
    return FOUND.union(places) - BENT


def _placed(
    rng: np.random.Generator,
    draws: Array,
    columns: tuple[str, ...],
    effect: Effect,
    track: Track,
    lacks: ResidualWrench,
) -> Array:
    """Return draws (n, K) of which some are put where and when a lacking wrench says that an effect acts."""
    if effect.pulls:
        x, y, *at = (columns.index(name) for name in effect.pulls if name in columns)
        point = (at[0], at[1]) if at else None
        cord = columns.index(effect.cord) if effect.cord else None
        draws = with_pulls(rng, draws, (x, y), point, cord, track, lacks)
    if effect.rhythm is not None and effect.rhythm[0] in columns:
        frequency, phase = (columns.index(name) for name in effect.rhythm)
        draws = with_rhythms(rng, draws, frequency, phase, lacks, track.gyration)
    return draws


def going_on(draws: Array, hypothesis: Hypothesis, effect: Effect, count: int) -> NDArray[np.int64]:
    """Return which draws (n, K), likeliest first, to go on from: so many apart, of some others elsewhere too."""
    kept = apart_rows(draws, hypothesis.spread, count)
    place, apart, most = _sought(effect, hypothesis.columns)
    at = draws[:, [hypothesis.columns.index(column) for column in place]]
    for _ in range(most):
        away = np.min(np.linalg.norm(at[:, None] - at[kept], axis=2), axis=1)
        kept = np.concatenate([kept, np.flatnonzero(away > apart)[:1]])
    return kept


def _sought(effect: Effect, columns: tuple[str, ...]) -> tuple[Sequence[str], float, int]:
    """Return the columns of a place that others are gone on with, how far apart [m], and how many; none mostly."""
    if effect.region is not None:
        return effect.region[:2], *ELSEWHERE
    return (effect.pulls[2:], *ELSEWHERE_ON_IT) if _seeks_a_point(effect, columns) else ((), 0.0, 0)


def _parents(draws: Array, hypothesis: Hypothesis, effect: Effect) -> NDArray[np.int64]:
    """Return which draws (n, K), likeliest first, are drawn about again."""
    if effect.region is not None or _is_catch(effect):
        return going_on(draws, hypothesis, effect, PARENTS)
    return np.arange(min(PARENTS, len(draws)))


def _in_order(misfit: Array, among: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the rows of some draws, likeliest first."""
    rows = np.flatnonzero(among)
    return np.asarray(rows[np.argsort(misfit[rows], kind="stable")], dtype=np.int64)


def each_first(evidence: Array, counts: Sequence[int]) -> NDArray[np.int64]:
    """Return the order of points in groups of so many: the likeliest of each group, then all others, likeliest first.

    Along a bent ground's path what begins afresh has further to go, and is where the effect is.
    """
    group = np.repeat(np.arange(len(counts)), counts)
    order = np.argsort(-evidence, kind="stable")
    _, leads = np.unique(group[order], return_index=True)
    behind = np.isin(np.arange(len(order)), leads, invert=True)
    return np.asarray(order[np.argsort(behind, kind="stable")], dtype=np.int64)
