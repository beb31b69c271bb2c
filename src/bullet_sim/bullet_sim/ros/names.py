"""Names of topics of a robot that may have a namespace of its own."""

from __future__ import annotations

GLOBAL = ("/clock", "/tf", "/tf_static")
"""Absolute in every stack; a rule such as `-r /tf:=/robot_1/tf` gives a robot its own."""


def relative(name: str) -> str:
    """Return a name such that it lies in the namespace of the node that uses it; what is global stays so."""
    return name if name in GLOBAL else name.removeprefix("/")
