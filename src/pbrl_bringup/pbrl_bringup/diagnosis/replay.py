"""Recording and simulation at the same moments, as the page replays them.

The simulations start anew at the beginning of every stretch, from the state that the recording then had: over minutes a
small error would grow until there was nothing to compare. A stretch is as long as what was held out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_bringup.diagnosis.told import acting_times
from pbrl_mismatch.data.cuts import Cuts, cut_windows, held_out_blocks, inside
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.diagnose import ObjectDiagnosis
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.heldout import noise_floor

Array = NDArray[np.float64]

MOST_SAMPLES = 6000
"""Moments of one object on a page; of a longer recording every so many are left out."""


@dataclass(frozen=True)
class Replay:
    """One object over n moments.

    Attributes:
        name: of the object.
        outline: (k, 2) footprint [m], body's frame.
        time: (n,) since the first moment [s].
        stretch: (n,) number of the stretch that each moment belongs to.
        recorded: (n, 3) poses of the body's frame [m, m, rad].
        before: (n, 3) as the baseline has them.
        after: (n, 3) as the repaired model has them; None: nothing was repaired.
        force: (n, 2) felt force on the object, world axes [N].
        hand: (n, 2) where it was held [m].
        held_out: intervals of time that are left out where errors are scored [s].
        unbelieved: stretches that nothing is simulated across: start, end [s], and what was wrong.
        seconds: length of a stretch [s].
        places: of named effects: name, whether it moves with the body, outline [m].
        moments: intervals in which named effects act, or what has no name is surely there [s].
        room: corners of the room [m], or none.
        noise: of recorded positions [m].
    """

    name: str
    outline: Array
    time: Array
    stretch: NDArray[np.int64]
    recorded: Array
    before: Array
    after: Array | None
    force: Array
    hand: Array
    held_out: tuple[tuple[float, float], ...]
    unbelieved: tuple[tuple[float, float, str], ...]
    seconds: float
    places: tuple[tuple[str, bool, Array], ...]
    moments: tuple[tuple[float, float], ...]
    room: Array
    noise: float

    def to_json(self) -> dict[str, Any]:
        """Return what the page's script reads: tenths of a millimetre and of a milliradian, hundredths of a newton."""
        return {
            "name": self.name,
            "outline": _rounded(self.outline, 4),
            "time": _rounded(self.time, 3),
            "stretch": self.stretch.tolist(),
            "recorded": _rounded(self.recorded, 4),
            "before": _rounded(self.before, 4),
            "after": None if self.after is None else _rounded(self.after, 4),
            "force": _rounded(self.force, 2),
            "hand": _rounded(self.hand, 3),
            "heldOut": [list(each) for each in self.held_out],
            "unbelieved": [[round(start, 3), round(end, 3), why] for start, end, why in self.unbelieved],
            "seconds": self.seconds,
            "places": [
                {"effect": name, "onBody": moves, "shape": _rounded(shape, 3)} for name, moves, shape in self.places
            ],
            "moments": [list(each) for each in self.moments],
            "room": _rounded(self.room, 3),
            "noise": self.noise if np.isfinite(self.noise) else 0.0,
        }


def replay_of(recording: Recording, found: ObjectDiagnosis, options: DiagnoseOptions) -> Replay:
    """Simulate a recording stretch by stretch with the baseline and with the repaired model.

    Args:
        recording: for the room.
        found: on one object of it.
        options: with which it was found.

    Raises:
        ModelError: no stretch has enough poses.
    """
    track = found.baseline.peak.objective.cuts.track
    cuts = cut_windows(track, options.block)
    cuts = cuts.take(np.argsort(cuts.start, kind="stable"))
    repaired = found.repaired is not found.baseline
    rows = np.stack([found.baseline.row, found.repaired.row][: 1 + repaired])
    simulated = poses(rows, cuts)
    valid = cuts.weight[..., :2].min(axis=2) > 0.0
    when = cuts.start[:, None] + cuts.place * track.dt
    chosen = np.argwhere(valid)
    chosen = chosen[:: -(-len(chosen) // MOST_SAMPLES)]
    w, n = chosen.T
    origin = float(track.clock[0])
    step = np.clip(np.searchsorted(track.clock, when[w, n]), 0, len(track.clock) - 1)
    recorded = cuts.pose[w, n].copy()
    unseen = ~(cuts.weight[w, n, 2] > 0.0)
    recorded[unseen, 2] = track.seen[step[unseen], 2]
    mount = track.mount[step]
    felt = track.felt[step]
    force = np.column_stack(
        [mount[:, 0] * felt[:, 0] - mount[:, 1] * felt[:, 1], mount[:, 1] * felt[:, 0] + mount[:, 0] * felt[:, 1]]
    )
    effects = found.report["effects"]
    return Replay(
        name=track.object,
        outline=track.outline,
        time=when[w, n] - origin,
        stretch=w.astype(np.int64),
        recorded=recorded,
        before=simulated[0, w, n],
        after=simulated[1, w, n] if repaired else None,
        force=force,
        hand=track.seen[step, :2] + mount[:, 2:4],
        held_out=_held_out(cuts, options, origin),
        unbelieved=tuple((each.start - origin, each.end - origin, each.why) for each in track.missing),
        seconds=options.block,
        places=tuple(_places(effects, track.object)),
        moments=tuple((start - origin, end - origin) for start, end in acting_times(found.report)),
        room=np.empty((0, 2)) if recording.room is None else np.asarray(recording.room, dtype=float),
        noise=noise_floor(cuts)[0],
    )


def _held_out(cuts: Cuts, options: DiagnoseOptions, origin: float) -> tuple[tuple[float, float], ...]:
    """Return the intervals that are held out for the score; none where there was nothing to spare, see `cut_stages`."""
    out = inside(cuts, held_out_blocks(cuts.track, options.block, options.every))
    if not out.any() or out.all():
        return ()
    ends = cuts.start + cuts.span[:, 1] * cuts.track.dt
    return tuple((float(cuts.start[k] - origin), float(ends[k] - origin)) for k in np.flatnonzero(out))


def _places(effects: list[dict[str, Any]], name: str) -> list[tuple[str, bool, Array]]:
    found = []
    for entry in effects:
        where = entry.get("where")
        if where and where.get("shape"):
            shape = np.array(where["shape"], dtype=float).reshape(-1, 2)
            found.append((str(entry["effect"]), where["frame"] == name, shape))
    return found


def _rounded(values: Array, digits: int) -> list[Any]:
    out: list[Any] = np.round(values, digits).tolist()
    return out
