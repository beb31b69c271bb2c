"""The test against wrenches that last: even where the model is right, and sharp where one goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from pbrl_bag.types import Recording
from pbrl_mismatch.data.cuts import Cuts, cut_windows
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.kernels.sense_kernel import acting
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.hypothesis import BaselineOptions, Hypothesis, baselines
from pbrl_mismatch.search.lasting import lasting_wrenches, zero_errors
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.predictive import Verdict, knots, predictive_test

FLOOR = 0.15


@pytest.fixture(scope="module")
def cuts(concealed_recording: Callable[..., Recording]) -> Cuts:
    return cut_windows(track_of(concealed_recording("clean", 1), "table"), 2.0)


@pytest.fixture(scope="module")
def free() -> Hypothesis:
    believed = BaselineOptions(20.0, 0.1, 0.1, 0.005)
    return baselines(believed, ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]


def verdict_of(rng: np.random.Generator, cuts: Cuts, free: Hypothesis, wrench: np.ndarray) -> Verdict:
    """Return the test of windows in which a wrench (W, 1, 3) in the body's axes acted besides the sensor's error."""
    row = free.rows(free.mean[None])
    told = cuts.told + np.einsum("wkl,wl->wk", cuts.root, rng.standard_normal(cuts.told.shape))
    own = FLOOR * rng.standard_normal((len(cuts), 1, 3)) * [1.0, 1.0, cuts.track.gyration]
    noise = rng.standard_normal(cuts.pose.shape) / np.where(cuts.weight > 0.0, cuts.weight, 1.0)
    data = replace(cuts, pose=poses(row, cuts, told[None], (own + wrench)[None])[0] + noise)
    return predictive_test(climb(Objective(free, data, FLOOR), free.mean[None], iterations=4), 0)


def test_its_p_values_are_even_or_high_where_the_model_is_right(cuts: Cuts, free: Hypothesis) -> None:
    rng, few = np.random.default_rng(1), cuts.take(np.arange(0, len(cuts), 2))
    found = [verdict_of(rng, few, free, np.zeros((len(few), 1, 3))) for _ in range(60)]
    for values in ([each.lasting for each in found], [each.either for each in found]):
        assert kstest(values, "uniform", alternative="greater").pvalue > 0.01, np.sort(values)


def test_it_sees_what_lasts_though_each_window_could_not_tell_it_from_the_sensor_s_error(
    cuts: Cuts, free: Hypothesis
) -> None:
    rng = np.random.default_rng(2)
    for wrench in ([0.2, 0.0, 0.0], [0.0, 0.0, 0.1]):
        verdict = verdict_of(rng, cuts, free, np.array([[wrench]]))
        assert verdict.lasting < 2e-3 < 1e-2 < verdict.p_value
        assert verdict.either < 4e-3


def test_an_error_of_the_sensor_s_zero_is_the_same_for_all_of_a_hold_in_its_own_axes(cuts: Cuts) -> None:
    steps, track = knots(cuts), cuts.track
    zero = zero_errors(cuts, steps)
    assert zero.shape == (*steps.shape, 3, 3 * len(track.begin))
    c, s, x, y = (track.mount[steps, k] for k in range(4))
    error = np.array([0.3, -0.2, 0.1])
    force = np.stack([c * error[0] - s * error[1], s * error[0] + c * error[1]], -1)
    moment = (x * force[..., 1] - y * force[..., 0]) / track.gyration + error[2]
    assert zero[..., :3] @ error == pytest.approx(np.concatenate([force, moment[..., None]], -1))


def test_a_sensor_that_is_turned_is_felt_as_the_kernel_feels_it(cuts: Cuts, free: Hypothesis) -> None:
    """The last of the lasting wrenches is what a little turn makes of the felt one, torque about the middle and all."""
    track = cuts.track
    turned, out = np.empty((2, len(track.clock), 3)), np.empty(3)
    for k, turn in enumerate((-1e-4, 1e-4)):
        row = free.rows(free.mean[None])[0]
        row[COLUMN["sensor_turn"]] = turn
        last = len(track.clock) - 1
        for t in range(last + 1):
            time = float(track.clock[t])
            acting(row, track.felt, track.mount, track.seen, t, 0, last, time, track.body, track.body[1:3], out)
            turned[k, t] = out
    change = (turned[1] - turned[0]) / [1.0, 1.0, track.gyration]
    steps = np.arange(len(track.clock)).reshape(1, -1)
    felt = lasting_wrenches(cuts, steps)[0, ..., -1]
    along = np.sum(change * felt) / np.sqrt(np.sum(change**2) * np.sum(felt**2))
    assert abs(along) == pytest.approx(1.0, abs=1e-6)


def test_what_passes_is_seen_by_the_other(cuts: Cuts, free: Hypothesis) -> None:
    rng = np.random.default_rng(3)
    wrench = 4.0 * rng.standard_normal((len(cuts), 1, 3)) * [1.0, 1.0, cuts.track.gyration]
    verdict = verdict_of(rng, cuts, free, wrench)
    assert verdict.fleeting < 1e-6 and verdict.either < 1e-5


def test_lasting_wrenches_span_the_same_in_any_frame(cuts: Cuts) -> None:
    """A recording in a world that is turned and moved has the same wrenches, turned."""
    steps, angle = knots(cuts), 0.7
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    track = cuts.track
    seen = track.seen.copy()
    seen[:, :2], seen[:, 2], seen[:, 3:5] = seen[:, :2] @ turn.T + 3.0, seen[:, 2] + angle, seen[:, 3:5] @ turn.T
    mount = track.mount.copy()
    mount[:, 0], mount[:, 1] = c * mount[:, 0] - s * mount[:, 1], s * mount[:, 0] + c * mount[:, 1]
    mount[:, 2:4] = mount[:, 2:4] @ turn.T
    turned = replace(cuts, track=replace(track, seen=seen, mount=mount))
    one, other = lasting_wrenches(cuts, steps), lasting_wrenches(turned, steps)
    whole = np.eye(3)
    whole[:2, :2] = turn
    back = np.einsum("ji,wkjl->wkil", whole, other).reshape(-1, one.shape[-1])
    mine = one.reshape(-1, one.shape[-1])
    assert np.sqrt(np.mean(np.sum(one**2, axis=2), axis=(0, 1))) == pytest.approx(np.ones(one.shape[-1]))
    left = back - mine @ np.linalg.lstsq(mine, back, rcond=None)[0]
    assert np.abs(left).max() < 1e-9
