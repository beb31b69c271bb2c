"""The command that does one of many recordings alone."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any


def command_of(command: str, bag: Path, out: Path, **options: Any) -> str:
    """Return the command that does one recording alone, as it is shown on that one's page."""
    words = ["./pbrl", command, str(bag), "--out", str(out)]
    for name, value in options.items():
        for each in value if isinstance(value, list | tuple) else [value]:
            words += [] if each is None else [f"--{name.replace('_', '-')}", str(each)]
    return shlex.join(words)
