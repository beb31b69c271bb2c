"""Small lattices, and a slow planner to hold the fast one against: every edge looked at by itself, then Dijkstra."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from pbrl_planner.lattice import ArticulatedBody, CostGrid, GeneratorSettings, Lattice, Motions, Pace, generate
from pbrl_planner.lattice.body import rectangle
from pbrl_planner.lattice.primitives import centre_cells

CELL = 0.1
PAD = 30
SMALL = ArticulatedBody(rectangle(-0.16, 0.16, 0.16), rectangle(0.0, 0.4, 0.13), (0.22, 0.0))


@cache
def point_motions(headings: int = 8, stride: int = 3) -> Motions:
    chosen = GeneratorSettings(resolution=CELL, headings=headings, articulations=1, stride=stride)
    return Motions(generate(chosen), Pace())


@cache
def cart_motions(articulations: int = 3) -> Motions:
    chosen = GeneratorSettings(resolution=CELL, headings=8, articulations=articulations, stride=2)
    return Motions(generate(chosen), Pace(), SMALL)


def random_grid(rng: np.random.Generator, rows: int, columns: int, share: float) -> CostGrid:
    cells = rng.integers(0, 8, (rows, columns)).astype(np.uint8)
    cells[rng.random((rows, columns)) < share] = 254
    return CostGrid(cells, CELL, (-1.0, 2.0))


@dataclass(frozen=True)
class Reference:
    """All edges of a lattice (e, 4): source, target, cost, primitive; each looked at in full."""

    lattice: Lattice
    edges: np.ndarray

    @classmethod
    def of(cls, lattice: Lattice) -> Reference:
        primitives, grid, body = lattice.primitives, lattice.grid, lattice.body
        rows, columns = grid.cells.shape
        padded = np.pad(grid.cells, PAD, constant_values=255)
        y, x = np.mgrid[:rows, :columns]
        edges = []
        for number, each in enumerate(primitives.primitives):
            dx, dy, heading, phi = each.end
            dear = {(0, 0), (dx, dy), *centre_cells(each, CELL)}
            free = np.ones((rows, columns), dtype=bool)
            if body is not None:
                mask = body.mask(each.poses, CELL)
                for cy, cx in np.argwhere(mask) - len(mask) // 2:
                    free &= shifted(padded, cx, cy, grid) < grid.lethal
                assert body.cart_middle is not None
                middles = body.in_world(body.cart_middle[None], each.poses, "cart")[:, 0]
                dear |= {(int(a), int(b)) for a, b in np.floor(middles / CELL + 0.5)}
            dearest = np.max([shifted(padded, *cell, grid) for cell in dear], axis=0).astype(int)
            free &= dearest < grid.blocked
            source = lattice.number_of((0, 0, *each.start)) + (y * lattice.stride + x) * primitives.bins
            target = lattice.number_of((dx, dy, heading, phi)) + (y * lattice.stride + x) * primitives.bins
            cost = lattice.motions.costs[number] * (1 + dearest)
            edges.append(np.stack((source, target, cost, np.full_like(cost, number)), axis=-1)[free])
        return cls(lattice, np.concatenate(edges))

    def costs_from(self, state: int, *, backward: bool = False) -> np.ndarray:
        """Return the least cost from a state to each, or from each to it."""
        size = self.lattice.cells * self.lattice.primitives.bins
        ends = self.edges[:, [1, 0] if backward else [0, 1]]
        # Of parallel edges the cheapest; a sparse array would add them up.
        order = np.lexsort((self.edges[:, 2], ends[:, 1], ends[:, 0]))
        first = np.unique(ends[order], axis=0, return_index=True)[1]
        chosen = order[first]
        graph = csr_array((self.edges[chosen, 2].astype(float), ends[chosen].T), shape=(size, size))
        return np.asarray(dijkstra(graph, indices=state))


def shifted(padded: np.ndarray, x: int, y: int, grid: CostGrid) -> np.ndarray:
    rows, columns = grid.cells.shape
    return padded[PAD + y : PAD + y + rows, PAD + x : PAD + x + columns]


def free_state(lattice: Lattice, rng: np.random.Generator) -> tuple[int, int, int, int]:
    rows, columns = lattice.grid.cells.shape
    sizes = (columns, rows, lattice.primitives.headings, len(lattice.primitives.articulations))
    while True:
        x, y, heading, phi = (int(value) for value in rng.integers(sizes))
        if not lattice.fault((x, y, heading, phi)):
            return x, y, heading, phi
