"""People who walk along their routes, rest at the ends, and now and then step in front of the robot.

What a person does is drawn from a generator of their own, so that adding somebody changes nobody else. They walk
through each other and through furniture that their route crosses; before robot and cart they stop, and step back where
those come close.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.client import BulletClient
from pr2_cart_sim.person_body import PersonBody
from pr2_cart_sim.scene import Manners, Person

Array = NDArray[np.float64]

Disc = tuple[float, float, float]

TICK = 0.01
"""[s] between two moves of people."""
TOUCH = 0.01
"""[m] from the robot at which somebody without manners stands, too."""
PAST, ROOM = 0.4, 0.5
"""Cosine of the angle between somebody's way and the nearest of robot and cart below which it leads past; and the share
of their margin that has to be left for that. Where less is left, they step back."""
ASIDE = (0.0, 0.8, -0.8, 1.5, -1.5)
"""Off the way straight back, in which they step where there is no room [rad]."""
TURNING = 4.0
"""Rate [rad/s] at which people turn."""
ARRIVED = 0.05
"""[m]"""
DRAWS = 50
"""Places that are drawn at most for somebody to start from."""
CHEST = 1.0
"""Height [m] at which somebody looks whether the way is free."""


@dataclass(frozen=True)
class Nearness:
    """How near somebody is to robot or cart: distance [m], and the direction (2,) from them towards it."""

    distance: float
    direction: tuple[float, float]


@dataclass(frozen=True)
class Lead:
    """What goes ahead of the robot: its foremost point (2,) [m], the direction (2,) of its motion, its speed [m/s]."""

    point: Array
    direction: Array
    speed: float


class Walker:
    """One person on their way.

    Attributes:
        place: (2,) [m] in `world`.
        heading: [rad].
        speed: now [m/s].
        errand: whether they are out to stand in front of the robot, or stand there.
    """

    def __init__(
        self, body: PersonBody, person: Person, manners: Manners, rng: Generator, taken: Sequence[Disc] = ()
    ) -> None:
        """Start somewhere along the route, drawn from `rng`, which is kept, and outside what is `taken` if possible."""
        self._body = body
        self._person, self._manners, self._rng = person, manners, rng
        self._route = np.array(person.route)
        for _ in range(DRAWS):
            self._next, self.place = self._draw_start()
            if all(math.hypot(self.place[0] - x, self.place[1] - y) > r for x, y, r in taken):
                break
        self._forward = True
        self.heading, self.speed, self._walked = float(rng.uniform(-math.pi, math.pi)), 0.0, 0.0
        self._rest, self._waited, self._stands, self.errand = 0.0, 0.0, False, False
        self._errand_goal: Array | None = None
        self._left_from = self.place
        self._put(0.0)

    def _draw_start(self) -> tuple[int, Array]:
        """Draw a place on the route, and to which of its corners it leads."""
        ahead = int(self._rng.integers(len(self._route)))
        behind = self._route[max(ahead - 1, 0)]
        return ahead, behind + self._rng.random() * (self._route[ahead] - behind)

    def move(self, near: Nearness | None, free: Callable[[Array], bool] = lambda way: True) -> None:
        """Live for one tick.

        Args:
            near: how near robot or cart is, None where it is not.
            free: whether there is room for a step in a direction (2,).
        """
        aside = next((way for way in self._away(near) if free(way)), None)
        if aside is not None:
            self._step(aside, self._person.speed * TICK)
            return
        if self._rest > 0:
            self._rest -= TICK
            self._stand()
            return
        goal = self._errand_goal if self._errand_goal is not None else self._route[self._next]
        way = goal - self.place
        distance = float(np.hypot(*way))
        if distance < ARRIVED:
            self._arrive()
            self._stand()
            return
        self._turn_to(math.atan2(way[1], way[0]))
        if self._is_stopped(near, way / distance):
            self._wait()
            return
        self._waited = 0.0
        self._step(way / distance, min(self._person.speed * TICK, distance))

    def _step(self, direction: Array, length: float) -> None:
        self.place = self.place + length * direction
        self._walked += length
        self._stands, self.speed = False, self._person.speed
        self._put(1.0)

    def _away(self, near: Nearness | None) -> list[Array]:
        """Return directions (2,) in which who has manners steps back as robot or cart come close, the best first.

        They see a robot that backs up, which has no laser behind; and who stands beside a cart that does not pass them
        gives it room instead of waiting for it for ever.
        """
        if near is None or not self._manners.social or near.distance >= ROOM * self._manners.margin:
            return []
        x, y = near.direction
        size = math.hypot(x, y)
        turns = [(math.cos(angle), math.sin(angle)) for angle in ASIDE] if size > 0.0 else []
        return [-np.array([c * x - s * y, s * x + c * y]) / size for c, s in turns]

    def step_in(self, goal: Array) -> None:
        """Go and stand at `goal` (2,) [m] for a while, then come back."""
        self.errand, self._errand_goal, self._left_from, self._rest = True, goal, self.place, 0.0

    def _arrive(self) -> None:
        """Rest where a way ends, and choose the next."""
        if self._errand_goal is not None:
            out = self.errand and self._errand_goal is not self._left_from
            self._rest = self._manners.stand if out else 0.0
            self._errand_goal = self._left_from if out else None
            self.errand = out
            return
        last = len(self._route) - 1
        if last == 0:
            self._rest = math.inf
            return
        if self._next in (0, last):
            self._forward = self._next == 0
            self._rest = float(self._rng.exponential(self._person.pause)) if self._person.pause > 0 else 0.0
        self._next += 1 if self._forward else -1

    def _is_stopped(self, near: Nearness | None, direction: Array) -> bool:
        """Tell whether robot or cart is in the way: too near, and nearer with every step.

        Who has manners walks past as long as there is room. Else robot and somebody in a doorway wait for each other
        for ever: every way out, back into the room as well, leads a little nearer.
        """
        if near is None or near.distance >= (self._manners.margin if self._manners.social else TOUCH):
            return False
        past = PAST if self._manners.social and near.distance >= ROOM * self._manners.margin else 0.0
        return direction[0] * near.direction[0] + direction[1] * near.direction[1] > past

    def _wait(self) -> None:
        """Stand before what is in the way; turn back once patience is at its end."""
        self._stand()
        self._waited += TICK
        if self._waited < self._manners.patience:
            return
        self._waited = 0.0
        if self._errand_goal is not None:
            self._errand_goal = None if self._errand_goal is self._left_from else self._left_from
            self.errand = self._errand_goal is not None
            return
        back = self._next - 1 if self._forward else self._next + 1
        if 0 <= back < len(self._route):
            self._forward, self._next = not self._forward, back

    def _turn_to(self, heading: float) -> None:
        off = (heading - self.heading + math.pi) % (2 * math.pi) - math.pi
        self.heading += max(-TURNING * TICK, min(TURNING * TICK, off))

    def _stand(self) -> None:
        self.speed = 0.0
        if not self._stands:
            self._stands = True
            self._put(0.0)

    def _put(self, swing: float) -> None:
        self._body.put(float(self.place[0]), float(self.place[1]), self.heading, self._walked, swing)


class Crowd:
    """Everybody.

    Attributes:
        walkers: by name.
    """

    def __init__(
        self,
        client: BulletClient,
        people: Mapping[str, Person],
        manners: Manners,
        rng: Generator,
        taken: Sequence[Disc] = (),
    ) -> None:
        """Put people into the world.

        Args:
            client: the world.
            people: by name.
            manners: of all of them.
            rng: gives each a generator of their own.
            taken: where nobody may be at the start, as x, y, radius [m].
        """
        self._api, self._manners = client.api, manners
        streams = rng.spawn(len(people)) if people else []
        self.walkers = {
            name: Walker(PersonBody(client, name, person, which), person, manners, stream, taken)
            for which, ((name, person), stream) in enumerate(zip(people.items(), streams, strict=True))
        }
        self._chance = dict(zip(people, streams, strict=True))

    def move(self, near: Mapping[str, Nearness], lead: Lead | None) -> None:
        """Let everybody live for one tick.

        Args:
            near: how near robot or cart is to those who are near, by name.
            lead: what goes ahead of the robot; None: nobody steps in front of it.
        """
        for name, walker in self.walkers.items():
            if lead is not None:
                self._tempt(walker, self._chance[name], lead)
            walker.move(near.get(name), partial(self._has_room, walker))

    def _tempt(self, walker: Walker, rng: Generator, lead: Lead) -> None:
        """Let somebody who is near step in front of a robot that moves, if chance will have it."""
        manners = self._manners
        if manners.step_in_rate == 0 or walker.errand or lead.speed < 0.05:
            return
        if rng.random() >= manners.step_in_rate / 60 * TICK:
            return
        goal = lead.point + manners.step_in_ahead * lead.direction
        if np.hypot(*(goal - walker.place)) > manners.step_in_within or not self._is_free(walker, goal):
            return
        walker.step_in(goal)

    def _has_room(self, walker: Walker, way: Array) -> bool:
        """Tell whether nothing stands where somebody's next steps in a direction (2,) lead."""
        aside = 0.25 * np.array([-way[1], way[0]])
        offs = (-aside, 0 * aside, aside)
        starts = [[*(walker.place + 0.3 * way + off), CHEST] for off in offs]
        ends = [[*(walker.place + 0.5 * way + off), CHEST] for off in offs]
        return all(hit[0] < 0 for hit in self._api.rayTestBatch(starts, ends))

    def _is_free(self, walker: Walker, goal: Array) -> bool:
        """Tell whether nothing stands between somebody and a place, nor close beyond it."""
        way = goal - walker.place
        length = float(np.hypot(*way))
        if length < ARRIVED:
            return False
        ahead = way / length
        aside = 0.25 * np.array([-ahead[1], ahead[0]])
        starts = [[*(walker.place + 0.4 * ahead + off), CHEST] for off in (-aside, 0 * aside, aside)]
        ends = [[*(goal + 0.3 * ahead + off), CHEST] for off in (-aside, 0 * aside, aside)]
        return all(hit[0] < 0 for hit in self._api.rayTestBatch(starts, ends))
