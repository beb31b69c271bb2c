"""Estimates out of four numbers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from pbrl_namo.manipulation import Estimate
from pbrl_namo.regions import Opening


@pytest.fixture
def make() -> Callable[..., Estimate]:
    def build(start: int, end: int, probability: float = 1.0, reward: float = -1.0, name: str = "thing") -> Estimate:
        return Estimate(Opening(start, end, name), probability, reward, None)

    return build
