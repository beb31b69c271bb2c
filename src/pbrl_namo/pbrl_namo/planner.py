"""The NAMO planner: which thing to move next, how, and what to expect; or, in words, why nothing can be done.

Free-space regions and openings are the upper level's states and actions; Monte-Carlo manipulation estimates each
opening that matters; value iteration chooses (thesis 6.2.1). One plan is for what is known now: after each
manipulation, and whenever a belief changes, everything is planned anew.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np
import shapely

from pbrl_control.planar import Array
from pbrl_namo.beliefs.belief import ObjectBelief, prior_belief
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation.cost import best_reward
from pbrl_namo.manipulation.estimate import estimate_prepared
from pbrl_namo.manipulation.making_room import RoomMaker
from pbrl_namo.manipulation.plan import Estimate
from pbrl_namo.manipulation.pushing_through import PushingThrough
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.study import Study
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.mdp.expansion import expand
from pbrl_namo.mdp.value_iteration import Policy
from pbrl_namo.regions.free_space import FreeSpace, drive_radius, free_space
from pbrl_namo.regions.openings import Opening, closers, cut_off, openings
from pbrl_namo.regions.roadmap import Roadmap, build_roadmap
from pbrl_namo.regions.standing_room import StandingRoom, standing_room
from pbrl_namo.regions.whereabouts import region_of
from pbrl_namo.scene import NamoScene
from pbrl_namo.settings import NamoSettings

Result = TypeVar("Result")
TOLD = 6  # openings of which the reason says why they cannot be made


@dataclass(frozen=True)
class NamoPlan:
    """What to do next.

    Attributes:
        free: the regions.
        start: the region that the robot is in; None where it is in none.
        goal: the region that is wanted; None where it is none.
        openings: that there are.
        estimates: of each; None where it did not matter.
        policy: of the upper level; None where there was nothing to decide.
        chosen: what to do next; None where the robot can just drive, or nothing can be done.
        reason: why nothing is chosen, in words; empty where something is.
        drive: whether the goal is reached without moving anything.
        cut_off: regions that no sequence of openings reaches from the start.
        rooms: places to stand, at things that close what is cut off, that others take; looked for where the goal is
            cut off.
        seconds: that each part took [s].
    """

    free: FreeSpace
    start: int | None
    goal: int | None
    openings: tuple[Opening, ...] = ()
    estimates: tuple[Estimate | None, ...] = ()
    policy: Policy | None = None
    chosen: Estimate | None = None
    reason: str = ""
    drive: bool = False
    cut_off: tuple[int, ...] = ()
    rooms: tuple[StandingRoom, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)


def prior_beliefs(scene: NamoScene, seed: int, settings: NamoSettings | None = None) -> dict[str, ObjectBelief]:
    """Return what is believed of everything movable before anything was pushed.

    Raises:
        NamoError: a guessed mass is not above zero.
    """
    settings = settings or NamoSettings()
    return {
        name: prior_belief(thing, np.random.default_rng([seed, 2, index]), settings.beliefs)
        for index, (name, thing) in enumerate(scene.movable.items())
    }


def plan(
    scene: NamoScene,
    beliefs: Mapping[str, ObjectBelief],
    seed: int,
    settings: NamoSettings | None = None,
    been: Mapping[str, Sequence[Array]] | None = None,
) -> NamoPlan:
    """Plan what to move next; same seed, same plan.

    Where nothing helps, it is looked for harder (`NamoSettings.last_resort`), unless walls alone cut the goal off.

    Args:
        scene: what is known of the room, now.
        beliefs: of everything movable that may have to be moved.
        seed: of the roadmap and the sampled worlds.
        settings: of everything.
        been: poses (3,) in `world`, by name, from which things were moved on the way to this goal: where a thing is
            moved in steps, or out of the way, it is not brought back there, so that this comes to an end [m, rad].

    Raises:
        NamoError: nothing is believed of a thing that could be moved, or a belief is not of it.
    """
    settings = settings or NamoSettings()
    first = made = _plan(scene, beliefs, seed, settings, been or {})
    seconds = Counter(first.seconds)
    for harder in settings.harder() if _in_vain(first) and _joined_without_things(scene, first) else ():
        made = _plan(scene, beliefs, seed, harder, been or {})
        seconds.update(made.seconds)
        if made.chosen is not None:
            break
    return replace(first if made.chosen is None else made, seconds=dict(seconds))


def _in_vain(made: NamoPlan) -> bool:
    """Say whether a plan found nothing to do though start and goal are regions."""
    return not made.drive and made.chosen is None and made.start is not None and made.goal is not None


def _joined_without_things(scene: NamoScene, made: NamoPlan) -> bool:
    """Say whether start and goal would be in one region if everything movable were gone."""
    bare = free_space(scene, made.free.radius, leave_out=tuple(scene.movable))
    inside = [made.free.regions[k].point_on_surface() for k in (made.start, made.goal) if k is not None]
    start, goal = bare.indices(shapely.get_coordinates(inside))
    return bool(start == goal)


def _plan(
    scene: NamoScene,
    beliefs: Mapping[str, ObjectBelief],
    seed: int,
    settings: NamoSettings,
    been: Mapping[str, Sequence[Array]],
) -> NamoPlan:
    """Plan once."""
    clock = _Clock()
    radius = settings.regions.radius
    size = drive_radius(scene.robot, settings.regions.margin) if radius is None else radius
    free = clock("regions", lambda: free_space(scene, size))
    start, fault = _region(scene, free, scene.start, "start")
    goal, other = _region(scene, free, scene.goal, "goal")
    if start is None or goal is None:
        return NamoPlan(free, start, goal, reason=fault or other, seconds=clock.seconds)
    if start == goal:
        why = "the goal is reached without moving anything: drive there"
        return NamoPlan(free, start, goal, reason=why, drive=True, seconds=clock.seconds)
    roadmap = clock("roadmap", lambda: build_roadmap(scene, np.random.default_rng([seed, 0]), settings.regions))
    found = clock("openings", lambda: _left(scene, free, openings(scene, free, roadmap)))
    away = cut_off(free, found, start)
    maker = _Maker(scene, free, roadmap, beliefs, seed, settings.manipulation, clock, been)
    if goal in away:
        made_room = maker.make_room(start, goal)
        if made_room is not None:
            none = (None,) * len(found)
            return NamoPlan(free, start, goal, found, none, None, made_room, "", False, away, (), clock.seconds)
        draws = np.random.default_rng([seed, 3])
        rooms = clock(
            "standing room", lambda: standing_room(scene, free, roadmap, found, start, draws, settings.regions)
        )
        why = _unreachable(free, start, goal, away, rooms)
        none = (None,) * len(found)
        return NamoPlan(free, start, goal, found, none, None, None, why, False, away, rooms, clock.seconds)
    best = best_reward(settings.manipulation.cost)
    made = clock.around("values", lambda: expand(len(free.regions), start, goal, found, maker, best, settings.mdp))
    action = made.policy.best[start]
    chosen = None if action is None else made.estimates[action]
    if chosen is None:
        chosen = maker.make_room(start, goal)
    reason = "" if chosen is not None else _hopeless(start, goal, made.estimates)
    return NamoPlan(
        free, start, goal, found, made.estimates, made.policy, chosen, reason, False, away, (), clock.seconds
    )


def _region(scene: NamoScene, free: FreeSpace, pose: Array, what: str) -> tuple[int | None, str]:
    """Return the region that a pose (3,) belongs to, or why it belongs to none, in words."""
    try:
        return region_of(scene, free, pose, what), ""
    except NamoError as error:
        return None, str(error)


class _Clock:
    """Says how long each part took."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def __call__(self, part: str, work: Callable[[], Result]) -> Result:
        """Do something, and add the time to a part [s]."""
        before = time.perf_counter()
        result = work()
        self.seconds[part] = self.seconds.get(part, 0.0) + time.perf_counter() - before
        return result

    def around(self, part: str, work: Callable[[], Result]) -> Result:
        """Do the same with work that times parts of itself, whose times are not the part's."""
        inside = sum(self.seconds.values())
        result = self(part, work)
        self.seconds[part] -= sum(self.seconds.values()) - self.seconds[part] - inside
        return result


