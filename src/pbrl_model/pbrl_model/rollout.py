"""Rollouts of the compiled kernel, with shapes checked, buffers made and results looked at.

State (x, y, theta, vx, vy, omega) of the centre of mass in world; wrench (fx, fy, tau) at the centre of
mass in world axes, constant over a step. Poses that come back are of the body's frame origin.
"""

from __future__ import annotations

import threading

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_model import kernel
from pbrl_model.engines import lane_kernel, rollout_kernel
from pbrl_model.errors import ModelError
from pbrl_model.parameters import KERNEL_COLUMNS

Array = NDArray[np.float64]

DT = 0.01  # [s]
SERIAL_STEPS = 60_000  # below this many body steps in all, waking the other cores costs more than it saves
_NOT_NEGATIVE = [kernel.MU_X, kernel.MU_Y, kernel.MU_GROUND, kernel.HINGE_RADIUS]
_MAY_BE_NAN = np.arange(len(KERNEL_COLUMNS)) == kernel.HINGE_RADIUS
# Some of numba's threading layers end the process when two threads start parallel work at once.
KERNEL_LOCK = threading.Lock()


def rollout(
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    inertia_per_mass: ArrayLike,
    com: ArrayLike = (0.0, 0.0),
    dt: float = DT,
    steps: ArrayLike | None = None,
    *,
    parallel: bool = True,
    body_wrench: bool = False,
) -> Array:
    """Simulate every parameter row over every window; return poses of the body's frame origin.

    Args:
        parameters: (P, 12) rows of `KERNEL_COLUMNS`; wheel and anchor in the body's frame, hinge in world.
        initial: (W, 6) or (P, W, 6) state of the centre of mass at each window's start.
        wrench: (W, T, 3) [N, N, N m] at the centre of mass, world axes, constant over each step.
        inertia_per_mass: [m^2], one or (P,): rows may be of different bodies, as long as none touches another.
        com: (2,) centre of mass in the body's frame [m], or (P, 2).
        dt: [s].
        steps: (W,) steps of each window, 0..T; None: T for all.
        parallel: False from callers that are parallel themselves. The bytes are the same.
        body_wrench: the wrench's force is in the body's axes, which turn with the simulated heading (after the pose
            has advanced in the step), as what a gripper exerts does.

    Returns:
        (P, W, T + 1, 3) x, y [m], theta [rad, not wrapped] in world; NaN past a window's own end.

    Raises:
        ModelError: a shape does not fit, a value is not physical, or the motion is not finite.
    """
    return _run(parameters, initial, wrench, inertia_per_mass, com, dt, steps, parallel, body_wrench, of_com=False)


def rollout_states(
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    inertia_per_mass: ArrayLike,
    com: ArrayLike = (0.0, 0.0),
    dt: float = DT,
    steps: ArrayLike | None = None,
    *,
    parallel: bool = True,
    body_wrench: bool = False,
) -> Array:
    """Do what `rollout` does, but return (P, W, T + 1, 6) states of the centre of mass."""
    return _run(parameters, initial, wrench, inertia_per_mass, com, dt, steps, parallel, body_wrench, of_com=True)


def plain(value: ArrayLike) -> Array:
    """Return numbers as the one kind of array that the kernels are compiled for: contiguous and not read-only."""
    return np.require(value, float, ["C", "W"])


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


def rollout_each(
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    inertia_per_mass: ArrayLike,
    com: ArrayLike = (0.0, 0.0),
    dt: float = DT,
    steps: ArrayLike | None = None,
    *,
    parallel: bool = True,
    body_wrench: bool = False,
) -> Array:
    """Simulate row n over window n alone: many bodies, each with its own wrench; return states of the centres of mass.

    Args:
        parameters: (N, 12) rows of `KERNEL_COLUMNS`.
        initial: (N, 6) states of the centres of mass.
        wrench: (N, T, 3), as of `rollout`.
        inertia_per_mass: [m^2], one or (N,).
        com: (2,) or (N, 2) [m].
        dt: [s].
        steps: (N,) steps of each window, 0..T; None: T for all.
        parallel: as of `rollout`.
        body_wrench: as of `rollout`.

    Returns:
        (N, T + 1, 6); NaN past a window's own end.

    Raises:
        ModelError: as `rollout`.
    """
    rows, forces = _parameter_rows(parameters), _wrenches(wrench)
    if len(forces) != len(rows):
        raise ModelError(f"rollout: expected a wrench for each of {len(rows)} rows, got {len(forces)}")
    start = _initial_states(np.asarray(initial, dtype=float), len(rows), len(rows))
    if start.shape[0] != 1:
        raise ModelError(f"rollout: expected initial of shape ({len(rows)}, 6), got {start.shape}")
    start = plain(start[0][:, None])
    body = _bodies(len(rows), inertia_per_mass, com)
    counts = _step_counts(steps, len(rows), forces.shape[1])
    return _compute(rows, start, forces, counts, body, dt, parallel, body_wrench, of_com=True, paired=True)[:, 0]


