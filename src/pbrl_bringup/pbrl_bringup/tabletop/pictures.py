"""Key frames of a run on a desk, as a person beside the table would see it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tabletop_sim.session import DeskSession

Image = NDArray[np.uint8]

EYE, TARGET = (0.22, 0.72, 0.62), (0.0, -0.06, 0.0)
"""Where it stands, across the table from the arm, and what it looks at [m]."""
SIZE = (640, 400)


class Pictures:
    """Takes pictures while a run goes on, and keeps some that are evenly spread over it.

    Args:
        session: the desk.
        most: pictures that are kept.

    Attributes:
        kept: (number of pushes so far, picture).
    """

    def __init__(self, session: DeskSession, most: int = 6) -> None:
        self._session, self._most, self._every = session, most, 1
        self.kept: list[tuple[int, Image]] = []
        self._last: tuple[int, Image] | None = None

    def take(self, pushes: int) -> None:
        """Take a picture after so many pushes."""
        self._last = (pushes, self._session.photograph(EYE, TARGET, *SIZE))
        if pushes % self._every == 0:
            self.kept.append(self._last)
        if len(self.kept) > 2 * self._most:
            self.kept, self._every = self.kept[::2], 2 * self._every

    def strip(self) -> list[tuple[int, Image]]:
        """Return the pictures of a strip: the first, the last, and others evenly between."""
        if self._last is None:
            return []
        rest = [each for each in self.kept if each[0] < self._last[0]]
        chosen = np.unique(np.linspace(0, len(rest) - 1, min(self._most - 1, len(rest))).round().astype(int))
        return [rest[k] for k in chosen] + [self._last]