class _Maker:
    """Estimates openings of one scene; each thing's worlds are drawn once, by a seed of its own."""

    def __init__(
        self,
        scene: NamoScene,
        free: FreeSpace,
        roadmap: Roadmap,
        beliefs: Mapping[str, ObjectBelief],
        seed: int,
        settings: ManipulationSettings,
        clock: _Clock,
        been: Mapping[str, Sequence[Array]],
    ) -> None:
        self._been = been
        self._scene, self._free, self._roadmap, self._beliefs = scene, free, roadmap, beliefs
        self._seed, self._settings, self._clock = seed, settings, clock
        self._names = list(scene.movable)
        self._studies: dict[str, Study] = {}
        self._yard: Yard | None = None

    def __call__(self, opening: Opening) -> Estimate:
        """Return the estimate of an opening."""
        yard = self.yard
        for name in (opening.object, *opening.then):
            self.study(name)
        return self._clock(
            "manipulation",
            lambda: estimate_prepared(
                yard,
                self._free,
                self._roadmap,
                opening,
                self._studies,
                self._settings,
                self._been.get(opening.object, ()),
            ),
        )

    @property
    def yard(self) -> Yard:
        """The scene, prepared."""
        if self._yard is None:
            self._yard = self._clock("scene", self._prepare)
        return self._yard

    def study(self, name: str) -> Study:
        """Return a thing, made ready."""
        if name not in self._studies:
            self._studies[name] = self._clock("worlds", partial(self._study, name))
        return self._studies[name]

    def make_room(self, start: int, goal: int) -> Estimate | None:
        """Return what to expect of moving something so that what closes the goal can be moved, if anything."""
        if self._settings.steps < 2:
            return None
        return self._clock.around("room", lambda: self._make_room(start, goal))

    def _make_room(self, start: int, goal: int) -> Estimate | None:
        found = closers(self._scene, self._free, start, goal)
        rooms = RoomMaker(self.yard, self._free, self._roadmap, self.study, self._settings, self._been)
        made = rooms.find(found, self._scene.goal[:2])
        if made is None and self._settings.pushing:
            pushing = PushingThrough(self.yard, self._free, self.study, self._settings)
            made = pushing.find(found, self._scene.goal[:2])
        return made

    def _prepare(self) -> Yard:
        return Yard.of(self._scene, self._free.radius, self._settings.cell)

    def _study(self, name: str) -> Study:
        rng = np.random.default_rng([self._seed, 1, self._names.index(name)])
        return Study.of(self._scene, name, self._beliefs, rng, self._settings)


