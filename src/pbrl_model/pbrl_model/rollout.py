"""Rollouts of the compiled kernel, with shapes checked, buffers made and results looked at.

State (x, y, theta, vx, vy, omega) of the centre of mass in world; wrench (fx, fy, tau) at the centre of
mass in world axes, constant over a step. Poses that come back are of the body's frame origin.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_model import kernel
from pbrl_model.errors import ModelError
from pbrl_model.parameters import KERNEL_COLUMNS

Array = NDArray[np.float64]

DT = 0.01  # [s]
SERIAL_STEPS = 20_000  # below this many body steps in all, waking the other cores costs more than it saves
# Some of numba's threading layers end the process when two threads start parallel work at once.
KERNEL_LOCK = threading.Lock()


def rollout(
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    inertia_per_mass: float,
    com: ArrayLike = (0.0, 0.0),
    dt: float = DT,
    steps: ArrayLike | None = None,
    *,
    parallel: bool = True,
) -> Array:
    """Simulate every parameter row over every window; return poses of the body's frame origin.

    Args:
        parameters: (P, 12) rows of `KERNEL_COLUMNS`; wheel and anchor in the body's frame, hinge in world.
        initial: (W, 6) or (P, W, 6) state of the centre of mass at each window's start.
        wrench: (W, T, 3) [N, N, N m] at the centre of mass, world axes, constant over each step.
        inertia_per_mass: [m^2].
        com: (2,) centre of mass in the body's frame [m].
        dt: [s].
        steps: (W,) steps of each window, 0..T; None: T for all.
        parallel: False from callers that are parallel themselves. The bytes are the same.

    Returns:
        (P, W, T + 1, 3) x, y [m], theta [rad, not wrapped] in world; NaN past a window's own end.

    Raises:
        ModelError: a shape does not fit, a value is not physical, or the motion is not finite.
    """
    return _run(parameters, initial, wrench, inertia_per_mass, com, dt, steps, parallel, of_com=False)


def rollout_states(
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    inertia_per_mass: float,
    com: ArrayLike = (0.0, 0.0),
    dt: float = DT,
    steps: ArrayLike | None = None,
    *,
    parallel: bool = True,
) -> Array:
    """Do what `rollout` does, but return (P, W, T + 1, 6) states of the centre of mass."""
    return _run(parameters, initial, wrench, inertia_per_mass, com, dt, steps, parallel, of_com=True)


def com_to_origin(com_pose: ArrayLike, com: ArrayLike) -> Array:
    """Turn poses (..., 3) of the centre of mass into poses of the body's frame origin."""
    return _shift(com_pose, -_vector("com", com, 2))


def origin_to_com(origin_pose: ArrayLike, com: ArrayLike) -> Array:
    """Turn poses (..., 3) of the body's frame origin into poses of the centre of mass."""
    return _shift(origin_pose, _vector("com", com, 2))


def _shift(pose: ArrayLike, offset: Array) -> Array:
    moved = np.array(pose, dtype=float)
    c, s = np.cos(moved[..., 2]), np.sin(moved[..., 2])
    moved[..., 0] += c * offset[0] - s * offset[1]
    moved[..., 1] += s * offset[0] + c * offset[1]
    return moved


def _run(
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    inertia_per_mass: float,
    com: ArrayLike,
    dt: float,
    steps: ArrayLike | None,
    parallel: bool,
    *,
    of_com: bool,
) -> Array:
    rows = _parameter_rows(parameters)
    forces = np.ascontiguousarray(wrench, dtype=float)
    if forces.ndim != 3 or forces.shape[2] != 3:
        raise ModelError(f"rollout: expected wrench of shape (windows, steps, 3), got {forces.shape}")
    windows, longest = forces.shape[:2]
    start = _initial_states(initial, rows.shape[0], windows)
    counts = _step_counts(steps, windows, longest)
    centre = _vector("com", com, 2)
    _positive("inertia_per_mass", inertia_per_mass, "m^2")
    _positive("dt", dt, "s")
    origin = np.zeros(2) if of_com else centre
    out = np.empty((rows.shape[0], windows, longest + 1, 6 if of_com else 3))
    arguments = (rows, start, forces, counts, float(inertia_per_mass), centre, origin, float(dt), out)
    if parallel and rows.shape[0] * int(counts.sum()) > SERIAL_STEPS:
        with KERNEL_LOCK:
            kernel.rollout_parallel(*arguments)
    else:
        kernel.rollout_serial(*arguments)
    _check_motion(out, counts, forces, start)
    return out


