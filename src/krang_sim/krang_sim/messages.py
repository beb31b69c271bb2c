"""Observations as ROS messages on their topics; see `bullet_sim.messages`."""

from __future__ import annotations

from bullet_sim.messages import LATCHED, message_types, stamp, to_messages

__all__ = ["LATCHED", "message_types", "stamp", "to_messages"]
