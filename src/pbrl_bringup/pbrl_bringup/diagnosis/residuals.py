"""`residual.json` beside a diagnosis: the wrench that each object's model lacks, over time.

Light to import: `pbrl view` reads the file without what made it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REPORT, PAGE, RESIDUALS = RESULTS = "report.json", "report.html", "residual.json"
"""What a diagnosis writes beside models; the first is written last, and says that the rest is there."""
MOST = 6000
"""Moments of one object in the file; of a longer recording every so many are left out."""


class Wrench(Protocol):
    """What is written of `pbrl_mismatch.data.residual.ResidualWrench`; see there."""

    @property
    def time(self) -> Array:
        """Return (T,) times on the recording's clock [s]."""

    @property
    def world(self) -> Array:
        """Return (T, 3) the wrench at the centre of mass, world axes [N, N, N m]."""

    @property
    def covariance(self) -> Array:
        """Return (T, 3, 3) of `world`."""


def residuals_to_json(residuals: Mapping[str, Wrench]) -> dict[str, Any]:
    """Return the content of the file: times [s], forces [N] and moment [N m], and their standard deviations."""
    return {"objects": {name: _one(each) for name, each in residuals.items()}}


def _one(residual: Wrench) -> dict[str, Any]:
    order = np.argsort(residual.time, kind="stable")
    rows = order[np.concatenate([[True], np.diff(residual.time[order]) > 0.0])]
    rows = rows[:: -(-len(rows) // MOST)]
    sd = np.sqrt(np.einsum("tii->ti", residual.covariance[rows]))
    return {
        "time": np.round(residual.time[rows], 4).tolist(),
        "wrench": np.round(residual.world[rows], 3).tolist(),
        "sd": np.round(sd, 3).tolist(),
    }
