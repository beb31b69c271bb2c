"""The held object as the search sees it: a state and a control in, the next state out, or that it cannot be."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array, rotation
from pbrl_model.rollout import com_to_origin, origin_to_com, rollout_states
from pbrl_planner.errors import PlannerError
from pbrl_planner.kinodynamic.kernel import advance
from pbrl_planner.kinodynamic.plan import Cost
from pbrl_planner.kinodynamic.problem import PushProblem
from pbrl_planner.kinodynamic.settings import KinodynamicSettings

STUCK = 1e-6  # [m] that a push has to move the object by, against no push, to count


class PushDynamics:
    """Steps one problem through the compiled world model; for one thread at a time, since its buffers are its own.

    States are (x, y, theta, vx, vy, omega) of the centre of mass in `world`, theta in [-pi, pi); controls are wrenches
    (3,) at the held point in the object's axes.

    Args:
        problem: object, grasp, floor.
        settings: steps and limits of speed.

    Attributes:
        start: (6,) state at the start.
        axes: (a,) components of the wrench that the robot can exert.
        limits: (a,) of those [N, N, N m].
        exerted: (3, a) wrench about the centre of mass, object axes, for one unit of each of those.
        inertia: (3,) mass, mass [kg] and moment of inertia [kg m^2].
        gyration: radius [m] at which a turn counts as a way.
        propagations: control steps simulated so far.

    Raises:
        PlannerError: the object is faster at the start than it may be.
    """

    def __init__(self, problem: PushProblem, settings: KinodynamicSettings) -> None:
        self.problem, self.settings = problem, settings
        model = problem.model
        pose = origin_to_com(problem.start, model.com)
        pose[2] = wrapped(pose[2])
        self.start = np.concatenate((pose, problem.twist))
        self.axes = np.flatnonzero(problem.limits.array)
        self.limits = problem.limits.array[self.axes]
        self.gyration = math.sqrt(model.inertia_per_mass)
        self.inertia = model.mass * np.array([1.0, 1.0, model.inertia_per_mass])
        self.propagations = 0
        self._lever = problem.contact - model.com
        to_com = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-self._lever[1], self._lever[0], 1.0]])
        self.exerted = to_com[:, self.axes]
        self._outlines = problem.outlines
        corners = self._outlines.corners
        self._states, self._box = np.empty((settings.substeps + 1, 6)), np.empty(4)
        self._placed = np.empty((settings.substeps, len(corners), 2))
        self._rooms = (np.empty((settings.substeps, 3)), self._states, self._placed, self._box)
        self._body = (
            model.parameters.to_vector(),
            float(model.inertia_per_mass),
            np.array(model.com, dtype=float),
            problem.contact,
            corners,
        )
        self._most = (settings.dt, settings.speed, settings.yaw_rate)
        self._check_speed()

    def step(self, state: Array, wrench: Array) -> Array | None:
        """Return the state (6,) after a wrench (3,) was held for one control step; None where that is not free.

        What is returned is overwritten by the next call.
        """
        self.propagations += 1
        kept = advance(*self._body, state, wrench, *self._most, *self._rooms)
        return self._states[-1] if kept and self._outlines.are_free(self._placed, self._box) else None

    def pose(self, state: Array) -> Array:
        """Return the pose (3,) of the object's frame in a state (6,)."""
        return com_to_origin(state[:3], self.problem.model.com)

    def trace(self, wrenches: Array, counts: NDArray[np.int64]) -> Array:
        """Return the states (m, 6) at every step of the world model while wrenches are held in turn from the start.

        Args:
            wrenches: (n, 3) in order.
            counts: (n,) control steps that each is held.

        Raises:
            PlannerError: the motion is not free, which that of a plan always is.
        """
        states = [self.start[None]]
        for wrench, count in zip(wrenches, counts, strict=True):
            for _ in range(int(count)):
                if self.step(states[-1][-1], wrench) is None:
                    raise PlannerError("replay: expected controls of a plan for this problem, got a motion into things")
                states.append(self._states[1:].copy())
        traced = np.concatenate(states)
        traced[:, 2] = wrapped(traced[:, 2])
        return traced

    def cost(self, wrenches: Array, counts: NDArray[np.int64], states: Array) -> Cost:
        """Return what controls take that lead through the states (m, 6)."""
        spans = counts * self.settings.control_step
        force = float(np.hypot(wrenches[:, 0], wrenches[:, 1]) @ spans)
        held = np.repeat(wrenches, counts * self.settings.substeps, axis=0)
        c, s = np.cos(states[1:, 2]), np.sin(states[1:, 2])
        vx, vy, omega = 0.5 * (states[1:, 3:] + states[:-1, 3:]).T
        lever_x, lever_y = c * self._lever[0] - s * self._lever[1], s * self._lever[0] + c * self._lever[1]
        fx, fy = c * held[:, 0] - s * held[:, 1], s * held[:, 0] + c * held[:, 1]
        power = fx * (vx - omega * lever_y) + fy * (vy + omega * lever_x) + held[:, 2] * omega
        work = float(np.maximum(power, 0.0).sum() * self.settings.dt)
        return Cost(float(spans.sum()), force, float(np.abs(wrenches[:, 2]) @ spans), work)

    def is_stuck(self) -> bool:
        """Say whether no wrench within the limits moves the object from rest, friction and hinge being what they are.

        The wrenches that friction and hinge can hold make a convex set, so if it holds the corners of the box of
        limits it holds all of the box.
        """
        corners = list(itertools.product((-1.0, 1.0), repeat=len(self.axes)))
        pushes = np.array([*corners, np.zeros(len(self.axes))]) * self.limits @ self.exerted.T
        steps = self.settings.longest * self.settings.substeps
        rest = np.concatenate((self.start[:3], np.zeros(3)))
        model = self.problem.model
        ends = rollout_states(
            model.parameters.to_vector()[None],
            np.tile(rest, (len(pushes), 1)),
            np.repeat(pushes[:, None], steps, axis=1),
            model.inertia_per_mass,
            model.com,
            self.settings.dt,
            parallel=False,
            body_wrench=True,
        )[0, :, -1, :3]
        away = np.abs(ends[:-1] - ends[-1]) * [1.0, 1.0, self.gyration]
        return bool(away.max() < STUCK)

    def _check_speed(self) -> None:
        vx, vy, omega = self.start[3:]
        lever = rotation(float(self.start[2])) @ self._lever
        held = math.hypot(vx - omega * lever[1], vy + omega * lever[0])
        most = self.settings
        if held > most.speed or abs(omega) > most.yaw_rate:
            raise PlannerError(
                f"twist: expected at most {most.speed} m/s where it is held and {most.yaw_rate} rad/s, "
                f"got {held:.3f} m/s and {abs(omega):.3f} rad/s"
            )


def wrapped(angle: Array) -> Array:
    """Return angles in [-pi, pi) [rad], those that are in it to the bit, as the kernel does."""
    return angle - 2.0 * math.pi * np.floor((angle + math.pi) / (2.0 * math.pi))
