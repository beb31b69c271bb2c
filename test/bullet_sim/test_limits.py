"""Limits of a hand that watches itself: each is told, and a push that stays within them is the same push."""

from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.hand_push import push_by_hand
from bullet_sim.hand_recording import HandPath, HandPush, Limits
from bullet_sim.scene import Scene
from bullet_sim.sensors import WristReading

LIMITS = Limits(0.4, 0.6, 0.008, np.array([200.0, 500.0, 200.0]), np.array([9.0, 9.0, 9.0]))


def reading(force: float, torque: float) -> WristReading:
    return WristReading(1.0, np.array([0.0, -force, 0.0]), np.array([0.0, 0.0, -torque]))


@pytest.mark.parametrize(
    ("twist", "slipped", "felt", "said"),
    [
        ([0.2, -0.3, 0.5], 0.007, reading(499.0, 8.9), ""),
        ([0.3, -0.3, 0.0], 0.0, reading(0.0, 0.0), "table swings, 0.42 m/s"),
        ([0.0, 0.0, -0.7], 0.0, reading(0.0, 0.0), "0.70 rad/s"),
        ([0.0, 0.0, 0.0], 0.012, reading(0.0, 0.0), "table slips by 12 mm in the hand"),
        ([0.0, 0.0, 0.0], 0.0, reading(501.0, 0.0), "the wrist sensor is at its end"),
        ([0.0, 0.0, 0.0], 0.0, reading(0.0, 9.1), "the wrist sensor is at its end"),
    ],
)
def test_each_limit_is_told(twist: list[float], slipped: float, felt: WristReading, said: str) -> None:
    found = LIMITS.passed("table", np.array(twist), slipped, felt)
    assert said in found and bool(said) == bool(found)


def test_a_push_within_its_limits_is_the_same_and_one_beyond_is_given_up() -> None:
    table = {"kind": "plain_table", "size": [0.7, 1.1], "nominal_mass": 20.0, "pose": [0.0, 0.0, 0.0]}
    outline = [[-3, -3], [3, -3], [3, 3], [-3, 3]]
    scene = Scene.model_validate({"name": "limits", "room": {"outline": outline}, "bodies": {"table": table}})
    path = HandPath(np.array([0.0, 1.0, 2.0]), np.array([[0.0, 0.0, 0.0], [0.15, 0.0, 0.0], [0.0, 0.0, 0.0]]), "hand")
    pushes = (HandPush("table", (-0.35, 0.0), path),)
    free, watched = (push_by_hand(scene, pushes, seed=2, limits=limits) for limits in (None, LIMITS))
    assert free.status == watched.status == "done"
    np.testing.assert_array_equal(free.wrench.force, watched.wrench.force)
    slow = Limits(0.1, 0.6, 0.008, LIMITS.force, LIMITS.torque)
    stopped = push_by_hand(scene, pushes, seed=2, limits=slow)
    assert "table swings, 0.10 m/s" in stopped.status and stopped.seconds < free.seconds
