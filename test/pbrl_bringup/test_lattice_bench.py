"""The bench of the lattice planner: its offices are offices, and only the articulated cart gets through their doors."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_bringup.benches.lattice import NARROW, ORDINARY, ORDINARY_DOOR, Run, first_plan_row, motion_sets, solve
from pbrl_bringup.benches.lattice_offices import CELL, DOOR, random_office, turn_into_door
from pbrl_bringup.commands.bench import BENCHES
from pbrl_planner.lattice import LatticePlan
from pbrl_planner.lattice.body import CART_WIDTH


def test_doors_are_as_narrow_as_it_says() -> None:
    assert DOOR * CELL <= CART_WIDTH + 0.10 + 1e-9
    assert "lattice" in BENCHES
    for door in (DOOR, ORDINARY_DOOR):
        office = random_office(NARROW, np.random.default_rng(1), door)
        occupied = office.grid.cells >= office.grid.lethal
        row = round(3.6 / CELL) - 2
        runs = np.diff(np.flatnonzero(np.diff(occupied[row].astype(int))))[::2]
        assert runs.tolist() == [door] * 3


def test_the_same_seed_is_the_same_office() -> None:
    first, again = (random_office(ORDINARY, np.random.default_rng([3, 1]), ORDINARY_DOOR) for _ in range(2))
    other = random_office(ORDINARY, np.random.default_rng([3, 2]), ORDINARY_DOOR)
    assert first.grid.cells.tobytes() == again.grid.cells.tobytes() and first.goal == again.goal
    assert first.grid.cells.tobytes() != other.grid.cells.tobytes()


def test_only_the_articulated_cart_gets_from_a_narrow_corridor_through_a_narrow_door() -> None:
    office = turn_into_door(NARROW)
    found = {name: solve(office, motions).plan for name, motions in motion_sets().items()}
    assert found["articulated"].found and found["articulated"].epsilon == 1.0
    assert not found["straight"].found and found["straight"].exhausted
    assert np.ptp(found["articulated"].poses[:, 3]) > 0.3


def test_a_row_counts_what_was_found() -> None:
    empty = np.zeros((0, 4))
    none = LatticePlan(empty, np.zeros(0, int), empty, -1, np.inf, 5, 5, 1.0, np.inf, 0.1, (), True, "there is no way")
    row = first_plan_row("what", [Run(none, 0.1, np.inf, 1.0)], 0.05)
    assert not row.holds and np.isnan(row.value) and (row.against["plans"], row.against["asked"]) == (0.0, 1.0)
    assert pytest.approx(1.23) == row.against["thesis"]
