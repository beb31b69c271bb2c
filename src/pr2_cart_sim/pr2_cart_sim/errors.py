"""Errors of pr2_cart_sim. Each message is one line: what was expected, what was got, what to do."""

from __future__ import annotations

from bullet_sim.errors import SimError


class Pr2Error(SimError):
    """What the PR2's simulator refuses: an unknown posture, a command of the wrong shape, a map that is none."""
