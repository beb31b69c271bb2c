"""Bullet without its chatter: C code writes to the file descriptors, past `sys.stdout`."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silenced() -> Iterator[None]:
    """Send what C code prints to nowhere while the block runs; Python's own exceptions still surface."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [(number, os.dup(number)) for number in (1, 2)]
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        for number, _ in saved:
            os.dup2(sink, number)
        yield
    finally:
        for number, copy in saved:
            os.dup2(copy, number)
            os.close(copy)
        os.close(sink)


with silenced():  # the import prints a build date
    import pybullet as bullet

__all__ = ["bullet", "silenced"]
