"""When the effects of a fitted model act: the times at which its wrench with and without each of them part.

A tether pulls only while it is taut, a patch rubs only while a foot is on it, a post pushes only while it is touched;
none of them has a parameter that says when. So the fitted law is asked: along the recorded motion, the body's
acceleration is taken twice, with the effect's columns as they were fitted and with them off. Times the mass, the
difference is what the effect did at that moment. A load that was put on says itself from when on it is there.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.missing import runs_of
from pbrl_mismatch.data.residual import accelerations
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.effect import Effect, Scene
from pbrl_mismatch.effects.registry import effect_named
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN, WIDTH, neutral_row
from pbrl_mismatch.search.fitted import scene_of

Array = NDArray[np.float64]
Interval = tuple[float, float]

FLOOR = 0.2
"""A wrench below this is not told from a wrist sensor's own error [N]; a torque counts over the radius of gyration."""
SHARE = 0.03
"""Nor does one below this share of the effect's own strong moments count: laws have tails."""
STRONG = 0.95
"""Quantile of an effect's sizes that are above the floor which is its strong moment."""
GAP, LEAST = 0.3, 0.05
"""Pauses shorter than the first are bridged, bouts shorter than the second dropped [s]."""
NEAR = 3e-3
"""What was touched is touched until it is so far away [m]: smoothed poses are off by a millimetre, alike for a second,
and a stiff contact on and off with them."""
FURTHEST = 0.02
"""Where the whole path keeps off what it must have touched, it is taken to be off by as little as makes it touch, and
by no more than this [m]: so rough an outline may be."""
A_TRACE = 1e-9
"""Sliding friction that every model has when it is asked: beside any that rubs a wheel is solved for together with it,
else by itself, and what the two ways differ by would be there where nothing acts."""
ALWAYS = frozenset({"pose_bias", "time_offset", "grasp_compliance", "com_offset"})
"""Effects that are there whenever the body is observed: on what is seen, not on what moves, and of where its mass is,
which is so also while nothing turns it."""


def activity(
    track: Track, row: Array, effects: Sequence[str], *, beside: Sequence[str] = (), floor: float = FLOOR
) -> dict[str, tuple[Interval, ...] | None]:
    """Return when each effect of a fitted model acts.

    Args:
        track: what was recorded.
        row: (WIDTH,) parameter row of the fitted model, the effects on.
        effects: names of those that are asked about.
        beside: names of others that are on.
        floor: size below which a wrench does not count [N].

    Returns:
        By effect the intervals (start, end) [s] in order, none where it never reaches the floor; None for effects that
        are there for as long as anybody looks.

    Raises:
        MismatchError: an effect is unknown, the row does not fit, or the floor is not above zero.
    """
    if not (math.isfinite(floor) and floor > 0.0):
        raise MismatchError(f"activity: expected a floor above zero, got {floor}")
    found: dict[str, tuple[Interval, ...] | None] = dict.fromkeys(effects)
    for name, size in wrench_sizes(track, row, effects, beside).items():
        if size is not None:
            acting, effect = _counts(size, floor), effect_named(name)
            if effect.touches is not None:
                acting = _touching(track, row, name, {*effects, *beside}, acting, floor)
            if effect.lasts is not None and acting.any():
                moment, gone = (row[COLUMN[column]] for column in effect.lasts)
                acting = (track.clock >= moment) != (gone > 0.0)
            found[name] = intervals(track, acting)
    return found


def wrench_sizes(
    track: Track, row: Array, effects: Sequence[str], beside: Sequence[str] = ()
) -> dict[str, Array | None]:
    """Return how hard each effect of a fitted model acts, (T,) [N]; None for those that are always there.

    Args:
        track: what was recorded, in T steps.
        row: (WIDTH,) parameter row.
        effects: names.
        beside: names of others that are on.

    Raises:
        MismatchError: an effect is unknown, or the row does not fit.
    """
    if row.shape != (WIDTH,):
        raise MismatchError(f"activity: expected a row of {WIDTH} columns, got shape {row.shape}")
    shown = [name for name in effects if effect_named(name).name not in ALWAYS]
    found: dict[str, Array | None] = dict.fromkeys(effects)
    if not shown:
        return found
    rows = np.stack([row, *(without(track, row, name, {*effects, *beside}) for name in shown)])
    rows[:, COLUMN["slide_mu"]] += A_TRACE
    acceleration = accelerations(track, rows, track.seen, 1)
    mass = float(row[COLUMN["mass"]])
    change = mass * (acceleration[0] - acceleration[1:]) * [1.0, 1.0, track.gyration]
    size = np.sqrt(np.sum(np.nan_to_num(change, nan=0.0, posinf=0.0, neginf=0.0) ** 2, axis=-1))
    return found | dict(zip(shown, size, strict=True))


