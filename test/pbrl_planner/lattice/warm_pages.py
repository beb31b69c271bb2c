"""Run by a test, alone in its process: pages that a search's arrays still lack, after warming up and without."""

from __future__ import annotations

import ctypes
import resource

import numpy as np
from lattice_cases import CELL, cart_motions

from pbrl_planner.lattice import CostGrid, Lattice, LatticeSettings, Motions, warm_up
from pbrl_planner.lattice.shelf import Shelf

MMAP_THRESHOLD = -3
"""Number of that setting of glibc's allocator, see `malloc.h`: without it, what was freed is given out again."""


def missing(grid: CostGrid, motions: Motions) -> int:
    """Return how many pages the system brings when a search's arrays are read."""
    lattice = Lattice(grid, motions)
    arrays = [motions.shelf.take_records(lattice.cells * lattice.primitives.bins).array]
    for sweeps in (lattice.sweeps("forward"), lattice.sweeps("backward")):
        arrays += [each.ravel() for each in (sweeps.free, sweeps.known, sweeps.stays_free, sweeps.stays_known)]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for array in arrays:
        array.max()
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


if __name__ == "__main__":
    ctypes.CDLL(None).mallopt(MMAP_THRESHOLD, 1 << 16)
    floor, robot = CostGrid(np.zeros((300, 300), dtype=np.uint8), CELL), cart_motions()
    robot.shelf = Shelf()
    cold = missing(floor, robot)
    robot.shelf = Shelf()
    warm_up(robot, floor, LatticeSettings(time_limit=600.0, thinned=4))
    print(missing(floor, robot), cold)
