"""Whether what is said to be held goes along with its gripper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_bag.types import PoseStream, Recording
from pbrl_mismatch import MismatchError
from pbrl_mismatch.faults.carried import check_carried, off_pin, paired

Array = NDArray[np.float64]


def test_a_body_that_turns_about_a_pin_in_the_gripper_is_held() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 10.0, 0.05)
    for _ in range(10):
        gripper = np.column_stack([0.3 * np.sin(time), 0.2 * time, 0.5 * np.sin(0.7 * time)])
        heading = gripper[:, 2] + rng.uniform(-3, 3) + 0.4 * np.sin(1.3 * time)
        own, pin = rng.uniform(-0.2, 0.2, 2), rng.uniform(-0.5, 0.5, 2)

        def turned(angle: Array, point: Array) -> Array:
            c, s = np.cos(angle), np.sin(angle)
            return np.stack([c * point[0] - s * point[1], s * point[0] + c * point[1]], -1)

        place = gripper[:, :2] + turned(gripper[:, 2], own) - turned(heading, pin)
        pair = paired(stream_of(time, place, heading), stream_of(time, gripper[:, :2], gripper[:, 2]), 0.0, 10.0)
        assert pair is not None and off_pin(pair) < 0.01
        away = paired(stream_of(time, place[:1] + 0.0 * place, heading), stream_of(time, *parts(gripper)), 0.0, 10.0)
        assert away is not None and off_pin(away) > 0.1


@pytest.mark.parametrize("offset", [(-0.09, 0.08), (0.15, 0.0)])
def test_a_body_whose_tag_is_glued_on_elsewhere_goes_along_and_one_that_is_lost_does_not(
    concealed_recording: Callable[..., Recording], offset: tuple[float, float]
) -> None:
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 12.0, 0.05)
    gripper = np.column_stack([0.15 * np.sin(time), 0.04 * time, 1.2 * np.sin(0.9 * time)])
    heading = 0.2 * np.sin(0.7 * time)  # the edge turns between the plates
    sound = concealed_recording("clean", 2, seconds=12.0)
    (grasp,) = sound.grasps
    contact = grasp.contact[:2]
    corner = np.stack([np.cos(heading), -np.sin(heading), np.sin(heading), np.cos(heading)], -1).reshape(-1, 2, 2)
    body = gripper[:, :2] - corner @ contact

    def held(place: Array) -> Recording:
        noisy = place + 0.002 * rng.standard_normal(place.shape)
        return replace(
            sound,
            gripper_poses={"left": stream_of(time, *parts(gripper))},
            object_poses={"table": stream_of(time, noisy, heading)},
            grasps=(replace(grasp, start=0.0, end=time[-1]),),
        )

    check_carried(held(body + corner @ offset), "table")
    left = time > 0.75 * time[-1]
    lost = np.where(left[:, None], body[np.argmax(left)], body)
    with pytest.raises(MismatchError, match=r"got one that is 0\.\d+ m off its hold, from t = 9\.\d+ s on"):
        check_carried(held(lost), "table")


def parts(pose: Array) -> tuple[Array, Array]:
    return pose[:, :2], pose[:, 2]


def stream_of(time: Array, place: Array, heading: Array) -> PoseStream:
    nothing = np.zeros_like(heading)
    turn = np.stack([nothing, nothing, np.sin(heading / 2), np.cos(heading / 2)], -1)
    return PoseStream(time, np.column_stack([place, nothing]), turn)