def without(track: Track, row: Array, effect: str, present: Collection[str] = ()) -> Array:
    """Return (WIDTH,) a model's row with one of its effects off, all else as it was fitted.

    One that adds to another, as what holds at rest does to sliding friction, leaves the other on; and what it shares
    with others that are on, as the centre of load that all dry friction goes by, is theirs as well.

    Args:
        track: what was recorded.
        row: (WIDTH,) parameter row of the model.
        effect: name of the one that is off.
        present: names of those that are on; it may be among them.
    """
    known, scene = effect_named(effect), scene_of(track, row)
    columns = _columns(known, scene)
    if known.limit is not None:
        columns -= _columns(effect_named(known.limit), scene)
    for other in {*present} - {effect}:
        columns -= _columns(effect_named(other), scene)
    off, neutral = row.copy(), neutral_row()
    for column in columns:
        off[COLUMN[column]] = neutral[COLUMN[column]]
    return off


def _columns(effect: Effect, scene: Scene) -> set[str]:
    """Return what an effect learns or fixes."""
    return {parameter.column for parameter in effect.parameters(scene)}.union(effect.fixed, *effect.fixed_in.values())


def intervals(track: Track, acting: NDArray[np.bool_]) -> tuple[Interval, ...]:
    """Return the bouts of a mask (T,) over a track's steps as (start, end) [s], episode by episode.

    Raises:
        MismatchError: the mask does not fit the track.
    """
    if acting.shape != track.clock.shape:
        raise MismatchError(f"activity: expected a mask of {len(track.clock)} steps, got shape {acting.shape}")
    found: list[Interval] = []
    for begin, last in zip(track.begin, track.last, strict=True):
        bouts: list[list[float]] = []
        for start, end in runs_of(acting[begin : last + 1]):
            first, until = float(track.clock[begin + start]), float(track.clock[begin + end - 1]) + track.dt
            if bouts and first - bouts[-1][1] < GAP:
                bouts[-1][1] = until
            else:
                bouts.append([first, until])
        found += [(first, until) for first, until in bouts if until - first >= LEAST]
    return tuple(found)


def _touching(
    track: Track, row: Array, name: str, present: Collection[str], acting: NDArray[np.bool_], floor: float
) -> NDArray[np.bool_]:
    """Return (T,) where a contact acts: for as long as the path stays near after, and before, it acts along it.

    Args:
        track: what was recorded.
        row: (WIDTH,) parameter row.
        name: of the effect.
        present: names of the effects that are on.
        acting: (T,) where it acts along the path as that was smoothed.
        floor: see `activity`.
    """
    touches = effect_named(name).touches
    assert touches is not None
    radius = touches[2]

    def reached(further: float) -> NDArray[np.bool_]:
        larger = row.copy()
        larger[COLUMN[radius]] += further
        size = wrench_sizes(track, larger, [name], tuple(present))[name]
        return np.zeros_like(acting) if size is None else size > floor

    off = 0.0
    while not acting.any() and off < FURTHEST:
        off += NEAR
        acting = reached(off)
    near, kept = acting | reached(2.0 * off + NEAR), np.zeros_like(acting)
    for begin, last in zip(track.begin, track.last, strict=True):
        for start, end in runs_of(near[begin : last + 1]):
            kept[begin + start : begin + end] = acting[begin + start : begin + end].any()
    return kept


def _counts(size: Array, floor: float) -> NDArray[np.bool_]:
    """Return (T,) where a size is above the floor and is no mere tail of the effect's strong moments."""
    above = size[size > floor]
    strong = float(np.quantile(above, STRONG)) if len(above) else 0.0
    return size > max(floor, SHARE * strong)