def _left(scene: NamoScene, free: FreeSpace, found: Sequence[Opening]) -> tuple[Opening, ...]:
    """Return the openings that there is still something to be done for.

    Of one with further obstacles the first has done its part as soon as only these are in the way. To move it again
    opens nothing, yet would be taken for a success each time.
    """
    middles = [shapely.get_coordinates(region.point_on_surface())[0] for region in free.regions]
    without = {
        then: free_space(scene, free.radius, leave_out=then).indices(np.array(middles))
        for then in {opening.then for opening in found if opening.then}
    }
    return tuple(
        each for each in found if not each.then or without[each.then][each.start] != without[each.then][each.end]
    )


def _unreachable(free: FreeSpace, start: int, goal: int, away: tuple[int, ...], rooms: tuple[StandingRoom, ...]) -> str:
    """Say that no sequence of openings reaches the goal, what is cut off, and whether more room to stand may help."""
    regions = ", ".join(f"{region} ({free.regions[region].area:.1f} m^2)" for region in away)
    if not rooms:
        return f"the goal's region {goal} cannot be reached from region {start}, whatever is moved; cut off: {regions}"
    room = rooms[0]
    taken = " and ".join(map(repr, room.blockers))
    return (
        f"the goal's region {goal} cannot be reached from region {start} by moving what closes it; perhaps by moving "
        f"{taken} first, to make room to stand before {room.object!r}; cut off: {regions}"
    )


def _hopeless(start: int, goal: int, estimates: tuple[Estimate | None, ...]) -> str:
    """Say of each opening that was looked at why it cannot be made."""
    tried = [each for each in estimates if each is not None]
    why = list(dict.fromkeys(each.reason or f"{each.opening.object!r} is not worth it" for each in tried))
    more = f"; and {len(why) - TOLD} more" if len(why) > TOLD else ""
    return f"no way from region {start} to the goal's region {goal}: {'; '.join(why[:TOLD])}{more}"
