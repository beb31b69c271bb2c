"""The lanes of the kernel: no lane knows of another, and nothing is allocated while they run."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys
from numpy.typing import NDArray

from pbrl_model import kernel
from pbrl_model.engines.window_kernel import simulate_parallel, simulate_serial, simulate_starts
from pbrl_model.errors import ModelError
from pbrl_model.parameters import KERNEL_COLUMNS
from pbrl_model.rollout import rollout, rollout_each, rollout_states

Array = NDArray[np.float64]
COLUMN = {name: index for index, name in enumerate(KERNEL_COLUMNS)}


def mixed_rows(count: int, seed: int = 0) -> Array:
    """Random bodies of every kind, in no order."""
    rng = np.random.default_rng(seed)
    rows = np.zeros((count, len(KERNEL_COLUMNS)))
    rows[:, COLUMN["mass"]] = rng.uniform(2, 60, count)
    wheeled, sliding = rng.random(count) < 0.6, rng.random(count) < 0.4
    rows[:, COLUMN["wheel_x"] : COLUMN["wheel_theta"] + 1] = rng.normal(size=(count, 3)) * [0.4, 0.3, 2.0]
    rows[:, COLUMN["mu_x"]] = wheeled * rng.choice([0.0, 0.05], count)
    rows[:, COLUMN["mu_y"]] = wheeled * rng.uniform(0.01, 0.8, count)
    rows[:, COLUMN["mu_ground"]] = sliding * rng.uniform(0.0, 0.05, count)
    rows[:, COLUMN["hinge_radius"]] = rng.choice([np.nan, np.nan, 0.0, 0.6], count)
    rows[:, COLUMN["hinge_x"] : COLUMN["hinge_y"] + 1] = rng.normal(size=(count, 2)) * 0.3
    rows[:, COLUMN["anchor_x"] : COLUMN["anchor_y"] + 1] = rng.normal(size=(count, 2)) * 0.3
    return rows


def mixed_problem(count: int, steps: int, seed: int = 0) -> dict[str, Array]:
    rng = np.random.default_rng([seed, 7])
    return {
        "parameters": mixed_rows(count, seed),
        "initial": rng.normal(size=(count, 6)) * 0.2,
        "wrench": rng.normal(size=(count, steps, 3)) * [20.0, 20.0, 4.0],
        "inertia_per_mass": rng.uniform(0.02, 0.3, count),
        "com": rng.normal(size=(count, 2)) * 0.1,
    }


@pytest.mark.parametrize("count", [1, 2, 7, 16, 53])
@pytest.mark.parametrize("body_wrench", [False, True])
def test_a_body_moves_the_same_whoever_is_beside_it(count: int, body_wrench: bool) -> None:
    problem = mixed_problem(count, 60)
    together = rollout_each(**problem, body_wrench=body_wrench)
    for n in range(count):
        alone = rollout_each(**{name: value[n : n + 1] for name, value in problem.items()}, body_wrench=body_wrench)
        assert alone[0].tobytes() == together[n].tobytes()


@pytest.mark.parametrize("body_wrench", [False, True])
def test_lanes_do_what_the_plain_loop_does(body_wrench: bool) -> None:
    problem = mixed_problem(60, 200, 2)
    lanes = rollout_each(**problem, body_wrench=body_wrench)
    plain = np.empty((201, 6))
    for n, (row, start, wrench, inertia, com) in enumerate(zip(*problem.values(), strict=True)):
        kernel.integrate(row, start, wrench, 200, inertia, *com, 0.0, 0.0, 0.01, body_wrench, plain)
        np.testing.assert_allclose(lanes[n], plain, rtol=1e-9, atol=1e-9)


def test_order_of_rows_does_not_matter() -> None:
    problem = mixed_problem(70, 50)
    order = np.random.default_rng(3).permutation(70)
    shuffled = rollout_each(**{name: value[order] for name, value in problem.items()})
    assert shuffled.tobytes() == rollout_each(**problem)[order].tobytes()


def test_each_row_over_its_own_window_is_the_diagonal_of_every_row_over_every_window() -> None:
    problem = mixed_problem(9, 40)
    steps = np.array([40, 0, 3, 40, 17, 1, 39, 5, 40])
    every, each = rollout_states(**problem, steps=steps), rollout_each(**problem, steps=steps)
    assert each.shape == (9, 41, 6)
    assert every[np.arange(9), np.arange(9)].tobytes() == each.tobytes()


@pytest.mark.parametrize("run", [rollout, rollout_states, rollout_each])
def test_all_cores_and_one_give_the_same_bytes(run: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(import_module("pbrl_model.rollout"), "SERIAL_STEPS", 0)
    problem = mixed_problem(61, 50)
    together, alone = run(**problem), run(**problem, parallel=False)  # type: ignore[operator]
    assert together.tobytes() == alone.tobytes()


def test_each_needs_a_wrench_and_a_start_of_its_own() -> None:
    problem = mixed_problem(4, 10)
    with pytest.raises(ModelError, match="a wrench for each of 4 rows, got 3"):
        rollout_each(**problem | {"wrench": problem["wrench"][:3]})
    with pytest.raises(ModelError, match=r"shape \(4, 6\)"):
        rollout_each(**problem | {"initial": np.zeros((4, 4, 6))})
    with pytest.raises(ModelError, match="inertia_per_mass"):
        rollout_each(**problem | {"inertia_per_mass": np.array([0.1, 0.1, 0.0, 0.1])})


def allocations(run: object, *arguments: object) -> int:
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats().alloc
        run(*arguments)  # type: ignore[operator]
        return int(rtsys.get_allocation_stats().alloc - before)
    finally:
        _nrt_python.memsys_disable_stats()


def test_nothing_is_allocated_step_by_step_or_row_by_row() -> None:
    def run(count: int, steps: int) -> None:
        rollout_each(**mixed_problem(count, steps), parallel=False)

    run(1, 1)
    assert allocations(run, 1, 1) == allocations(run, 200, 300)


def window_problem(rows: int, windows: int, seed: int = 0) -> tuple[Array, ...]:
    """Arguments of `simulate_serial` but for the last, windows of unlike lengths."""
    rng = np.random.default_rng([seed, 11])
    longest, poses = 50, 9
    forcing = rng.normal(size=(windows, longest, 8)) * 10
    heading = rng.normal(size=(windows, longest))
    forcing[..., 6], forcing[..., 7] = np.cos(heading), np.sin(heading)
    steps = rng.integers(1, longest, windows)
    place = np.sort(rng.uniform(0, steps[:, None], (windows, poses)), axis=1)
    place[:, -1], place[:, -2] = 0.0, steps  # padding is not in order, and a pose may lie at the very end
    return (
        mixed_rows(rows, seed),
        rng.normal(size=(rows, windows, 6)) * 0.3,
        rng.normal(size=(rows, windows, 3)),
        rng.normal(size=rows) * 0.02,
        forcing,
        steps,
        place,
        np.array([0.07, 0.05, -0.02, 0.01, 0.26]),
    )


def test_windows_are_rollouts_read_at_the_recorded_times() -> None:
    problem = window_problem(21, 4)
    rows, initial, offset, late, forcing, steps, place, constants = problem
    out = np.empty((21, 4, place.shape[1], 3))
    simulate_serial(*problem, out)
    inertia, com, dt, lever = constants[0], constants[1:3], constants[3], constants[4]
    for p in range(21):
        for w in range(4):
            c, s = forcing[w, :, 6], forcing[w, :, 7]
            x, y, turn = offset[p, w]
            left_out = np.stack([c * x - s * y, s * x + c * y, np.full(len(c), lever * turn)], axis=-1)
            wrench = forcing[w, :, :3] - late[p] * forcing[w, :, 3:6] + left_out
            path = rollout(rows[p : p + 1], initial[p, w][None], wrench[None, : steps[w]], inertia, com, dt)[0, 0]
            expected = [np.interp(place[w], np.arange(len(path)), path[:, k]) for k in range(3)]
            np.testing.assert_allclose(out[p, w], np.stack(expected, axis=-1), rtol=0, atol=1e-12)


def test_windows_have_the_same_bytes_on_one_core_and_on_all_and_from_many_starts_at_once() -> None:
    problem = window_problem(37, 5, 1)
    rows, initial, offset, late, forcing, steps, place, constants = problem
    alone, together = np.empty((37, 5, place.shape[1], 3)), np.empty((37, 5, place.shape[1], 3))
    simulate_serial(*problem, alone)
    simulate_parallel(*problem, together)
    assert together.tobytes() == alone.tobytes()
    lanes = import_module("pbrl_model.engines.lane_kernel")
    room, path = np.empty(lanes.SIZE), np.empty((forcing.shape[1] + 1, 3, lanes.LANES))
    for w in range(5):
        starts, offsets = initial[:12, w].copy(), offset[:12, w].copy()
        got = np.empty((12, place.shape[1], 3))
        for p in (0, 5, 30):
            simulate_starts(
                rows[p], starts, offsets, late[p], forcing[w], steps[w], place[w], constants, room, path, got
            )
            expected = np.empty((12, 1, place.shape[1], 3))
            many = (np.repeat(rows[p : p + 1], 12, 0), starts[:, None], offsets[:, None], np.full(12, late[p]))
            simulate_serial(*many, forcing[w : w + 1], steps[w : w + 1], place[w : w + 1], constants, expected)
            assert got.tobytes() == expected.tobytes()
