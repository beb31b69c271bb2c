"""Synthetic recordings of a pushed table, and a bench for the kernel."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pbrl_bag.types import Recording

sys.path.insert(0, str(Path(__file__).parent))
from concealed_cases import make_case
from kernel_bench import Bench


@pytest.fixture(scope="session")
def concealed_recording() -> Callable[..., Recording]:
    """Return a maker of recordings: `concealed_recording(effect, seed, **fields of Truth)`."""
    return make_case


@pytest.fixture(scope="session")
def bench() -> type[Bench]:
    """Return the bench: `bench(wrench).run(drag_linear=3.0)`."""
    return Bench
