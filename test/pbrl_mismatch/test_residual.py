"""The unknown-input smoother recovers a wrench that nobody told it of, as surely as it says."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from concealed_cases import concealed, record
from pushed_table import BEFORE, Truth, simulate

from pbrl_bag.types import Recording
from pbrl_mismatch import MismatchError, residual_wrench, track_of
from pbrl_mismatch.data.residual import MEMORIES, MEMORY, accelerations
from pbrl_mismatch.data.track import origin_of
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.kernels.sense_kernel import as_seen, load_now

MASS = 20.0


def table_row(**values: float) -> np.ndarray:
    row = neutral_row()
    row[COLUMN["mass"]] = MASS
    for name, value in values.items():
        row[COLUMN[name]] = value
    return row


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


def test_it_recovers_an_injected_wrench_within_its_covariance(track: Any) -> None:
    # The model is given a force and a moment that are not there: the smoother must find their negatives.
    row = table_row(periodic_x=4.0, periodic_y=-2.0, periodic_torque=1.0, periodic_frequency=0.15)
    found = residual_wrench(track, row)
    wave = np.sin(2 * np.pi * 0.15 * track.clock)
    wanted = -wave[:, None] * [4.0, -2.0, 1.0]
    spread = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    off = (found.world - wanted) / spread
    inside = np.mean(np.abs(off) < 1.96, axis=0)
    assert np.all(inside > 0.85), inside
    assert np.sqrt(np.mean((found.world - wanted) ** 2, axis=0))[0] < 0.45 * 4.0 / np.sqrt(2)


def test_on_a_right_model_it_finds_nothing(track: Any) -> None:
    found = residual_wrench(track, table_row())
    assert found.size <= 1.0
    assert np.mean(found.significance**2) < 1.5


def test_coverage_of_a_random_wrench_is_as_stated(track: Any) -> None:
    # A residual drawn from the smoother's own prior, over the same poses: its errors must be of the stated size.
    rng, inside = np.random.default_rng(5), []
    kept = np.exp(-track.dt / 0.4)
    for _ in range(4):
        drawn = np.zeros((len(track.clock), 3))
        drawn[0] = rng.normal(size=3)
        for t in range(1, len(drawn)):
            drawn[t] = kept * drawn[t - 1] + np.sqrt(1 - kept**2) * rng.normal(size=3)
        drawn *= 3.0 * np.array([1.0, 1.0, track.gyration])
        taken = track.felt.copy()
        c, s = track.mount[:, 0], track.mount[:, 1]
        turned = np.stack([c * drawn[:, 0] + s * drawn[:, 1], -s * drawn[:, 0] + c * drawn[:, 1]], -1)
        arm = track.mount[:, 2:4]
        track.felt[:, :2] -= turned
        track.felt[:, 2] -= drawn[:, 2] - (arm[:, 0] * drawn[:, 1] - arm[:, 1] * drawn[:, 0])
        found = residual_wrench(track, table_row(), size=3.0)
        track.felt[:] = taken
        spread = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
        inside.append(np.abs(found.world - drawn) < 1.96 * spread)
    share = np.mean(np.concatenate(inside), axis=0)
    assert np.all((share > 0.90) & (share < 0.99)), share


def test_feet_that_stick_are_followed_nearer_by_their_law_than_by_none() -> None:
    # About its own predictions a filter is sure that a foot sticks, and lost where it let go a moment earlier.
    off, seen = [], []
    for seed in range(1, 8):
        truth = Truth(
            "breakaway_friction", concealed("breakaway_friction", np.random.default_rng([seed, 7])), wheel=None
        )
        pose, _, _ = simulate(truth, np.random.default_rng(seed))
        track, n = track_of(record(truth, seed), "table"), truth.numbers
        row = table_row(slide_mu=n["mu"], slide_extent=1.0, breakaway_mu=n["extra"], breakaway_speed=n["speed"])
        found, none = residual_wrench(track, row), residual_wrench(track, table_row())
        assert found.size <= 1.0 < none.size
        assert found.log_likelihood > none.log_likelihood + 100.0
        time = BEFORE + track.dt * np.arange(len(pose))
        speed = np.stack([np.interp(track.clock, time, np.gradient(each, time)) for each in pose[:, :2].T], -1)
        off.append(np.mean((found.path[:, 3:5] - speed) ** 2))
        seen.append(np.mean((track.seen[:, 3:5] - speed) ** 2))
    assert np.sqrt(np.mean(off)) < 0.75 * np.sqrt(np.mean(seen)), (off, seen)


def test_of_a_law_that_is_linear_nothing_depends_on_what_it_is_linearised_about(track: Any) -> None:
    row = table_row(steady_x=1.0, drag_linear=4.0)
    once = residual_wrench(track, row, size=1.0)
    again = residual_wrench(track, row, size=1.0, about=once)
    assert again.log_likelihood == pytest.approx(once.log_likelihood, abs=1e-3)
    np.testing.assert_allclose(again.path, once.path, atol=1e-6)
    np.testing.assert_allclose(again.world, once.world, atol=1e-4)


@pytest.mark.parametrize("angle", [-10.0, 0.3])
def test_where_contacts_are_stiff_a_covariance_stays_one(track: Any, angle: float) -> None:
    # A small body that is not there: rounding once grew beside the symmetric part until all was lost.
    rng = np.random.default_rng(2)
    low, high = track.seen[:, :2].min(axis=0) - 0.6, track.seen[:, :2].max(axis=0) + 0.6
    for _ in range(6):
        x, y = rng.uniform(low, high)
        row = table_row(unseen_force=9.0, unseen_x=x, unseen_y=y, unseen_radius=0.06, unseen_angle=angle)
        for size in (0.1, 1.0):
            found = residual_wrench(track, row, size=size)
            np.testing.assert_array_equal(found.covariance, np.swapaxes(found.covariance, -1, -2))
            assert np.linalg.eigvalsh(found.covariance)[:, 0].min() > 0.0
            assert np.abs(found.state[:, :2] - track.seen[:, :2]).max() < 0.5
            assert np.isfinite(found.log_likelihood)


def test_body_axes_are_a_turn_of_world_axes(track: Any) -> None:
    found = residual_wrench(track, table_row(), size=1.0)
    np.testing.assert_allclose(np.hypot(*found.body[:, :2].T), np.hypot(*found.world[:, :2].T), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(found.body_covariance), np.linalg.det(found.covariance), rtol=1e-9)


@pytest.mark.parametrize("moved", [{"com_x": 0.1, "com_y": -0.05}, {"tag_x": 0.04, "tag_y": 0.02, "tag_theta": 0.3}])
def test_the_true_centre_is_where_tags_would_see_the_path(track: Any, moved: dict[str, float]) -> None:
    row, com, pose = table_row(**moved), np.empty(2), np.empty(3)
    found = residual_wrench(track, row, size=1.0)
    load_now(row, 0.0, track.body, com)
    for seen, true in zip(found.path[::50], found.state[::50], strict=True):
        as_seen(row, true, com, pose)
        np.testing.assert_allclose(pose, origin_of(seen[:3], track.body[1:3]), atol=1e-9)


def test_the_same_recording_gives_the_same_bytes(track: Any) -> None:
    one, other = residual_wrench(track, table_row()), residual_wrench(track, table_row())
    assert one.world.tobytes() == other.world.tobytes()


def test_accelerations_are_the_kernel_s(track: Any) -> None:
    rows = np.stack([table_row(), table_row(steady_x=2.0)])
    found = accelerations(track, rows, track.seen, 5)
    np.testing.assert_allclose(found[1] - found[0], np.broadcast_to([0.1, 0.0, 0.0], found[0].shape), atol=1e-9)


def test_what_is_steady_is_remembered_for_longest_and_a_moment_s_push_is_not(track: Any) -> None:
    steady, short = (
        table_row(steady_x=0.6),
        table_row(steady_x=4.0, force_start=track.clock[400], force_end=track.clock[420]),
    )
    memory = {m: residual_wrench(track, steady, memory=m) for m in MEMORIES}
    found = residual_wrench(track, steady, memory=None)
    assert found.log_likelihood == max(each.log_likelihood for each in memory.values())
    np.testing.assert_array_equal(found.world, memory[max(MEMORIES)].world)
    np.testing.assert_array_equal(
        residual_wrench(track, short, memory=None).world, residual_wrench(track, short, memory=min(MEMORIES)).world
    )
    assert np.median(found.significance) > 2.0 * np.median(memory[MEMORY].significance)


@pytest.mark.parametrize("options", [{"size": 0.0}, {"size": np.nan}, {"memory": -1.0}])
def test_bad_options_are_refused(track: Any, options: dict[str, float]) -> None:
    with pytest.raises(MismatchError, match="above zero"):
        residual_wrench(track, table_row(), **options)
    with pytest.raises(MismatchError, match="columns"):
        residual_wrench(track, np.zeros(3))
