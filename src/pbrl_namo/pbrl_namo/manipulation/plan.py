"""What Monte-Carlo manipulation answers: how likely an opening is, what it costs, how to go about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pbrl_control.constraints.classes import ModelClass
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.grasping.contacts import Hands
from pbrl_control.planar import Array
from pbrl_namo.regions.openings import Opening


@dataclass(frozen=True)
class Motion:
    """One motion of a held object, from rest to rest.

    Attributes:
        twist: (3,) of the object's origin in the object's axes [m/s, rad/s]: constant, a line or a turn about a point.
        duration: [s] that it is held; ramps come on top and cover no more ground.
        centre: (2,) the point of the object about which it turns, in its frame [m]; None: it goes straight.
    """

    twist: Array
    duration: float
    centre: Array | None


@dataclass(frozen=True)
class ManipulationPlan:
    """One way to make an opening: where to stand, what to hold, how to move it.

    Attributes:
        object: what is moved.
        sides: who grasps.
        contacts: (2,) of each side on the outline, in the object's frame [m].
        drive_to: (3,) of the base in `world` before the grasp, grippers before the edge [m, rad].
        stand: (3,) of the base in `world` when the plates have closed, straight ahead of that [m, rad].
        motions: of the object, one after the other.
        end: (3,) of the object in `world` at the end [m, rad].
        target: (2,) in `world`: the way there from where the base then is will be open [m].
        expected_force: [N] largest at a grip: mean over the worlds in which the plan works.
        highest_force: [N] likewise: the highest of them.
        works: share of the sampled worlds in which this very plan makes the opening.
        reward: mean over those worlds of equation 41's cost part, below zero.
        model_class: of the object in most of those worlds.
        model: its physics in the one of them in which the largest force at a grip is the median.
        more: manipulations that are to follow before the opening is there; zero: this one makes it.
        aside: whether the object is only put out of the way of another, and no opening is to be looked for.
        pushes: other things that it then pushes before it; forces are with what these take.
    """

    object: str
    sides: Hands
    contacts: Mapping[str, Array]
    drive_to: Array
    stand: Array
    motions: tuple[Motion, ...]
    end: Array
    target: Array
    expected_force: float
    highest_force: float
    works: float
    reward: float
    model_class: ModelClass
    model: ObjectModel
    more: int = 0
    aside: bool = False
    pushes: tuple[str, ...] = ()

    @property
    def twist(self) -> Array:
        """The first motion's twist (3,) [m/s, rad/s]."""
        return self.motions[0].twist

    @property
    def centre(self) -> Array | None:
        """The point (2,) about which the first motion turns the object, in its frame [m]; None: it goes straight."""
        return self.motions[0].centre

    @property
    def duration(self) -> float:
        """All motions' durations together, without ramps [s]."""
        return sum(motion.duration for motion in self.motions)


@dataclass(frozen=True)
class Estimate:
    """What is expected of an opening.

    Attributes:
        opening: which.
        probability: that it can be made: share of the sampled worlds in which some manipulation does (equation 40).
        reward: mean over all worlds of equation 41's cost part for the best manipulation in each, below zero; a world
            in which none works costs alpha, as much as the dearest manipulation.
        plan: the manipulation that does best over all worlds, failures counted; None where none works in any.
        reason: why the probability is zero, in words; empty where it is not.
    """

    opening: Opening
    probability: float
    reward: float
    plan: ManipulationPlan | None
    reason: str = ""
