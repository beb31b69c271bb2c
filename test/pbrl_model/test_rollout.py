"""The kernel's wrapper: shapes, windows of their own length, the body's frame, and what it refuses."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.parameters import KERNEL_COLUMNS, BodyParameters
from pbrl_model.rollout import com_to_origin, origin_to_com, rollout, rollout_states

ROW = BodyParameters(10.0, 0.3, 0.2, 0.5, 0.02, 0.3).to_vector()
COM = np.array([0.1, -0.05])


def some(windows: int = 2, steps: int = 40) -> dict[str, object]:
    rng = np.random.default_rng(0)
    return {
        "parameters": np.stack([ROW, ROW * 1.1, ROW * 0.9]),
        "initial": rng.normal(size=(windows, 6)),
        "wrench": rng.normal(size=(windows, steps, 3)) * 10,
        "inertia_per_mass": 0.07,
        "com": COM,
    }


def test_poses_are_those_of_the_frame_that_the_centre_of_mass_sits_in() -> None:
    poses, states = rollout(**some()), rollout_states(**some())  # type: ignore[arg-type]
    assert poses.shape == (3, 2, 41, 3) and states.shape == (3, 2, 41, 6)
    np.testing.assert_allclose(com_to_origin(states[..., :3], COM), poses, atol=1e-12)
    np.testing.assert_allclose(origin_to_com(poses, COM), states[..., :3], atol=1e-12)


def test_windows_end_where_they_are_told_to() -> None:
    arguments = some()
    whole = rollout(**arguments)  # type: ignore[arg-type]
    part = rollout(**arguments, steps=[40, 7])  # type: ignore[arg-type]
    np.testing.assert_array_equal(part[:, 0], whole[:, 0])
    np.testing.assert_array_equal(part[:, 1, :8], whole[:, 1, :8])
    assert np.isnan(part[:, 1, 8:]).all()


def test_one_start_for_all_rows_is_the_same_start_for_each() -> None:
    arguments = some()
    each = arguments | {"initial": np.stack([arguments["initial"]] * 3)}  # type: ignore[list-item]
    np.testing.assert_array_equal(rollout(**arguments), rollout(**each))  # type: ignore[arg-type]


def test_nothing_shares_memory_with_what_came_in_or_out_before() -> None:
    arguments = some()
    first = rollout(**arguments)  # type: ignore[arg-type]
    kept = first.copy()
    rollout(**arguments | {"wrench": np.zeros((2, 40, 3))})  # type: ignore[arg-type]
    np.testing.assert_array_equal(first, kept)


def test_threads_may_call_at_once() -> None:
    arguments = some(windows=8, steps=2000)
    expected = rollout(**arguments)  # type: ignore[arg-type]
    results: list[np.ndarray] = []
    threads = [threading.Thread(target=lambda: results.append(rollout(**arguments))) for _ in range(4)]  # type: ignore[arg-type]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 4
    assert all(result.tobytes() == expected.tobytes() for result in results)


def test_no_rows_or_no_windows_is_an_empty_answer() -> None:
    assert rollout(np.empty((0, len(KERNEL_COLUMNS))), np.zeros((1, 6)), np.zeros((1, 5, 3)), 0.1).shape == (0, 1, 6, 3)
    assert rollout(ROW[None], np.zeros((0, 6)), np.zeros((0, 5, 3)), 0.1).shape == (1, 0, 6, 3)


def changed(**fields: float) -> np.ndarray:
    row = ROW.copy()
    for name, value in fields.items():
        row[KERNEL_COLUMNS.index(name)] = value
    return row[None]


BAD = {
    "columns": ({"parameters": np.ones((1, 10))}, "shape"),
    "flat": ({"parameters": ROW}, "shape"),
    "mass": ({"parameters": changed(mass=0.0)}, "mass=0"),
    "mu": ({"parameters": changed(mu_x=-0.1)}, "mu >= 0"),
    "mu_ground": ({"parameters": changed(mu_ground=-0.01)}, "mu_ground=-0.01"),
    "nan": ({"parameters": changed(wheel_theta=float("nan"))}, "wheel_theta=nan"),
    "radius": ({"parameters": changed(hinge_radius=-1.0)}, "hinge_radius"),
    "infinite": ({"parameters": changed(hinge_radius=float("inf"))}, "hinge_radius=inf"),
    "wrench": ({"wrench": np.zeros((2, 40))}, "wrench of shape"),
    "nan wrench": ({"wrench": np.full((2, 40, 3), np.nan)}, "step 0 of window 0"),
    "initial": ({"initial": np.zeros((3, 6))}, "initial of shape"),
    "nan initial": ({"initial": np.full((2, 6), np.nan)}, "finite initial"),
    "inertia": ({"inertia_per_mass": 0.0}, "inertia_per_mass"),
    "com": ({"com": (0.0, np.inf)}, "com"),
    "dt": ({"dt": -0.01}, "dt"),
    "steps": ({"steps": [1, 41]}, "0..40"),
    "negative": ({"steps": [-1, 4]}, "0..40"),
    "fraction": ({"steps": [1.5, 4.0]}, "whole numbers"),
    "few": ({"steps": [3]}, "2 whole numbers"),
}


@pytest.mark.parametrize(("fields", "what"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_refused_in_one_line(fields: dict[str, object], what: str) -> None:
    with pytest.raises(ModelError, match=what) as caught:
        rollout(**some() | fields)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
