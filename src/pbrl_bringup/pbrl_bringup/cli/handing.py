"""How the command line hands over to a command."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def hand_over(command: str, **arguments: Any) -> int:
    """Run `pbrl_bringup.commands.<command>.command`, imported only now: what it needs may be heavy."""
    return int(import_module(f"pbrl_bringup.commands.{command}").command(**arguments))
