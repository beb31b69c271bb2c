"""What everybody may know of a scene; see `bullet_sim.known`."""

from __future__ import annotations

from bullet_sim.known import known_scene

__all__ = ["known_scene"]
