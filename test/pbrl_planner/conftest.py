"""Shared by the tests of pbrl_planner: seeded draws."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(6)
