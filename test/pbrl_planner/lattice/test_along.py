"""Primitives that follow one another: what is looked up is what one finds who walks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lattice_cases import cart_motions, point_motions, random_grid

from pbrl_planner.lattice import Lattice
from pbrl_planner.lattice.primitives import TURN


def walked(lattice: Lattice, state: tuple[int, int, int, int], numbers: np.ndarray) -> tuple[int, list, list]:
    cost, between, way = 0, [lattice.pose_of(state)], [lattice.pose_of(state)]
    border = lattice.border
    for number in numbers:
        primitive, move = lattice.primitives.primitives[number], lattice.motions.moves[number]
        column, row = state[:2]
        crossed = {(0, 0), primitive.end[:2], *move.dear}
        dearest = max(int(lattice.cost[row + border + y, column + border + x]) for x, y in crossed)
        cost += move.cost * (1 + dearest)
        way += [pose + np.append(between[-1][:2], [0.0, 0.0]) for pose in primitive.poses[1:-1]]
        state = (column + primitive.end[0], row + primitive.end[1], *primitive.end[2:])
        between.append(lattice.pose_of(state))
        way.append(between[-1])
    return cost, between, way


@pytest.mark.parametrize("kind", ["point", "cart"])
def test_costs_and_poses_are_those_of_a_walk(kind: str, rng: np.random.Generator) -> None:
    motions = point_motions() if kind == "point" else cart_motions()
    lattice = Lattice(random_grid(rng, 30, 40, 0.3), motions)
    by_bin: dict[tuple[int, int], list[int]] = {}
    for number, each in enumerate(lattice.primitives.primitives):
        by_bin.setdefault(each.start, []).append(number)
    for length in (0, 1, 2, 25):
        state = here = (20, 15, 0, len(lattice.primitives.articulations) // 2)
        numbers = []
        for _ in range(length):
            near = [
                number
                for number in by_bin[here[2:]]
                if 0 <= here[0] + lattice.primitives.primitives[number].end[0] < 40
                and 0 <= here[1] + lattice.primitives.primitives[number].end[1] < 30
            ]
            numbers.append(int(rng.choice(near)))
            end = lattice.primitives.primitives[numbers[-1]].end
            here = (here[0] + end[0], here[1] + end[1], *end[2:])
        chosen = np.array(numbers, dtype=np.int64)
        cost, between, way = walked(lattice, state, chosen)
        assert lattice.cost_along(state, chosen) == cost
        found_between, found_way = lattice.poses_along(state, chosen)
        for found, wanted in ((found_between, np.array(between)), (found_way, np.array(way))):
            assert found.shape == wanted.shape
            assert np.abs(found[:, [0, 1, 3]] - wanted[:, [0, 1, 3]]).max() < 1e-12
            assert all(abs(math.remainder(off, TURN)) < 1e-12 for off in found[:, 2] - wanted[:, 2])
            assert np.abs(np.diff(found[:, 2])).max(initial=0.0) <= math.pi, "no jumps"
        assert {tuple(pose) for pose in found_between} <= {tuple(pose) for pose in found_way}, "ends are the same bits"
