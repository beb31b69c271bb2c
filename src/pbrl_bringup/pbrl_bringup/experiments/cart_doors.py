"""Section 4.5.6: doors and corners that a robot with a cart gets through, with articulated primitives and without them.

The least width with which there is still a plan is bisected, in cells of the lattice; that a narrower one is too narrow
is proved by searching everything that can be reached. Straight ahead both get through any door that is wider than the
robot; what articulation is good for is the turn before the door, or behind it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.cart_doors_figure import draw
from pbrl_bringup.experiments.cart_passages import (
    BENT,
    CELL,
    STRAIGHT,
    Least,
    Passage,
    cells_of,
    corner,
    drive_motions,
    into_door,
    least_width,
    out_of_door,
    thesis_motions,
)
from pbrl_planner.lattice import Motions
from pbrl_planner.lattice.body import CART_WIDTH, PR2_HALF

BEYOND = 0.10
"""[m] that the doorway is wider than the cart."""
DOOR = cells_of(CART_WIDTH + BEYOND)
NARROWEST = cells_of(2.0 * PR2_HALF)
"""[cells] narrower than the robot; nothing gets through."""
WIDEST = cells_of(1.6)
CORRIDORS = (1.4, 1.6, 1.8, 2.0, 2.2)
"""[m] off which the doorways are."""
OUT = (1.2, 1.4, 1.6)
"""[m] of corridors behind the doorways."""
CORNERS = cells_of(0.9), cells_of(1.6)
FROM, TO = cells_of(1.2), cells_of(2.6)
"""Corridors off which a doorway of the size wanted is tried [cells]."""
OFFICE = 1.9
"""[m] an office's corridor."""

Pair = dict[str, Least]


@dataclass(frozen=True)
class Scene:
    """What is made narrower: a passage of a width [cells], from one to another."""

    what: str
    passage: Callable[[int], Passage]
    low: int
    high: int


def scenes(quick: bool) -> list[Scene]:
    """Return what is measured with the thesis' outlines."""
    found = [
        Scene("corner", corner, *CORNERS),
        Scene(f"corridor before a doorway of {DOOR * CELL:.2f} m", partial(into_door, DOOR), FROM, TO),
    ]
    corridors, out = (CORRIDORS[1:2], OUT[1:2]) if quick else (CORRIDORS, OUT)
    found += [_doorway("doorway off a corridor", into_door, width) for width in corridors]
    return found + [_doorway("doorway out into a corridor", out_of_door, width) for width in out]


def _doorway(what: str, make: Callable[[int, int], Passage], corridor: float) -> Scene:
    cells = cells_of(corridor)
    return Scene(f"{what} of {corridor:.1f} m", lambda door: make(door, cells), NARROWEST, WIDEST)


def office_scenes() -> list[Scene]:
    """Return what is measured with the outlines of the simulator's drive: wider, with elbows and a margin."""
    widest = cells_of(2.2)
    return [
        Scene("corner", corner, cells_of(1.1), widest),
        Scene(
            f"doorway off a corridor of {OFFICE:.1f} m",
            lambda door: into_door(door, cells_of(OFFICE)),
            NARROWEST,
            widest,
        ),
    ]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Measure the least widths, and draw them and one doorway into `out`.

    Args:
        seed: nothing is drawn by chance.
        quick: fewer corridors, and not with the outlines of the drive.
        out: folder of the figure.
    """
    thesis = {each.what: pair_of(each, thesis_motions()) for each in scenes(quick)}
    drive = {} if quick else {each.what: pair_of(each, drive_motions()) for each in office_scenes()}
    before = thesis[f"corridor before a doorway of {DOOR * CELL:.2f} m"]
    rows = [passed_row(before), *[narrower_row(what, pair) for what, pair in thesis.items()]]
    rows += [narrower_row(f"{what}, with elbows and margins", pair) for what, pair in drive.items()]
    every = [least for pair in (*thesis.values(), *drive.values()) for least in pair.values()]
    rows.append(
        at_least(
            "widths that were too narrow, proved by exhaustion, share", _share([e.proved for e in every]), "1", 1.0
        )
    )
    draw(
        before[BENT],
        partial(into_door, DOOR),
        {**thesis, **{f"{what},\nwith elbows and margins": pair for what, pair in drive.items()}},
        out,
    )
    return Measured(rows, {"thesis": told(thesis), "drive": told(drive)})


def pair_of(scene: Scene, sets: dict[str, Motions]) -> Pair:
    """Return the least widths with articulation and without."""
    return {kind: least_width(scene.passage, motions, scene.low, scene.high) for kind, motions in sets.items()}


def passed_row(before: Pair) -> Row:
    """Return the row of the doorway that is passed with articulation alone.

    Args:
        before: least corridors before it. Between the two articulation alone gets through.
    """
    bent, straight = before[BENT], before[STRAIGHT]
    alone = bent.cells is not None and straight.refused is not None and straight.refused >= bent.cells
    return at_most(
        f"doorway passed with articulation, out of corridors where there is proof that it cannot be without: its width "
        f"beyond the cart's of {CART_WIDTH:g} m",
        round(DOOR * CELL - CART_WIDTH, 6) if alone and straight.proved else float("nan"),
        "m",
        BEYOND,
        narrowest_corridor=bent.width,
        narrowest_corridor_straight=straight.width,
        robot=2.0 * PR2_HALF,
    )


def narrower_row(what: str, pair: Pair) -> Row:
    """Return the row of a least width, which is to be less with articulation than without."""
    straight = pair[STRAIGHT].width
    return at_most(f"least {what}", pair[BENT].width, "m", straight, straight=straight, cart=CART_WIDTH)


def told(pairs: dict[str, Pair]) -> dict[str, Any]:
    """Return what there is to say of least widths."""
    return {
        what: {
            kind: {"width": least.width, "proved": least.proved, "cost": -1 if least.plan is None else least.plan.cost}
            for kind, least in pair.items()
        }
        for what, pair in pairs.items()
    }


def _share(values: list[bool]) -> float:
    return sum(values) / len(values)
