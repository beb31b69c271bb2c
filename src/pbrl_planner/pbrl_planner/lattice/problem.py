"""What is asked: from one pose to another on a lattice."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.lattice import Lattice, State
from pbrl_planner.lattice.primitives import TURN


@dataclass(frozen=True)
class LatticeProblem:
    """A start and a goal; each is taken to the nearest state.

    Attributes:
        lattice: floor, motions, body.
        start: (x, y, heading, articulation) of the robot in `world` [m, m, rad, rad]; without the last: 0.
        goal: likewise.
        start_state: column, row, heading, articulation.
        goal_state: likewise.

    Raises:
        PlannerError: a pose is off the map, out of the articulations' range, or in something: who is in what, where.
    """

    lattice: Lattice
    start: Array | Sequence[float]
    goal: Array | Sequence[float]
    start_state: State = field(init=False)
    goal_state: State = field(init=False)

    def __post_init__(self) -> None:
        for name in ("start", "goal"):
            pose = np.array(getattr(self, name), dtype=float)
            if pose.shape not in ((3,), (4,)) or not np.isfinite(pose).all():
                raise PlannerError(f"{name}: expected a finite pose (x, y, heading[, articulation]), got {pose}")
            pose = np.append(pose, 0.0)[:4]
            state = nearest_state(self.lattice, pose, name)
            fault = self.lattice.fault(state)
            if fault:
                raise PlannerError(f"{name}: expected it free, but at ({pose[0]:g}, {pose[1]:g}) {fault}")
            object.__setattr__(self, name, pose)
            object.__setattr__(self, f"{name}_state", state)


def nearest_state(lattice: Lattice, pose: Array, name: str) -> State:
    """Return the state nearest to a pose (4,), which may be off the map.

    Raises:
        PlannerError: the articulation is out of range by more than half the way to the next.
    """
    headings, articulations = lattice.primitives.headings, np.array(lattice.primitives.articulations)
    column, row = lattice.grid.cell_of(float(pose[0]), float(pose[1]))
    # Halves go up, as in SBPL.
    heading = math.floor(float(pose[2]) / (TURN / headings) + 0.5) % headings
    phi = int(np.argmin(np.abs(articulations - pose[3])))
    slack = float(np.diff(articulations).max()) / 2.0 if len(articulations) > 1 else 0.05
    if abs(float(articulations[phi] - pose[3])) > slack + 1e-9:
        raise PlannerError(
            f"{name}: expected an articulation from {articulations[0]:g} to {articulations[-1]:g} rad, got {pose[3]:g}"
        )
    return column, row, heading, phi
