"""Puts the rooms of fakes within reach of the tests."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from pbrl_control.kinematics import RobotKinematics

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "test/pbrl_control/fetching")]


@pytest.fixture(scope="session")
def kinematics() -> RobotKinematics:
    return RobotKinematics.from_file(ROOT / "urdf/krang/krang.urdf")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)
