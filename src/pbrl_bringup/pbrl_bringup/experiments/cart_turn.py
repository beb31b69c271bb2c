"""Figure 18: what robot and cart sweep in a turn by 90 degrees, with articulated primitives and without them.

The quickest plan is not the one that sweeps least. So both are trimmed alike: pieces are taken off the floor where the
plan sweeps, one after the other, as long as there is still a plan, and the least that was ever swept counts.
Where there is room, an articulated cart saves little. It saves most where a cart held straight has to go into a room
backwards and turn round inside. So every scene is a row of its own, those where it helps little among them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import binary_erosion

from pbrl_bringup.benches.rows import Measured, Row, at_least
from pbrl_bringup.experiments.cart_passages import (
    BENT,
    CELL,
    STRAIGHT,
    WIDE,
    Passage,
    cells_of,
    corner,
    into_door,
    open_floor,
    out_of_door,
    solve,
    thesis_motions,
)
from pbrl_bringup.experiments.cart_plan_drawing import Drawn
from pbrl_bringup.experiments.cart_turn_figure import draw
from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import (
    ArticulatedBody,
    CostGrid,
    Lattice,
    LatticePlan,
    LatticeProblem,
    LatticeSettings,
    Motions,
    plan,
)

SAVED = 0.25
TRIES, QUICK_TRIES = 120, 12
DISCS = (2, 4, 6, 10, 16)
"""Radii of pieces that are taken off the floor [cells]."""
SLACK = 0.01
"""[m^2] by which a trimmed plan may sweep more than the one before: a way round where each smaller one is barred."""
SHORT = LatticeSettings(time_limit=600.0, direction="forward", expansions=300_000)
"""Patience with each trimmed floor."""
FINE = 0.01
"""[m] that a corner moves between two outlines at most."""


@dataclass(frozen=True)
class Turn:
    """A turn in a scene.

    Attributes:
        poses: (n, 4) of the plan that sweeps least.
        area: that it sweeps [m^2].
        quickest: area of the quickest plan [m^2].
    """

    poses: Array
    area: float
    quickest: float


def scenes(quick: bool) -> dict[str, Passage]:
    """Return the scenes by name; in each there is a plan without articulation, too. Quick: those that are drawn.

    The doorways are the narrowest which the cart held straight still gets through from that corridor.
    """
    found = {
        "into a room, corridor 1.8 m": into_door(cells_of(0.75), cells_of(1.8), WIDE),
        "corner, corridors 1.25 m": corner(cells_of(1.25)),
        "open floor": open_floor(1.0),
    }
    more = {
        "into a room, corridor 1.6 m": into_door(cells_of(0.85), cells_of(1.6), WIDE),
        "into a room, corridor 1.9 m": into_door(cells_of(0.70), cells_of(1.9), WIDE),
        "into a room, corridor 2.2 m": into_door(cells_of(0.70), cells_of(2.2), WIDE),
        "into a closet, corridor 1.4 m": into_door(cells_of(1.25), cells_of(1.4)),
        "into a closet, corridor 1.6 m": into_door(cells_of(1.025), cells_of(1.6)),
        "out of a closet, corridor 1.4 m": out_of_door(cells_of(1.0), cells_of(1.4)),
    }
    return found if quick else found | more


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Measure the area that is swept in each scene, and draw some of them into `out`.

    Args:
        seed: of what is trimmed off.
        quick: three scenes, and less trimming.
        out: folder of the figure.
    """
    sets, tries = thesis_motions(), QUICK_TRIES if quick else TRIES
    made = {
        name: {
            kind: trimmed(passage, motions, np.random.default_rng([seed, number]), tries)
            for kind, motions in sets.items()
        }
        for number, (name, passage) in enumerate(scenes(quick).items())
    }
    walls = scenes(True)
    shown = {name: [Drawn(kind, walls[name], t.poses, t.area) for kind, t in made[name].items()] for name in walls}
    draw(shown, {name: saved(turns) for name, turns in made.items()}, SAVED, out)
    areas = {
        name: {kind: {"least": t.area, "quickest": t.quickest} for kind, t in turns.items()}
        for name, turns in made.items()
    }
    return Measured([row_of(name, turns) for name, turns in made.items()], {"swept": areas})


def row_of(name: str, turns: dict[str, Turn]) -> Row:
    """Return the row of a scene."""
    return at_least(
        f"turn by 90 degrees, {name}: swept area saved by articulation",
        saved(turns),
        "1",
        SAVED,
        swept=turns[BENT].area,
        swept_straight=turns[STRAIGHT].area,
        saved_by_quickest_plans=1.0 - turns[BENT].quickest / turns[STRAIGHT].quickest,
    )


def saved(turns: dict[str, Turn]) -> float:
    """Return the share of the swept area that articulation saves."""
    return 1.0 - turns[BENT].area / turns[STRAIGHT].area


def trimmed(passage: Passage, motions: Motions, rng: np.random.Generator, tries: int) -> Turn:
    """Return the turn that sweeps the least, as far as trimming finds it.

    Args:
        passage: in which there is a plan.
        motions: of robot and cart.
        rng: draws what is taken off.
        tries: pieces that are tried.
    """
    body, quickest = motions.body, solve(passage, motions)
    assert body is not None and quickest is not None and quickest.found, "in each scene there is a plan"
    free, best = ~passage.occupied, quickest.poses
    area = least = first = swept_area(body, best)
    covered = cells_swept(passage, body, best)
    rows, columns = np.indices(free.shape)
    for _ in range(tries):
        edge = np.argwhere(covered & ~binary_erosion(covered))
        row, column = edge[rng.integers(len(edge))]
        radius = DISCS[int(rng.integers(len(DISCS)))]
        left = free & ((rows - row) ** 2 + (columns - column) ** 2 > radius**2)
        found = _plan_on(left, passage, motions)
        if found is None or (new := swept_area(body, found.poses)) > area + SLACK:
            continue
        free, area, covered = left, new, cells_swept(passage, body, found.poses)
        if area < least:
            least, best = area, found.poses
    return Turn(best, least, first)


def _plan_on(free: np.ndarray, passage: Passage, motions: Motions) -> LatticePlan | None:
    """Return a plan on what is left of a passage's floor; None: none was found soon."""
    grid = CostGrid.of_occupied(~free, CELL, passage.origin)
    try:
        problem = LatticeProblem(Lattice(grid, motions), passage.start, passage.goal)
    except PlannerError:
        return None  # what was taken off is where it starts or ends
    found = plan(problem, SHORT)
    return found if found.found else None


def swept_area(body: ArticulatedBody, poses: Array) -> float:
    """Return the area swept along poses (n, 4) [m^2]."""
    return body.area(body.between(poses, FINE))


def cells_swept(passage: Passage, body: ArticulatedBody, poses: Array) -> np.ndarray:
    """Return which of a passage's cells (rows, columns) are touched along poses (n, 4)."""
    rows, columns = passage.occupied.shape
    middle = np.array([columns // 2, rows // 2])
    moved = poses - [*(np.array(passage.origin) + (middle + 0.5) * CELL), 0.0, 0.0]
    mask = body.mask(moved, CELL)
    found = np.zeros((rows, columns), dtype=bool)
    y, x = np.nonzero(mask)
    y, x = y - len(mask) // 2 + middle[1], x - len(mask) // 2 + middle[0]
    on = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    found[y[on], x[on]] = True
    return found
