"""Where something was claimed against where it acted: F1 over samples of time, cells of the floor, and regimes.

Truth and claims are both put on the same samples of the recorded motion, ten a second, while the object moves. What
acts on a cell or in a regime is what acts in more than half of the samples there. An effect that is a region of the
floor acts where its region is; others where the feet stood while they acted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import contains_xy
from shapely.geometry import Polygon

from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.diagnosis.told import acting_times
from pbrl_bringup.rivals.samples import CELL, Regimes, Samples

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REGIMES = ("speed", "direction")
"""Axes that are scored as regimes; time and floor have scores of their own."""
REGIONS = frozenset({"floor_patch"})
"""Effects that are a region of the floor."""


@dataclass(frozen=True)
class Localised:
    """How well something was localised; NaN where there is nothing to be localised.

    Attributes:
        time: F1 over moving samples.
        region: F1 over cells of the floor.
        regime: F1 over bins of speed and direction.
        overlap: intersection over union in time.
    """

    time: float
    region: float
    regime: float
    overlap: float


def f1(claimed: Mask, true: Mask) -> float:
    """Return the harmonic mean of precision and recall; 1 where nothing is claimed and nothing true."""
    both = int(np.count_nonzero(claimed & true))
    total = int(np.count_nonzero(claimed)) + int(np.count_nonzero(true))
    return 2.0 * both / total if total else 1.0


def acting(truth: Truth, samples: Samples) -> Mask:
    """Return (n,) the moving samples in which anything that was concealed acts."""
    found = samples.inside([])
    for intervals in truth.when.values():
        found |= samples.inside(intervals)
    return found & samples.moving


def localise(
    truth: Truth,
    samples: Samples,
    regimes: Regimes,
    claimed: Mask,
    outlines: Sequence[Array] = (),
    flagged: Mapping[str, Sequence[str]] | None = None,
) -> Localised:
    """Score one claim.

    Args:
        truth: what was concealed.
        samples: n of the recording.
        regimes: of those samples.
        claimed: (n,) samples in which it is claimed to act.
        outlines: (k, 2) regions of the floor that are claimed, where there are any [m].
        flagged: names of regimes that are claimed by axis; axes that are missing follow from `claimed`.
    """
    if not truth.effects:
        return Localised(*(float("nan"),) * 4)
    told = flagged or {}
    true, claimed = acting(truth, samples), claimed & samples.moving
    polygons = [np.array(truth.place[name]) for name in truth.effects if name in REGIONS and truth.place[name]]
    region = float("nan")
    if polygons:
        names = list(regimes["floor"])
        if "floor" in told:
            wanted = np.isin(names, list(told["floor"]))
        elif outlines:
            wanted = _on_cells(regimes, outlines)
        else:
            wanted = _mostly(regimes["floor"], claimed)
        region = f1(wanted, _on_cells(regimes, polygons))
    scores = [_regime(regimes[axis], told.get(axis), claimed, true) for axis in REGIMES]
    either = int(np.count_nonzero(claimed | true))
    overlap = float(np.count_nonzero(claimed & true) / either) if either else 1.0
    return Localised(f1(claimed, true), region, float(np.mean(scores)), overlap)


def _regime(bins: Mapping[str, Mask], told: Sequence[str] | None, claimed: Mask, true: Mask) -> float:
    wanted = _mostly(bins, claimed) if told is None else np.isin(list(bins), list(told))
    return f1(wanted, _mostly(bins, true))


def _mostly(bins: Mapping[str, Mask], chosen: Mask) -> Mask:
    """Return which bins have more than half of their samples among the chosen."""
    return np.array([chosen[inside].mean() > 0.5 for inside in bins.values()], dtype=bool)


def _on_cells(regimes: Regimes, outlines: Sequence[Array]) -> Mask:
    """Return which visited cells of the floor have their middle in one of the outlines (k, 2)."""
    from_names = np.array([[float(part) for part in name.split(",")] for name in regimes["floor"]]).reshape(-1, 2)
    middles = (from_names + 0.5) * CELL
    found = np.zeros(len(middles), dtype=bool)
    for outline in outlines:
        found |= contains_xy(Polygon(outline), middles[:, 0], middles[:, 1])
    return found


def claimed_by_report(found: Mapping[str, Any], samples: Samples) -> tuple[Mask, list[Array]]:
    """Return the samples (n,) and the floor outlines that one object's part of a report claims.

    An effect without times acts always; one that is a region of the floor claims its outline. Of what has no name those
    times are claimed at which it is surely there.
    """
    claimed, outlines = samples.inside(acting_times(found)), []
    for each in found["effects"]:
        claimed |= each.get("when") is None
        where = each.get("where")
        if each["effect"] in REGIONS and where is not None:
            outlines.append(np.array(where["shape"], dtype=float))
    return claimed, outlines
