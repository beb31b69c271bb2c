"""Motion primitives of a base that can go anywhere it likes, pushing a cart that turns about the grip (thesis 4.5.2).

Between one pose and the next everything goes on evenly, so that any end on the lattice will do. The set is the same
turned by a right angle, and mirrored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from pbrl_control.planar import Array, rotation
from pbrl_control.settings import Positive, Section
from pbrl_planner.lattice.primitives import TURN, Primitive, PrimitiveSet

POSES = 10  # none of them halfway, where what is mirrored would be in another cell
DIGITS = 6  # of a pose, as in a file
Whole = Annotated[int, Field(ge=1, le=100)]


class GeneratorSettings(Section):
    """Which motions there are, and what they cost beside time: harder ones more (thesis 4.5.3).

    Attributes:
        resolution: of the lattice [m].
        headings: bins of heading.
        articulations: bins of articulation, an odd number; 1: the cart is held straight.
        articulation_limit: largest articulation [rad].
        stride: cells of a long step forward, and of an arc.
        forward, back, diagonal, turn, arc, back_arc, swing: multipliers of time.
    """

    resolution: Positive = 0.025
    headings: Literal[8, 16] = 16
    articulations: Literal[1, 3, 5, 7, 9] = 5
    articulation_limit: Annotated[float, Field(gt=0.0, le=1.3)] = math.pi / 4.0
    stride: Annotated[int, Field(ge=2, le=100)] = 8
    forward: Whole = 1
    back: Whole = 3
    diagonal: Whole = 2
    turn: Whole = 1
    arc: Whole = 1
    back_arc: Whole = 3
    swing: Whole = 1


@dataclass(frozen=True)
class _Kind:
    """A motion relative to a heading: way ahead [cells], bins turned and articulated."""

    name: str
    multiplier: int
    ahead: float
    turned: int = 0
    bent: int = 0
    aside: int = 0


def generate(settings: GeneratorSettings | None = None) -> PrimitiveSet:
    """Return the primitives for every heading and articulation."""
    chosen = settings or GeneratorSettings()
    count = chosen.articulations
    limit = chosen.articulation_limit
    bends = tuple(round(float(phi), DIGITS) for phi in np.linspace(-limit, limit, count)) if count > 1 else (0.0,)
    primitives = [
        _primitive(chosen, bends, heading, phi, kind)
        for heading in range(chosen.headings)
        for phi in range(count)
        for kind in _kinds(chosen)
        if 0 <= phi + kind.bent < count
    ]
    return PrimitiveSet(chosen.resolution, chosen.headings, bends, tuple(primitives))


def _kinds(chosen: GeneratorSettings) -> list[_Kind]:
    far = float(chosen.stride)
    sides = (1, -1)
    kinds = [
        _Kind("forward", chosen.forward, 1.0),
        _Kind("far forward", chosen.forward, far),
        _Kind("back", chosen.back, -1.0),
    ]
    kinds += [_Kind("diagonal", chosen.diagonal, 1.0, aside=side) for side in sides]
    kinds += [_Kind("turn", chosen.turn, 0.0, turned=side) for side in sides]
    kinds += [_Kind("arc", chosen.arc, far, turned=side) for side in sides]
    kinds += [_Kind("back arc", chosen.back_arc, -far, turned=side) for side in sides]
    kinds += [_Kind("swing", chosen.swing, 0.0, bent=side) for side in sides]
    kinds += [_Kind("forward and swing", chosen.forward, far, bent=side) for side in sides]
    kinds += [_Kind("arc and swing", chosen.arc, far, turned=side, bent=bend) for side in sides for bend in sides]
    # The cart keeps its heading while the robot turns behind it.
    kinds += [_Kind("turn and swing", chosen.turn, 0.0, turned=side, bent=-side) for side in sides]
    return kinds


def _primitive(chosen: GeneratorSettings, bends: tuple[float, ...], heading: int, phi: int, kind: _Kind) -> Primitive:
    step = TURN / chosen.headings
    if kind.turned and kind.ahead:
        way = _arc(heading * step, kind.turned * step, kind.ahead)
        end = way[-1]
        cells = np.array([math.copysign(math.floor(abs(value) + 0.5), value) for value in end])
        way = way + np.linspace(0.0, 1.0, POSES)[:, None] * (cells - end)
    else:
        vector = direction(heading + kind.aside * chosen.headings // 8, chosen.headings)
        times = round(kind.ahead) if abs(kind.ahead) <= 1.0 else max(1, round(kind.ahead / math.hypot(*vector)))
        cells = times * np.array(vector, dtype=float)
        way = np.linspace(0.0, 1.0, POSES)[:, None] * cells
    poses = np.zeros((POSES, 4))
    poses[:, :2] = way * chosen.resolution
    poses[:, 2] = np.linspace(heading * step, (heading + kind.turned) * step, POSES)
    poses[:, 3] = np.linspace(bends[phi], bends[phi + kind.bent], POSES)
    end_heading = (heading + kind.turned) % chosen.headings
    ends = (int(cells[0]), int(cells[1]), end_heading, phi + kind.bent)
    # No minus before a zero: files would keep it.
    return Primitive((heading, phi), ends, np.round(poses, DIGITS) + 0.0, kind.multiplier, kind.name)


def direction(heading: int, headings: int) -> tuple[int, int]:
    """Return the shortest step (cells along x, along y) that goes as a heading points, give or take a few degrees."""
    quarter = headings // 4
    turns, rest = divmod(heading % headings, quarter)
    # A quarter's headings in eight or sixteen; others follow by right angles.
    x, y = {2: ((1, 0), (1, 1)), 4: ((1, 0), (2, 1), (1, 1), (1, 2))}[quarter][rest]
    for _ in range(turns):
        x, y = -y, x
    return x, y


def _arc(begin: float, turned: float, length: float) -> Array:
    """Return points (n, 2) along an arc of a length, which may be negative, from the origin."""
    share = np.linspace(0.0, 1.0, POSES)
    radius = length / turned
    points = radius * np.stack((np.sin(share * turned), 1.0 - np.cos(share * turned)), axis=1)
    return points @ rotation(begin).T
