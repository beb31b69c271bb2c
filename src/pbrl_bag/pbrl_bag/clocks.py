"""Clocks of several machines in one recording: how far one's stamps lie behind another's, by when both were heard."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from pbrl_bag.types import Array

LEAST = 0.1
"""Stamps that lie closer together than this [s] may be of one clock: messages take so long on their way."""
STEADY = 0.25
"""Share of the difference that lags may wander by; where they wander more it is no difference of clocks."""
EARLIEST = 5.0
"""Percentile of lags that stands for a message that waited for nothing."""
FEW = 10
"""Messages that a stream needs to be judged by."""
CAMERA = 0.04
"""What a pose is on its way longer than a reading [s]: exposure, transfer, detection; mocap 0.01, tags up to 0.1.

No two lags can tell this from a difference of clocks. A fit finds the rest, whose deviation it takes for 0.05 s.
"""


def clock_offsets(lags: Mapping[str, Sequence[float] | Array], seen: Collection[str] = ()) -> dict[str, float]:
    """Return what has to be added to the stamps of streams whose clock is not that of the others [s].

    A message cannot be heard before it is stamped, and the least it takes is about the same for all of a kind: what the
    earliest of one stream lag more than those of another, its clock is behind by. Poses take `CAMERA` longer.

    Args:
        lags: when each message was heard less its stamp [s], by stream; the first stream has the clock that counts.
        seen: those of the streams that cameras saw.
    """
    usable = {name: np.asarray(each, dtype=float) for name, each in lags.items() if len(each) >= FEW}
    usable = {name: each for name, each in usable.items() if np.isfinite(each).all()}
    if len(usable) < 2:
        return {}
    first = next(iter(usable))
    own = float(np.percentile(usable[first], EARLIEST)) - CAMERA * (first in seen)
    found = {}
    for name, each in usable.items():
        lag = float(np.percentile(each, EARLIEST)) - own
        wander = max(float(np.ptp(np.percentile(heard, (EARLIEST, 95.0)))) for heard in (usable[first], each))
        if abs(lag) > LEAST and wander < STEADY * abs(lag):
            found[name] = round(lag - CAMERA * (name in seen), 4)
    return found


def clock_notes(lags: Mapping[str, Sequence[float] | Array], seen: Collection[str] = ()) -> list[str]:
    """Return a sentence for each stream whose stamps are not of the first one's clock.

    Args:
        lags: as for `clock_offsets`.
        seen: as for `clock_offsets`.
    """
    return [
        f"{name}: its stamps are {abs(offset):.3f} s {'behind' if offset > 0.0 else 'ahead of'} those of "
        f"{next(iter(lags))}, judged by when both were heard; if they come from two machines, say "
        f"clock_offset: {offset:g} for it in a mapping"
        for name, offset in clock_offsets(lags, seen).items()
    ]
