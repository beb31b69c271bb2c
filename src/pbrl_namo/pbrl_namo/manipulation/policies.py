"""Object velocities worth trying, by model class (thesis 6.3.2, figure 40).

| class | velocities |
|---|---|
| static | none |
| unconstrained | along x and y, and about the centre of mass, both ways |
| anisotropic | along the axis that rolls, and about the wheel, both ways |
| fixed-point | about the anchor, both ways |

Worlds that differ little ask for commands that differ little; those are one. In a world that a command was not made for
the thing does what its constraints leave of it, by the projection with which the controller commands it; where they
refuse more than a small share, the robot would meet with an unexpected force and stop, so the thing is stuck.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.constraints.classes import Freedom, ModelClass
from pbrl_control.planar import Array
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.worlds import Worlds

Flags = NDArray[np.bool_]
TURNS = 1e-9  # of a unit move: with less it goes straight


@dataclass(frozen=True)
class Commands:
    """Velocities of one thing, and what they are in each world.

    Attributes:
        twists: (c, 3) of the thing's origin in its axes: 1 m/s along a line, or 1 rad/s about a point.
        allowed: (w, c, 3) what each world leaves of them.
        obeys: (w, c) whether it leaves enough.
        sources: (c,) the first world that asked for it; empty where nobody asked.
    """

    twists: Array
    allowed: Array
    obeys: Flags
    sources: tuple[int, ...] = ()

    @classmethod
    def of(cls, worlds: Worlds, settings: ManipulationSettings) -> Commands:
        """Collect the policies of all worlds; those that most worlds ask for come first."""
        found: list[Array] = []
        votes: list[int] = []
        sources: list[int] = []
        for world, freedom in enumerate(worlds.freedoms):
            for move in freedom.moves:
                for twist in (move, -move):
                    same = next((k for k, other in enumerate(found) if alike(twist, other, settings)), None)
                    if same is None:
                        found.append(twist)
                        votes.append(1)
                        sources.append(world)
                    else:
                        votes[same] += 1
        order = np.argsort(-np.array(votes, dtype=int), kind="stable")[: settings.commands]
        twists = np.array([found[k] for k in order]).reshape(-1, 3)
        return cls(twists, *_in_worlds(twists, worlds, settings.refused), tuple(sources[k] for k in order))

    @classmethod
    def given(cls, twists: Array, worlds: Worlds, settings: ManipulationSettings) -> Commands:
        """Take twists (c, 3) as they are."""
        return cls(twists, *_in_worlds(twists, worlds, settings.refused))

    def __len__(self) -> int:
        return len(self.twists)

    def and_(self, other: Commands) -> Commands:
        """Return these, and after them others of the same worlds."""
        allowed, obeys = np.hstack((self.allowed, other.allowed)), np.hstack((self.obeys, other.obeys))
        return Commands(np.vstack((self.twists, other.twists)), allowed, obeys)


def drives_of(base: Array, radii: tuple[float, ...]) -> Array:
    """Return what the base can do with a thing that it holds rigidly: unit twists (n, 3) of its origin in its axes.

    First the plain ones: straight on and back, aside both ways as far as arms make up for it, on the spot both ways.
    Then arcs: for each radius forward and backward to either side.

    Args:
        base: (3,) of the base in the thing's frame [m, rad].
        radii: of arcs [m].
    """
    ahead = np.array([math.cos(base[2]), math.sin(base[2])])
    aside = np.array([-ahead[1], ahead[0]])
    found = [np.array([*(sign * way), 0.0]) for way in (ahead, aside) for sign in (1.0, -1.0)]
    centres = [base[:2] + side * radius * aside for radius in (0.0, *radii) for side in (1.0, -1.0)]
    for k, (x, y) in enumerate(centres):
        turn = np.array([y, -x, 1.0])  # 1 rad/s about the point
        found += [turn, -turn] if k > 0 else []  # about the base itself only once
    return np.array(found)


def motions_of(freedom: Freedom, bases: Sequence[Array], radii: tuple[float, ...]) -> tuple[Array, Flags]:
    """Return unit twists (c, 3) that a thing allows and a base can do with it, and with which base (c, g).

    Args:
        freedom: of the thing.
        bases: g poses (3,) of the base in its frame [m, rad].
        radii: of arcs that the base drives with what is free [m].
    """
    if freedom.model_class != ModelClass.UNCONSTRAINED:
        twists = np.vstack((freedom.moves, -freedom.moves))
        return twists, np.ones((len(twists), len(bases)), dtype=bool)
    drives = [drives_of(base, radii) for base in bases]
    return np.vstack(drives), np.repeat(np.eye(len(bases), dtype=bool), len(drives[0]), axis=0)


def alike(a: Array, b: Array, settings: ManipulationSettings) -> bool:
    """Say whether two unit moves (3,) go nearly the same way, or turn nearly about the same point."""
    ax, ay, turn_a = a.tolist()
    bx, by, turn_b = b.tolist()
    if abs(turn_a) <= TURNS and abs(turn_b) <= TURNS:
        return abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by)) <= settings.same_angle
    if turn_a * turn_b <= 0.0:
        return False
    return math.hypot(ax / turn_a - bx / turn_b, ay / turn_a - by / turn_b) <= settings.same_point


def centre_of(twist: Array) -> Array:
    """Return the point (2,) of the body about which a twist (3,) of its origin turns it; it must turn."""
    return np.array([-twist[1], twist[0]]) / twist[2]


def _in_worlds(twists: Array, worlds: Worlds, refused: float) -> tuple[Array, Flags]:
    """Return what each world leaves of each twist (w, c, 3), and whether that is enough (w, c).

    What is refused is measured as the controller does, by the root of its kinetic energy, here over that of the whole.
    """
    shapes = np.array([model.inertia_shape for model in worlds.models])
    allowed = np.einsum("wij,cj->wci", worlds.projections, twists)
    lost = twists[None] - allowed
    energy = np.einsum("wci,wij,wcj->wc", lost, shapes, lost)
    whole = np.einsum("ci,wij,cj->wc", twists, shapes, twists)
    obeys: Flags = energy <= refused**2 * whole
    return allowed, obeys
