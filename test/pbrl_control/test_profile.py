"""The profile of a push: accelerations bounded, ends at rest, frames change without a jump."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.profile import TwistProfile, to_gripper, to_object
from pbrl_control.push_plan import PushPlan
from pbrl_control.types import Hold

HOLD = Hold("table", np.array([-0.35, 0.4]), 0.25)


def plan(*segments: dict, **more: object) -> PushPlan:
    grips = [{"gripper": "left", "point": [-0.375, 0.4]}]
    return PushPlan.model_validate({"name": "p", "object": "table", "grips": grips, "segments": segments, **more})


def run(profile: TwistProfile, dt: float = 0.01) -> np.ndarray:
    twists = []
    while not profile.finished:
        twists.append(profile.step(dt, HOLD))
    return np.array(twists)


def test_frames_there_and_back(rng: np.random.Generator) -> None:
    twist = rng.normal(size=3)
    np.testing.assert_allclose(to_object(to_gripper(twist, HOLD), HOLD), twist)


def test_contact_moves_along_the_gripper() -> None:
    twists = run(TwistProfile(plan({"twist": [0.2, 0, 0], "duration": 3.0})))
    middle = to_gripper(twists[len(twists) // 2], HOLD)
    np.testing.assert_allclose(middle, [0.2, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("frame", ["object", "gripper"])
def test_accelerations_are_bounded_and_the_end_is_rest(frame: str) -> None:
    segments = [
        {"twist": [0.2, 0.0, 0.0], "duration": 1.5, "frame": "object"},
        {"twist": [-0.2, 0.1, 0.2], "duration": 2.0, "frame": frame},
    ]
    twists = run(TwistProfile(plan(*segments, acceleration=0.3, yaw_acceleration=0.6)))
    assert len(twists) == pytest.approx(350, abs=2)
    largest = np.abs(np.diff(twists, axis=0)).max() / 0.01
    assert largest < 0.3 + 0.6 * 0.54 + 0.3, "in the object's axes a turning gripper adds its lever"
    np.testing.assert_allclose(twists[-1], 0.0, atol=0.01)


def test_a_finished_profile_is_at_rest() -> None:
    profile = TwistProfile(plan({"twist": [0.1, 0, 0], "duration": 0.5}))
    run(profile)
    assert not profile.step(0.01, HOLD).any()
