"""Reads hostile inputs in a process of its own: `python -m pbrl_bringup.fuzz READER SEED START STOP FOLDER`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from pbrl_bringup.fuzz.subjects import subject
from pbrl_bringup.fuzz.worker import work
from pbrl_bringup.processes import die_with_parent


def main(name: str, seed: str, start: str, stop: str, folder: str) -> None:
    """Read the inputs from `start` up to, not including, `stop`."""
    die_with_parent()
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    work(name, subject(name, place), int(seed), range(int(start), int(stop)), place)
    sys.stdout.flush()
    os._exit(0)  # threads of a node that plans would be waited for otherwise


if __name__ == "__main__":
    main(*sys.argv[1:])
