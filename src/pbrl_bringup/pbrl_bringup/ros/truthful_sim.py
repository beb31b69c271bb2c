"""Krang's simulator that also writes down what is true, for whoever scores: `python -m ... FILE --ros-args ...`.

The truth goes into a file that outlives the simulator, never to a topic.
"""

# rclpy has no types of its own.
# mypy: disable-error-code="no-untyped-call,attr-defined"

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bullet_sim.ros.running import run_node
from krang_sim.ros.sim_node import SimNode
from krang_sim.session import KrangSession
from pbrl_bringup.kills.truth import ROW

EVERY = 4
"""Physics steps between two rows: 10 ms."""


class Watched:
    """A session that appends a row of `kills.truth` to a file now and then.

    Args:
        session: of the simulator.
        path: of the file.
    """

    def __init__(self, session: KrangSession, path: Path) -> None:
        self._session, self._file, self._steps = session, path.open("ab", buffering=0), 0

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._session.time

    def step(self) -> Sequence[Any]:
        """Advance by one physics step; return what is published now."""
        news = self._session.step()
        self._steps += 1
        if self._steps % EVERY == 0:
            self._file.write(ROW.pack(time.time(), self._session.time, *self._speeds()))
        return news

    def _speeds(self) -> tuple[float, float, float]:
        linear, yaw_rate = self._session.robot.base_twist()
        joints = self._session.robot.joint_state()[1][2:]
        return linear, yaw_rate, float(np.abs(joints).max())

    def close(self) -> None:
        """End it."""
        self._session.close()
        self._file.close()


class TruthfulSim(SimNode):
    """The simulator's node, with that session.

    Args:
        path: of the file.
        stop: when it is set, `run` returns at its next step.
    """

    def __init__(self, path: Path, stop: threading.Event) -> None:
        super().__init__(stop)
        self._session = Watched(self.session, path)


def main() -> None:
    """Run the node; the first argument is the file."""
    path = Path(sys.argv[1])
    run_node("sim_node", partial(TruthfulSim, path))


if __name__ == "__main__":
    main()
