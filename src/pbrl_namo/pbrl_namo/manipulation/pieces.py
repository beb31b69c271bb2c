"""Convex outlines in flat arrays, as kernels take them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Pieces:
    """Convex outlines in `world`.

    Attributes:
        points: (n, 2) corners of all of them, one after the other, counter-clockwise [m].
        starts: (m + 1,) where each begins in `points`.
        owners: (m,) which thing each is of: an index into the yard's names.
        boxes: (m, 4) least x, least y, greatest x, greatest y of each [m].
    """

    points: Array
    starts: Indices
    owners: Indices
    boxes: Array

    @classmethod
    def of(cls, outlines: list[Array], owners: list[int]) -> Pieces:
        """Make them from outlines (k, 2) and what they are of."""
        starts = np.concatenate(([0], np.cumsum([len(outline) for outline in outlines]))).astype(np.int64)
        boxes = np.array([[*outline.min(axis=0), *outline.max(axis=0)] for outline in outlines]).reshape(-1, 4)
        points = np.vstack(outlines) if outlines else np.zeros((0, 2))
        return cls(np.ascontiguousarray(points, dtype=float), starts, np.array(owners, dtype=np.int64), boxes)

    def __len__(self) -> int:
        return len(self.owners)

    def taken(self, chosen: Indices) -> Pieces:
        """Return some of them, by index."""
        outlines = [self.points[self.starts[k] : self.starts[k + 1]] for k in chosen]
        return Pieces.of(outlines, [int(owner) for owner in self.owners[chosen]])
