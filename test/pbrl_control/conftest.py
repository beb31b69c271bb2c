"""Shared by the tests of pbrl_control: the robot from its URDF, seeded draws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrl_control.kinematics import SIDES, Posture, RobotKinematics

ROOT = Path(__file__).resolve().parents[2]
SQUARE_TABLE = np.array([1.0668, -1.1286, -0.0096, -2.0422, 0.1238, 1.4877, -0.0624])


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def kinematics() -> RobotKinematics:
    return RobotKinematics.from_file(ROOT / "urdf/krang/krang.urdf")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)


@pytest.fixture
def push_posture() -> Posture:
    return Posture(2.732, 0.0, SQUARE_TABLE.copy(), -SQUARE_TABLE)


@pytest.fixture
def draw_posture(kinematics: RobotKinematics, rng: np.random.Generator):
    def draw() -> Posture:
        arms = [
            rng.uniform(*(0.9 * getattr(kinematics.limits(side), end) for end in ("lower", "upper"))) for side in SIDES
        ]
        return Posture(rng.uniform(0.3, 2.7), rng.uniform(-0.7, 0.7), *arms)

    return draw
