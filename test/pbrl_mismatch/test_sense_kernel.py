"""Faults of sensors in the kernel: undone by their columns, to the recording without them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernel_bench import DT, pushed, speeds
from pushed_table import MASS

from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.kernels.sense_kernel import acting, feel


def test_faults_of_the_force_sensor_are_undone(bench: Any) -> None:
    plain = bench(pushed(10.0)).run()
    scaled = bench(pushed(12.0)).run(force_scale=1.2, torque_scale=1.0)
    biased = bench(pushed(10.0) + np.array([1.0, -2.0, 0.3])).run(bias_x=1.0, bias_y=-2.0, bias_torque=0.3)
    turned = bench(np.tile([10.0 * np.cos(0.3), 10.0 * np.sin(0.3), 0.0], (200, 1))).run(sensor_turn=0.3)
    drift = 0.5 * DT * np.arange(200)[:, None] * [1.0, 0.0, 0.0]
    drifted = bench(pushed(10.0) + drift).run(drift_x=0.5)
    for other in (scaled, biased, turned, drifted):
        np.testing.assert_allclose(other, plain, atol=1e-12)


def test_a_scale_of_the_force_is_the_torque_s_where_none_is_told(bench: Any) -> None:
    wrench = np.tile([6.0, 2.0, 1.5], (100, 1))
    plain = bench(wrench).run()
    np.testing.assert_allclose(bench(1.3 * wrench).run(force_scale=1.3, torque_scale=-1.0), plain, atol=1e-12)
    other = bench(wrench * [1.3, 1.3, 0.8]).run(force_scale=1.3, torque_scale=0.8)
    np.testing.assert_allclose(other, plain, atol=1e-12)


def test_an_offset_acts_from_its_moment_on_and_one_from_before_the_grasp_is_known(bench: Any) -> None:
    plain = bench(pushed(10.0)).run()
    law = {"bias_x": 2.0, "bias_torque": -0.4}
    since = (DT * np.arange(200) > 1.02)[:, None] * [2.0, 0.0, -0.4]
    later = bench(pushed(10.0) + since).run(**law, bias_start=1.02)
    np.testing.assert_allclose(later[:97], plain[:97], atol=1e-12)
    # It comes on over some steps, as much before its moment as after.
    np.testing.assert_allclose(speeds(later)[-1], speeds(plain)[-1], atol=1e-3)
    np.testing.assert_allclose(bench(pushed(10.0)).run(**law, bias_start=-1.0), plain, atol=1e-12)


@pytest.mark.parametrize("clock", [2.0, 1.7e9])
def test_what_a_sensor_says_of_a_force_is_taken_for_that_force(clock: float) -> None:
    rng, row, com, felt, found = np.random.default_rng(0), neutral_row(), np.zeros(2), np.empty((1, 3)), np.empty(3)
    faults = ("bias_x", "bias_y", "bias_torque", "drift_x", "drift_y", "drift_torque", "sensor_turn")
    for came_on, torque_scale in ((-np.inf, 0.7), (clock - 5.0, -1.0), (clock - 0.2, 1.2), (clock + 0.01, -1.0)):
        row[[COLUMN[name] for name in faults]] = rng.standard_normal(len(faults))
        row[[COLUMN["force_scale"], COLUMN["torque_scale"], COLUMN["bias_start"]]] = 1.3, torque_scale, came_on
        heading, force = 0.8, rng.standard_normal(3)
        c, s = np.cos(heading), np.sin(heading)
        feel(row, force, c, s, clock, 0.5, felt[0])
        # The sensor sits at the centre of mass: its force makes no moment there.
        mount, seen = np.array([[c, s, 0.0, 0.0, 0.5]]), np.array([[0.0, 0.0, heading, 0.0, 0.0, 0.0]])
        acting(row, felt, mount, seen, 0, 0, 0, clock, np.array([0.1, 0.0, 0.0, DT]), com, found)
        np.testing.assert_allclose(found, force, atol=1e-12)


def test_time_offset_shifts_the_wrench(bench: Any) -> None:
    wave = 10.0 * np.sin(0.05 * np.arange(200))[:, None] * [1.0, 0.0, 0.0]
    late = bench(wave).run(time_offset=0.2)
    shifted = np.concatenate([np.repeat(wave[:1], 20, 0), wave[:-20]])
    np.testing.assert_allclose(late, bench(shifted).run(), atol=1e-9)


def test_pose_bias_moves_what_is_seen_and_nothing_else(bench: Any) -> None:
    wrench = np.tile([6.0, 2.0, 1.5], (100, 1))
    true = bench(wrench).run()
    c, s = np.cos(true[:, 2]), np.sin(true[:, 2])
    shown = true + np.stack([c * 0.1 - s * 0.05, s * 0.1 + c * 0.05, np.full(101, 0.2)], -1)
    # The lever of the push was taken from what was seen: the moment that the sensor's place makes is made good.
    world = bench(wrench, np.array([*shown[0], 0.0, 0.0, 0.0]), heading=shown[:-1, 2])
    cuts = world.cuts()
    cuts.track.mount[:, 2:4] = true[:-1, :2] - shown[:-1, :2]
    row = neutral_row()
    for name, value in {"mass": MASS, "tag_x": 0.1, "tag_y": 0.05, "tag_theta": 0.2}.items():
        row[COLUMN[name]] = value
    np.testing.assert_allclose(poses(row[None], cuts)[0, 0], shown, atol=1e-9)
