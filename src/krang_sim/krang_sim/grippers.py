"""Krang's two grippers."""

from __future__ import annotations

from bullet_sim import grippers
from bullet_sim.clamp import GripperSpec
from bullet_sim.grippers import GraspOutcome
from bullet_sim.world import World
from krang_sim.errors import KrangError
from krang_sim.robot import NAME, SIDES, Krang

__all__ = ["SPECS", "GraspOutcome", "Grippers", "no_such_side"]

SPECS = {"left": GripperSpec(approach=1.0), "right": GripperSpec(approach=-1.0)}
"""The plates of each hand; the right one reaches along -y of its frame."""


class Grippers(grippers.Grippers):
    """Both grippers and their grips."""

    def __init__(self, world: World, robot: Krang) -> None:
        """Start with both open."""
        super().__init__(world, NAME, {side: robot.links[f"{side}_ft"] for side in SIDES}, SPECS)


def no_such_side(side: str) -> KrangError:
    """Make the error for a gripper that Krang does not have."""
    return KrangError(grippers.no_such_side(side))