def _run(
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    inertia_per_mass: ArrayLike,
    com: ArrayLike,
    dt: float,
    steps: ArrayLike | None,
    parallel: bool,
    body_wrench: bool,
    *,
    of_com: bool,
) -> Array:
    rows, forces = _parameter_rows(parameters), _wrenches(wrench)
    windows, longest = forces.shape[:2]
    start = _initial_states(initial, rows.shape[0], windows)
    counts = _step_counts(steps, windows, longest)
    body = _bodies(len(rows), inertia_per_mass, com)
    return _compute(rows, start, forces, counts, body, dt, parallel, body_wrench, of_com=of_com, paired=False)


def _compute(
    rows: Array,
    start: Array,
    forces: Array,
    counts: NDArray[np.int64],
    body: tuple[Array, Array],
    dt: float,
    parallel: bool,
    body_wrench: bool,
    *,
    of_com: bool,
    paired: bool,
) -> Array:
    """Make the rooms to work in, run the compiled code, look at what comes out."""
    _positive("dt", dt, "s")
    count, columns = len(rows), 1 if paired else len(forces)
    out = np.empty((count, columns, forces.shape[1] + 1, 6 if of_com else 3))
    total = int(counts.sum()) * (1 if paired else count)
    parallel = parallel and total > SERIAL_STEPS
    workers = numba.get_num_threads() if parallel else 1
    arguments = (
        rows,
        start,
        forces,
        counts,
        *body,
        of_com,
        float(dt),
        bool(body_wrench),
        paired,
        np.empty(count, dtype=np.int64),
        np.empty((count * columns // lane_kernel.LANES + rollout_kernel.KINDS, 5), dtype=np.int64),
        np.empty((workers, lane_kernel.SIZE)),
        np.empty((workers, 2, lane_kernel.LANES), dtype=np.int64),
        out,
    )
    if parallel:
        with KERNEL_LOCK:
            rollout_kernel.rollout_parallel(*arguments)
    else:
        rollout_kernel.rollout_serial(*arguments)
    _check_motion(out, counts, forces, start, paired=paired)
    return out


def _wrenches(wrench: ArrayLike) -> Array:
    forces = plain(wrench)
    if forces.ndim != 3 or forces.shape[2] != 3:
        raise ModelError(f"rollout: expected wrench of shape (windows, steps, 3), got {forces.shape}")
    return forces


def _bodies(count: int, inertia_per_mass: ArrayLike, com: ArrayLike) -> tuple[Array, Array]:
    """Return inertia over mass (count,) and centre of mass (count, 2) of every row."""
    inertia = _per_row("inertia_per_mass", inertia_per_mass, (count,))
    if count and not inertia.min() > 0.0:
        raise ModelError(f"rollout: expected inertia_per_mass above zero [m^2], got {inertia.min():g}")
    return inertia, _per_row("com", com, (count, 2))


def _parameter_rows(parameters: ArrayLike) -> Array:
    rows = plain(parameters)
    if rows.ndim != 2 or rows.shape[1] != len(KERNEL_COLUMNS):
        raise ModelError(f"rollout: expected parameters of shape (n, {len(KERNEL_COLUMNS)}), got {rows.shape}")
    legal = (np.isfinite(rows) | (np.isnan(rows) & _MAY_BE_NAN)).all(axis=1)
    legal &= (rows[:, kernel.MASS] > 0.0) & ~(rows[:, _NOT_NEGATIVE] < 0.0).any(axis=1)
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
    return plain(start)


def _step_counts(steps: ArrayLike | None, windows: int, longest: int) -> NDArray[np.int64]:
    counts = np.full(windows, longest) if steps is None else np.asarray(steps)
    if counts.shape != (windows,) or counts.dtype.kind not in "iu":
        raise ModelError(
            f"rollout: expected steps as {windows} whole numbers, got {counts.dtype} of shape {counts.shape}"
        )
    if windows and (counts.min() < 0 or counts.max() > longest):
        raise ModelError(f"rollout: expected steps in 0..{longest}, got {counts.min()}..{counts.max()}")
    return np.ascontiguousarray(counts, dtype=np.int64)


def _check_motion(out: Array, counts: NDArray[np.int64], forces: Array, start: Array, *, paired: bool) -> None:
    """Raise for a motion that is not finite: what is wrong shows at the end of a window, for NaN never leaves."""
    last = out[np.arange(len(out)), 0, counts][:, None] if paired else out[:, np.arange(counts.size), counts]
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
    where = row if paired else window
    raise ModelError(f"rollout: the motion of parameter row {row} in window {where} is not finite; dt may be too long")


def _vector(name: str, value: ArrayLike, length: int) -> Array:
    vector = np.ascontiguousarray(value, dtype=float)
    if vector.shape != (length,) or not np.isfinite(vector).all():
        raise ModelError(f"rollout: expected {name} as {length} finite numbers, got {vector.tolist()}")
    return vector


def _per_row(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a value of each row, repeated where one is given for all."""
    array = np.asarray(value, dtype=float)
    if array.shape not in (shape, shape[1:]) or not np.isfinite(array).all():
        raise ModelError(
            f"rollout: expected {name} as finite numbers of shape {shape[1:]} or {shape}, got {array.tolist()}"
        )
    rows = np.empty(shape)
    rows[...] = array
    return rows


def _positive(name: str, value: float, unit: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise ModelError(f"rollout: expected {name} above zero [{unit}], got {value!r}")
