"""Errors of tabletop_sim. Each message is one line: what was expected, what was got, what to do."""

from __future__ import annotations

from bullet_sim.errors import SimError


class TabletopError(SimError):
    """What the tabletop's simulator refuses: an unknown kind of item, items in each other, a wrong command."""
