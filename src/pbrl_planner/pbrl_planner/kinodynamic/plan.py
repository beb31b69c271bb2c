"""What comes out: wrenches with how long each is held, the way the object then takes, and what it costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrl_control.planar import Array


@dataclass(frozen=True)
class Cost:
    """What a plan takes: the three quantities that the thesis's reward is made of (equation 41), and their work.

    Attributes:
        time: [s].
        force: the force's magnitude over time [N s].
        torque: the torque's magnitude over time, about the held point [N m s].
        work: done on the object, braking not given back [J].
    """

    time: float
    force: float
    torque: float
    work: float


@dataclass(frozen=True)
class KinodynamicPlan:
    """Controls and the way.

    Attributes:
        wrenches: (n, 3) in the object's axes at the held point, in order [N, N, N m].
        durations: (n,) that each is held [s], whole control steps.
        times: (m,) [s], every step of the world model, 0 first.
        states: (m, 6) of the centre of mass in `world` at those times; yaw in [-pi, pi).
        poses: (m, 3) of the object's frame in `world` at those times; yaw in [-pi, pi).
        cost: of it all.
    """

    wrenches: Array
    durations: Array
    times: Array
    states: Array
    poses: Array
    cost: Cost

    @property
    def duration(self) -> float:
        """Time it takes [s]."""
        return float(self.times[-1])

    @property
    def largest_force(self) -> float:
        """Largest force at the held point [N]; what a monitor compares with."""
        return float(np.hypot(self.wrenches[:, 0], self.wrenches[:, 1]).max(initial=0.0))


@dataclass(frozen=True)
class KinodynamicResult:
    """A plan, or why there is none.

    Attributes:
        plan: None where none was found.
        reason: one line; empty where there is a plan.
        seconds: spent.
        iterations: of the search begun.
        propagations: control steps simulated.
        states: in the tree, the start among them.
    """

    plan: KinodynamicPlan | None
    reason: str
    seconds: float
    iterations: int
    propagations: int
    states: int
