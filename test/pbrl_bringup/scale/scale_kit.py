"""Pieces of work for workers: each is a function of a module, as those of the product are."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path

import numba

STRANGE, DEADLY = 3, 2


def square(number: int) -> int:
    return number * number


def one_is_wrong(number: int) -> int:
    if number == STRANGE:
        raise ValueError("three is wrong")
    return number


def held_up_once(number: int, folder: Path) -> int:
    """Square a number; the first run of one of them says which process it is in and never ends."""
    with (folder / "runs").open("a") as file:
        file.write(f"{number}\n")
    if number == STRANGE:
        try:
            (folder / "begun").touch(exist_ok=False)
        except FileExistsError:
            return number * number
        (folder / "fifo").write_text(str(os.getpid()))
        threading.Event().wait()
    return number * number


def deadly(number: int) -> int:
    if number == DEADLY:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def surroundings() -> dict[str, object]:
    return {
        "pid": os.getpid(),
        "threads": numba.get_num_threads(),
        "most": numba.config.NUMBA_NUM_THREADS,  # type: ignore[attr-defined]
        "blas": os.environ.get("OPENBLAS_NUM_THREADS"),
        "deaf": signal.getsignal(signal.SIGINT) == signal.SIG_IGN,
        "cache": os.environ.get("NUMBA_CACHE_DIR"),
    }
