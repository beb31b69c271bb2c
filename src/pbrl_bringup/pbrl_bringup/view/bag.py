"""A recording as the page's source."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

from pbrl_bag import read_recording
from pbrl_bringup.view.decorate import decorated
from pbrl_bringup.view.diagnosed import Diagnosed
from pbrl_bringup.view.extras import Extras
from pbrl_bringup.view.shown import Shown, shown_of


class BagSource:
    """What the page shows of a bag; read once, and kept.

    Args:
        shown: what can be drawn of it.
    """

    live = False

    def __init__(self, shown: Shown) -> None:
        self.shown = shown

    def data(self) -> dict[str, Any]:
        """Return all that is still and the whole of the streams, coarsely."""
        return self.shown.data()

    def detail(self, start: float, end: float, most: int) -> dict[str, Any]:
        """Return the streams between two times [s], at most `most` samples of each."""
        return self.shown.detail(start, end, most)

    async def events(self) -> AsyncIterator[str]:
        """Yield nothing: a recording does not change."""
        return
        yield ""


def read_shown(
    bag: Path,
    mapping: Path | None,
    models: Mapping[str, Mapping[str, Any]] | None = None,
    diagnosed: Diagnosed | None = None,
) -> Shown:
    """Read what can be drawn of a bag.

    Args:
        bag: folder or file.
        mapping: which topic plays which role, or None.
        models: learned models by object; they go before those that the bag has.
        diagnosed: what a diagnosis found; it goes before what the bag has.

    Raises:
        BagError: it cannot be read, is malformed, or holds nothing that can be drawn.
    """
    extras = Extras()
    recording = read_recording(bag, mapping, complete=False, also=extras.hearers())
    return decorated(shown_of(recording, str(bag)), extras, models, diagnosed)
