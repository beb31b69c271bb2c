"""What simulates a body in the likelihood: the compiled kernel, or the physics engine of the thesis's kind.

Both answer the same question, poses at the recorded times for each (parameter row, window) with its own start and
left-out wrench, and mean the same physics; the kernel is far faster.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from pbrl_model.engines.contact_world import CONTACT_COLUMNS, contact_scene, rollout_contact
from pbrl_model.engines.window_kernel import simulate_parallel, simulate_serial
from pbrl_model.geometry import MassProperties
from pbrl_model.rollout import KERNEL_LOCK, com_to_origin
from pbrl_model.sensing.windows import Windows

Array = NDArray[np.float64]

EngineName = Literal["kernel", "pymunk"]

SERIAL_STEPS = 150_000
"""Below this many body steps in all, waking the other cores costs more than it saves."""


class Engine(Protocol):
    """A simulation of one body over windows."""

    def poses(self, rows: Array, initial: Array, offset: Array, late: Array) -> Array:
        """Simulate every row over every window.

        Args:
            rows: (P, 12) of `KERNEL_COLUMNS`.
            initial: (P, W, 6) states of the centre of mass.
            offset: (P, W, 3) left-out wrench in the body's axes [N, N, N], the torque over the body's lever.
            late: (P,) by how much poses come after wrenches, beyond the windows' own delay [s].

        Returns:
            (P, W, N, 3) poses of the body's frame at the recorded times.
        """
        ...


MakeEngine = Callable[[MassProperties, Windows], Engine]


def lever(body: MassProperties) -> float:
    """Return what turns a force scale into a torque scale: the radius of gyration [m]."""
    return float(np.sqrt(body.inertia_per_mass))


class KernelEngine:
    """The compiled kernel, on all cores where that pays.

    Attributes:
        forcing: (W, T, 8), see `window_kernel`.
        place: (W, N) where each pose lies, in steps.
        constants: (5,), see `window_kernel`.
    """

    def __init__(self, body: MassProperties, windows: Windows) -> None:
        self.forcing = np.concatenate(
            [windows.wrench, windows.rate, np.cos(windows.heading)[..., None], np.sin(windows.heading)[..., None]], -1
        )
        self.place = windows.step + windows.fraction
        self.constants = np.array([body.inertia_per_mass, *body.com, windows.dt, lever(body)])
        self._steps = windows.steps

    def poses(self, rows: Array, initial: Array, offset: Array, late: Array) -> Array:
        """Simulate every row over every window, see `Engine`."""
        out = np.empty((len(rows), *self.place.shape, 3))
        arguments = (
            np.ascontiguousarray(rows),
            initial,
            np.ascontiguousarray(offset),
            late,
            self.forcing,
            self._steps,
            self.place,
            self.constants,
            out,
        )
        if len(rows) > 1 and len(rows) * int(self._steps.sum()) > SERIAL_STEPS:
            with KERNEL_LOCK:
                simulate_parallel(*arguments)
        else:
            simulate_serial(*arguments)
        return out


class PymunkEngine:
    """Chipmunk, the engine of the pymunk world: every row and window is a world of its own (`rollout_contact`).

    Args:
        body: centre of mass and inertia over mass.
        windows: what was recorded.
        footprint: (k, 2) [m].
    """

    def __init__(self, body: MassProperties, windows: Windows, footprint: Array) -> None:
        self._body, self._windows = body, windows
        self._scene = contact_scene([footprint], properties=[body])

    def poses(self, rows: Array, initial: Array, offset: Array, late: Array) -> Array:
        """Simulate every row over every window, see `Engine`."""
        w = self._windows
        count, windows, steps = len(rows), len(w), w.wrench.shape[1]
        parameters = np.zeros((count * windows, 1, len(CONTACT_COLUMNS)))
        parameters[:, 0, : rows.shape[1]] = np.repeat(rows, windows, axis=0)
        c, s = np.cos(w.heading), np.sin(w.heading)
        x, y, turn = (offset[..., k, None] for k in range(3))
        left_out = np.stack(
            [c * x - s * y, s * x + c * y, np.broadcast_to(turn * lever(self._body), x.shape[:2] + c.shape[1:])], -1
        )
        wrench = (w.wrench - late[:, None, None, None] * w.rate + left_out).reshape(-1, steps, 1, 3)
        states = rollout_contact(self._scene, parameters, initial.reshape(-1, 1, 6), wrench, w.dt)
        path = com_to_origin(states[:, :, 0, :3], self._body.com).reshape(count, windows, steps + 1, 3)
        which = np.arange(windows)[:, None]
        before, after = path[:, which, w.step], path[:, which, w.step + 1]
        return before + w.fraction[..., None] * (after - before)
