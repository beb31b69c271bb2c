"""What is remembered of one object that is learned online: motions, windows, and the posterior over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.errors import ModelError
from pbrl_model.fitting import episodes
from pbrl_model.fitting import fit as at_once
from pbrl_model.fitting.fit import FitOptions, ObjectFit
from pbrl_model.fitting.heldout import split
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.fitting.target import Target
from pbrl_model.geometry import MassProperties
from pbrl_model.online.cloud import Tracked, tracked_of
from pbrl_model.online.windows import Piece, joined_motion, joined_windows, trimmed
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import Windows

Array = NDArray[np.float64]

FIRST_WINDOWS = 2
"""So many windows there must be before the first search."""
PATIENCE_WINDOWS = 6
"""After so many the search begins even though nothing has moved: that it does not is worth saying."""
MOVED = 0.02
"""A body that has gone so far [m], or turned by as much [rad], has moved."""


@dataclass(frozen=True)
class OnlineOptions:
    """How to learn online.

    Attributes:
        fit: model class, priors, window length and seed, as for a fit at once.
        particles: of each object's cloud.
        most_windows: kept of each object; beyond, the oldest are forgotten, so that work stays bounded.
    """

    fit: FitOptions = field(default_factory=FitOptions)
    particles: int = 300
    most_windows: int = 120

    def __post_init__(self) -> None:
        if self.fit.likelihood != "windowed":
            raise ModelError(f"online: expected the windowed likelihood, got {self.fit.likelihood!r}")
        if self.particles < 50:
            raise ModelError(f"online: expected at least 50 particles, got {self.particles}")
        if self.most_windows < 4:
            raise ModelError(f"online: expected at least 4 windows to keep, got {self.most_windows}")


@dataclass(frozen=True)
class Learned:
    """What is known of one object: enough to go on from after a restart.

    Attributes:
        geometry: the body.
        oriented: whether its orientation is observed.
        motions: one for each hold, of what is kept.
        since: when each of those holds began [s].
        delay: by how much poses are taken to come after wrenches [s], in all motions and windows.
        windows: kept, in the order of the motions; None before the first.
        tracked: the posterior over them; None before the first.
        searched: how many windows had been seen at the last search.
        updates: how often it has been learned from; numbers the random draws.
        episodes: holds that windows came from, forgotten ones too.
        seen: windows, forgotten ones too.
    """

    geometry: BodyGeometry
    oriented: bool
    motions: tuple[Motion, ...] = ()
    since: tuple[float, ...] = ()
    windows: Windows | None = None
    tracked: Tracked | None = None
    delay: float = 0.0
    searched: int = 0
    updates: int = 0
    episodes: int = 0
    seen: int = 0


def adopted(found: ObjectFit, geometry: BodyGeometry, options: OnlineOptions) -> Learned:
    """Return a fit at once as something to go on from: its draws as particles, over the windows that it fitted.

    The first windows that come call for a search, which sorts the draws into modes.

    Args:
        found: by `fit_recording`, with the options' settings of the fit.
        geometry: of the body.
        options: of the learning.
    """
    windows = split(found.motions, options.fit).fitted
    windows = windows.take(np.arange(max(0, len(windows) - options.most_windows), len(windows)))
    learned = Learned(
        geometry,
        found.motions[0].oriented,
        motions=found.motions,
        since=tuple(float(motion.time[0]) for motion in found.motions),
        windows=windows,
        delay=windows.delay,
        episodes=len(found.motions),
        seen=len(windows),
    )
    target = target_of(learned, windows, options.fit)
    flat = [found.posterior.column(name).ravel() for name in target.names]
    draws = np.stack([*flat, found.delay.ravel(), *np.log(found.noise.reshape(-1, 2)).T], -1)
    chosen = np.linspace(0, len(draws) - 1, options.particles).round().astype(np.int64)
    return replace(learned, tracked=tracked_of(target, draws[chosen], found.posterior.log_evidence))


def body_of(learned: Learned) -> MassProperties:
    """Return mass properties; a body of unknown orientation is taken as the point that is observed."""
    return episodes.body_of(learned.geometry, learned.oriented)


def target_of(learned: Learned, windows: Windows, fit: FitOptions) -> Target:
    """Return the density of a body's physics over windows."""
    return at_once.target_of(learned.geometry, WindowedLikelihood(body_of(learned), windows), fit)


def remembered(known: Learned, pieces: Sequence[Piece], most: int) -> Learned:
    """Add pieces; forget the oldest windows beyond `most`, and the motions that they came from."""
    motions, since, episodes = list(known.motions), list(known.since), known.episodes
    for piece in pieces:
        follows = bool(motions) and since[-1] == piece.since and abs(motions[-1].time[-1] - piece.motion.time[0]) < 0.1
        if follows:
            motions[-1] = joined_motion(motions[-1], piece.motion)
        else:
            motions.append(piece.motion)
            since.append(piece.since)
            episodes += 1
    parts = [*([known.windows] if known.windows is not None else []), *(piece.windows for piece in pieces)]
    windows = joined_windows(parts)
    seen = known.seen + sum(len(piece.windows) for piece in pieces)
    if len(windows) > most:
        windows = windows.take(np.arange(len(windows) - most, len(windows)))
        motions, since = _forgotten(motions, since, windows)
    return replace(known, motions=tuple(motions), since=tuple(since), windows=windows, episodes=episodes, seen=seen)


def _forgotten(motions: list[Motion], since: list[float], windows: Windows) -> tuple[list[Motion], list[float]]:
    """Leave out of the motions what no window was cut from; both are in the order in which they came."""
    total, kept = float(np.sum(windows.steps)) * windows.dt, 0.0
    for k in range(len(motions) - 1, -1, -1):
        length = len(motions[k].wrench) * motions[k].dt
        if kept + length > total - windows.dt:
            rest = trimmed(motions[k], motions[k].time[-1] - max(total - kept, windows.dt))
            return [rest, *motions[k + 1 :]], since[k:]
        kept += length
    return motions, since


def enough(known: Learned) -> bool:
    """Tell whether there is enough for a first posterior.

    Raises:
        ModelError: nothing was felt all the while.
    """
    assert known.windows is not None
    count = len(known.windows)
    moved = max(float(np.ptp(motion.state[:, :3], axis=0).max()) for motion in known.motions)
    if count < FIRST_WINDOWS or (moved < MOVED and count < PATIENCE_WINDOWS):
        return False
    if max(float(np.abs(motion.wrench).max()) for motion in known.motions) < 1e-9:
        name = known.geometry.name
        raise ModelError(f"{name}: expected a force while it was held, got zero throughout; is the wrist sensor on?")
    return True
