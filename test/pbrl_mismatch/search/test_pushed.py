"""What a left-out wrench would do in the windows of the predictive test: a free body's way, whatever holds the body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.predictive import KNOTS, predictive_test, pushed


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


def kind(name: str) -> Any:
    return baselines(BaselineOptions(20.0, 0.1, 0.1, 0.005), [name], np.zeros(2), np.array([0.6, 0.35]), None)[0]


def test_knots_move_a_free_body_as_the_kernel_does(track: Any) -> None:
    cuts, free = cut_windows(track, 2.0).take(np.arange(6)), kind("free")
    row = free.rows(free.mean[None])[0]
    unit, count = np.array([1.0, 1.0, cuts.track.gyration]), 1 + 3 * KNOTS
    extra = np.zeros((count, len(cuts), KNOTS, 3))
    for k in range(3 * KNOTS):
        extra[1 + k, :, k // 3, k % 3] = 0.01 * unit[k % 3]
    # Heading zero and at rest: the wrench turns with the body.
    told = np.zeros((count, len(cuts), 6))
    found = poses(np.repeat(row[None], count, 0), cuts, told, extra)
    moved = ((found[1:] - found[:1]) * cuts.weight / 0.01).reshape(3 * KNOTS, len(cuts), -1)
    wanted = np.moveaxis(moved, 0, -1)
    # The body turns by what it feels as well, which is the same for all, and goes in steps of a fiftieth of a second.
    assert np.abs(pushed(cuts, row[at.MASS]) - wanted).max() < 0.05 * np.abs(wanted).max()


def test_a_held_body_that_sways_is_no_noise(track: Any) -> None:
    rng, cuts, held = np.random.default_rng(0), cut_windows(track, 2.0), kind("caster")
    strong = held.mean.copy()
    strong[held.columns.index("mu_x")] = np.log(5.0)
    row = held.rows(strong[None])
    still = poses(row, cuts, cuts.told[None], np.zeros((1, len(cuts), 1, 3)))[0]
    noise = rng.standard_normal(cuts.pose.shape) / np.where(cuts.weight > 0.0, cuts.weight, 1.0)

    def verdict(sway: float) -> float:
        way = sway * np.sin(np.pi * cuts.place / cuts.span[:, 1, None])[..., None] * [1.0, 0.0, 0.0]
        objective = Objective(held, replace(cuts, pose=still + noise + way), 0.15)
        return predictive_test(climb(objective, strong[None], iterations=4), 0).p_value

    assert verdict(0.0) > 0.01 and verdict(0.02) < 1e-6
