"""Ways to move a thing that open a path: one motion with one grasp, or, where none does, two one after the other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.constraints.classes import ModelClass
from pbrl_control.planar import Array
from pbrl_namo.manipulation.effort_kernel import efforts
from pbrl_namo.manipulation.grasps import Grasp, chosen, suits
from pbrl_namo.manipulation.policies import Commands, drives_of
from pbrl_namo.manipulation.rollout import Roller, Rollouts, timing
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.worlds import Worlds

Indices = NDArray[np.int64]
Row = tuple[int, tuple[int, ...], tuple[float, ...]]
"""Of one manipulation: grasp, commands, how far each is followed."""
Flags = NDArray[np.bool_]

PLAIN = 6
"""The first of the base's drives that are tried as a first motion: straight, aside, on the spot."""
SHORT = 0.05
"""Share of a unit, m or rad, below which a first motion is none."""


@dataclass(frozen=True)
class WaysToMove:
    """Manipulations of one thing, p of them, of at most two motions each.

    Attributes:
        commands: that their motions follow.
        grasps: (p,) index of the grasp.
        motions: (p, 2) index of the command; -1: there is none any more.
        went: (p, 2) how far it is followed, in units of it.
        speeds: (p, 2) by which it is multiplied.
        ramps: (p, 2) [s] to get up to speed.
    """

    commands: Commands
    grasps: Indices
    motions: Indices
    went: Array
    speeds: Array
    ramps: Array

    def __len__(self) -> int:
        return len(self.grasps)

    @classmethod
    def of(
        cls,
        rows: Sequence[Row],
        commands: Commands,
        grasps: Sequence[Grasp],
        settings: ManipulationSettings,
    ) -> WaysToMove:
        """Make them from rows."""
        count = len(rows)
        motions, went = np.full((count, 2), -1, dtype=np.int64), np.zeros((count, 2))
        for p, (_, followed, ways) in enumerate(rows):
            motions[p, : len(followed)], went[p, : len(ways)] = followed, ways
        held = np.array([row[0] for row in rows], dtype=np.int64)
        speeds, ramps = timing(commands.twists, grasps, settings.motion)
        picked = np.maximum(motions, 0), held[:, None]
        return cls(commands, held, motions, went, speeds[picked], ramps[picked])

    def and_(self, other: WaysToMove) -> WaysToMove:
        """Return these, and after them others of the same thing with the same grasps."""
        motions = np.where(other.motions >= 0, other.motions + len(self.commands), -1)
        return WaysToMove(
            self.commands.and_(other.commands),
            np.concatenate((self.grasps, other.grasps)),
            np.vstack((self.motions, motions)),
            np.vstack((self.went, other.went)),
            np.vstack((self.speeds, other.speeds)),
            np.vstack((self.ramps, other.ramps)),
        )

    def obeyed(self, worlds: Flags) -> bool:
        """Say whether in any of some worlds (w,) the thing obeys any of them."""
        return bool(self.commands.obeys[worlds][:, self.motions[:, 0]].any())

    def efforts(self, worlds: Worlds, grasps: Sequence[Grasp], torque_arm: float) -> Array:
        """Return what each takes in each world (w, p, 5), in the columns of `effort_kernel`."""
        contacts = np.zeros((len(self), 2, 2))
        grips = np.array([len(grasps[k].sides) for k in self.grasps], dtype=np.int64)
        for p, k in enumerate(self.grasps):
            contacts[p, : grips[p]] = [grasps[k].contacts[side] for side in grasps[k].sides]
        out = np.empty((len(worlds), len(self), 5))
        commands = self.commands
        efforts(
            worlds.physics,
            commands.allowed,
            commands.obeys,
            self.motions,
            self.speeds,
            self.went,
            self.ramps,
            contacts,
            grips,
            torque_arm,
            out,
        )
        return out


def suitable(
    grasps: Sequence[Grasp], worlds: Worlds, commands: Commands, settings: ManipulationSettings
) -> tuple[tuple[Grasp, ...], Flags]:
    """Return the grasps that some command needs (figure 39), and which command can be tried with which (c, g)."""
    usable = np.zeros((len(commands), len(grasps)), dtype=bool)
    shape, memory = worlds.models[0], dict[tuple[object, ...], list[int]]()
    for c, world in enumerate(commands.sources):
        freedom = worlds.freedoms[world]
        key: tuple[object, ...] = (freedom.model_class,)
        if freedom.model_class != ModelClass.UNCONSTRAINED:
            key = (freedom.model_class, *freedom.anchor.tolist(), *freedom.moves[0].tolist())
        if key not in memory:
            memory[key] = chosen(grasps, suits(grasps, freedom, shape.footprint, shape.com), settings)
        usable[c, memory[key]] = True
    needed = np.flatnonzero(usable.any(axis=0)).tolist()
    return tuple(grasps[k] for k in needed), usable[:, needed]


def first_look(
    roller: Roller, commands: Commands, usable: Flags, settings: ManipulationSettings
) -> tuple[WaysToMove, Counter[tuple[int, bool]]]:
    """Try each command with each grasp.

    Returns:
        Those that open a way, and what the others met: index in the yard's names, and whether it was the robot.
    """
    found = roller.roll(commands.twists, usable)
    rows = _single(found)
    hits, robot = found.hits[usable], found.robot[usable]
    met = Counter((int(hit), bool(was)) for hit, was in zip(hits, robot, strict=True) if hit >= 0)
    return WaysToMove.of(rows, commands, roller.grasps, settings), met


def second_look(roller: Roller, worlds: Worlds, settings: ManipulationSettings) -> WaysToMove:
    """Try what the base can do with a thing that is free: one motion, or a plain one and another after it.

    It is slower than the first look, and for openings that this did not find.

    Returns:
        Those that open a way: all of one motion, else those from the first few places from which a second one does.
    """
    grasps = roller.grasps[: settings.second_grasps]
    drives = [drives_of(grasp.base, settings.radii) for grasp in grasps]
    count = len(drives[0])
    commands = Commands.given(np.vstack(drives), worlds, settings)
    usable = np.repeat(np.eye(len(grasps), len(roller.grasps), dtype=bool), count, axis=0)
    found = roller.roll(commands.twists, usable)
    rows = _single(found)
    places = 0
    for c, g, way in _stops(found, count, settings) if not rows else ():
        others = [k for k in range(count) if k // 2 != (c - g * count) // 2]  # not on, not back again
        onward = roller.roll_on(commands.twists[c], way, g, drives[g][others])
        opened = np.flatnonzero(onward.opened[:, 0])
        rows += [(g, (c, g * count + others[k]), (way, float(onward.went[k, 0]))) for k in opened]
        places += len(opened) > 0
        if places >= settings.enough:
            break
    return WaysToMove.of(rows, commands, roller.grasps, settings)


def _single(found: Rollouts) -> list[Row]:
    """Return the motions that open a way by themselves."""
    return [(int(g), (int(c),), (float(found.went[c, g]),)) for c, g in zip(*np.nonzero(found.opened), strict=True)]


def _stops(found: Rollouts, count: int, settings: ManipulationSettings) -> Iterator[tuple[int, int, float]]:
    """Yield the ends of first motions: command, grasp, how far it is followed; the farthest of all first."""
    for share in settings.stops:
        for plain in range(PLAIN):
            for g in range(len(found.went) // count):
                c = g * count + plain
                if share * found.went[c, g] > SHORT:
                    yield c, g, share * float(found.went[c, g])
