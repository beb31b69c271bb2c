"""Desks without legs: drives through an office whose desks are fixed to the walls, with the tilting laser and without.

The level laser looks underneath. Everything else is as in `cart-office`, but for people: there are none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from pbrl_bringup.benches.rows import Measured, at_least, at_most
from pbrl_bringup.cart.outcome import CartOutcome
from pbrl_bringup.experiments.cart_office import TILT, driven, leg_of, summary
from pbrl_bringup.experiments.cart_office_figure import draw
from pr2_cart_sim.scene import load_office

LEGS, QUICK = 8, 1
LONGEST = 300.0
"""Of a leg [s]."""
OFFICE = {"people": 0, "hung": 1.0, "furniture": (3, 5)}
BLIND = {"rate": 0.1, "half_angle": 0.01, "increment": 0.01, "range_max": 0.2}
"""A tilting laser that sees nothing."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Drive each leg twice, and draw those with the tilting laser, into `out`.

    Args:
        seed: of office, goals, sensors.
        quick: one leg.
        out: folder of offices, kept legs and figure.
    """
    legs = [leg_of(seed, number, out, OFFICE) for number in range(QUICK if quick else LEGS)]
    sees = driven(legs, seed, LONGEST, out / "tilting", TILT)
    blind = driven(legs, seed, LONGEST, out / "level", BLIND)
    draw(load_office(legs[0].office), sees, out)
    things = [each.score.nearest_thing for each in sees if each.score.nearest_thing is not None]
    rows = [
        at_least("goals reached with the tilting laser, share", _reached(sees), "1", 1.0, without=_reached(blind)),
        at_most("contacts with the tilting laser", _touches(sees), "1", 0, without=float(_touches(blind))),
        at_least("least distance of robot or cart to anything", min(things, default=math.nan), "m", 0.0),
    ]
    told = {
        name: [summary(leg, each) for leg, each in zip(legs, found, strict=True)]
        for name, found in (("tilting", sees), ("level", blind))
    }
    return Measured(rows, told)


def _reached(found: Sequence[CartOutcome]) -> float:
    return sum(each.reached for each in found) / len(found)


def _touches(found: Sequence[CartOutcome]) -> int:
    return sum(len(each.score.contacts) for each in found)