def _parameter_rows(parameters: ArrayLike) -> Array:
    rows = np.ascontiguousarray(parameters, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != len(KERNEL_COLUMNS):
        raise ModelError(f"rollout: expected parameters of shape (n, {len(KERNEL_COLUMNS)}), got {rows.shape}")
    radius = rows[:, kernel.HINGE_RADIUS]
    finite = np.isfinite(np.delete(rows, kernel.HINGE_RADIUS, axis=1)).all(axis=1) & ~np.isinf(radius)
    legal = (
        finite
        & (rows[:, kernel.MASS] > 0.0)
        & (rows[:, kernel.MU_X] >= 0.0)
        & (rows[:, kernel.MU_Y] >= 0.0)
        & (rows[:, kernel.MU_GROUND] >= 0.0)
        & ~(radius < 0.0)
    )
    if not legal.all():
        worst = int(np.argmin(legal))
        values = ", ".join(f"{name}={value:g}" for name, value in zip(KERNEL_COLUMNS, rows[worst], strict=True))
        raise ModelError(
            f"rollout: expected finite parameters with mass > 0, mu >= 0, hinge_radius >= 0 or NaN, "
            f"got in row {worst}: {values}"
        )
    return rows


def _initial_states(initial: ArrayLike, rows: int, windows: int) -> Array:
    start = np.asarray(initial, dtype=float)
    if start.shape == (windows, 6):
        start = start[None]
    if start.shape not in ((1, windows, 6), (rows, windows, 6)):
        raise ModelError(
            f"rollout: expected initial of shape ({windows}, 6) or ({rows}, {windows}, 6), got {start.shape}"
        )
    return np.ascontiguousarray(start)


def _step_counts(steps: ArrayLike | None, windows: int, longest: int) -> NDArray[np.int64]:
    counts = np.full(windows, longest) if steps is None else np.asarray(steps)
    if counts.shape != (windows,) or counts.dtype.kind not in "iu":
        raise ModelError(
            f"rollout: expected steps as {windows} whole numbers, got {counts.dtype} of shape {counts.shape}"
        )
    if windows and (counts.min() < 0 or counts.max() > longest):
        raise ModelError(f"rollout: expected steps in 0..{longest}, got {counts.min()}..{counts.max()}")
    return np.ascontiguousarray(counts, dtype=np.int64)


def _check_motion(out: Array, counts: NDArray[np.int64], forces: Array, start: Array) -> None:
    """Raise for a motion that is not finite: what is wrong shows at the end of a window, for NaN never leaves."""
    last = out[:, np.arange(counts.size), counts]
    if np.isfinite(last).all():
        return
    if not np.isfinite(start).all():
        raise ModelError("rollout: expected finite initial states, got NaN or infinity")
    for window, count in enumerate(counts):
        bad = ~np.isfinite(forces[window, :count]).all(axis=1)
        if bad.any():
            raise ModelError(
                f"rollout: expected finite wrenches, got {forces[window][int(np.argmax(bad))]} at step "
                f"{int(np.argmax(bad))} of window {window}"
            )
    row, window = (int(index) for index in np.argwhere(~np.isfinite(last))[0][:2])
    raise ModelError(f"rollout: the motion of parameter row {row} in window {window} is not finite; dt may be too long")


def _vector(name: str, value: ArrayLike, length: int) -> Array:
    vector = np.ascontiguousarray(value, dtype=float)
    if vector.shape != (length,) or not np.isfinite(vector).all():
        raise ModelError(f"rollout: expected {name} as {length} finite numbers, got {vector.tolist()}")
    return vector


def _positive(name: str, value: float, unit: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise ModelError(f"rollout: expected {name} above zero [{unit}], got {value!r}")
