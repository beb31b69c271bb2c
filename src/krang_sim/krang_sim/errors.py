"""Errors of krang_sim. Each message is one line: what was expected, what was got, what to do."""

from __future__ import annotations

from bullet_sim.errors import SimError


class KrangError(SimError):
    """What the Krang simulator refuses: an unknown gripper or posture, a command of the wrong shape."""
