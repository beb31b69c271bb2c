"""Windows at the end of what has been heard, each cut once, as soon as its streams are complete."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pbrl_bag.types import Recording
from pbrl_mismatch.data.cuts import Cuts, cut_windows
from pbrl_mismatch.data.track import lay_track
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_model.fitting.episodes import body_of
from pbrl_model.online.windows import TINY, Hold, holds_of, known_until, trimmed
from pbrl_model.sensing.motion import Motion, observe
from pbrl_model.sensing.windows import WIDENING

Grid = tuple[float, int]


@dataclass(frozen=True)
class Look:
    """What is complete at one moment of a hold.

    Attributes:
        hold: of the object.
        end: of every window that is cut here [s].
        hop: its number, counted from when the grip had closed.
    """

    hold: Hold
    end: float
    hop: int


def looks_due(recording: Recording, name: str, since: float, options: MonitorOptions) -> Iterator[Look]:
    """Yield the moments at which windows have become complete, in order.

    Args:
        recording: what has been heard.
        name: of the object.
        since: end of the last look [s].
        options: of the watch.
    """
    for hold in holds_of(recording, name):
        ready = min(known_until(recording, name, hold.grippers) - options.lookahead, hold.end)
        start = hold.start + options.closing
        first = max(0, int(np.floor((since - start) / options.hop + TINY))) if since > start else 0
        last = int(np.floor((ready - start) / options.hop + TINY))
        for hop in range(first + 1, last + 1):
            yield Look(hold, start + hop * options.hop, hop)


def cut_look(recording: Recording, name: str, look: Look, options: MonitorOptions) -> dict[Grid, Cuts]:
    """Cut the windows that end at a moment, by their grid; none where the hold is too young.

    Raises:
        ModelError: a stream is missing or broken there.
        MismatchError: the motion cannot be laid out.
    """
    wanted = {length: round(length / options.hop) for length in options.windows}
    wanted = {length: hops for length, hops in wanted.items() if look.hop >= hops}
    if not wanted:
        return {}
    geometry, stream = recording.bodies[name], recording.object_poses[name]
    properties = body_of(geometry, bool(np.any(np.isfinite(stream.quaternion))))
    back = max(wanted) + options.context
    start = max(look.end - back, look.hold.start)
    # On one grid of time with the windows' borders, so that the last step ends where they do.
    start = look.end - options.hop * int(np.floor((look.end - start) / options.hop + TINY))
    motion = observe(recording, name, look.hold.grippers, start, look.end, properties.com)
    out = {}
    for length, hops in wanted.items():
        own = trimmed(motion, look.end - length)
        cuts = cut_windows(lay_track(recording, (own,), geometry, properties), length)
        out[length, look.hop % hops] = _moving(cuts, own)
    return out


def _moving(cuts: Cuts, motion: Motion) -> Cuts:
    """Return the window with its start as smoothed: one that begins in mid-motion does not begin at rest."""
    values, vectors = np.linalg.eigh(WIDENING * motion.covariance[0])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return replace(cuts, told=motion.state[:1].copy(), root=root[None])
