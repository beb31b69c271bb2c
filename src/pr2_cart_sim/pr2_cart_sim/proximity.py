"""How near robot and cart come to people and things, and what they touch: truth for whoever scores, never a topic."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from bullet_sim.client import FLOOR, BulletClient
from pr2_cart_sim.people import Nearness

Place = tuple[float, float]

REACH = 1.2
"""[m] within which distances to people are measured."""
THINGS_REACH = 0.5
"""[m] within which distances to everything else are measured."""
TOUCHING = 5e-4
"""Gap [m] below which two bodies touch; Bullet keeps a contact alive a little beyond it."""
APART = 0.25
"""Time [s] without touching after which the next touch is another contact."""


@dataclass
class Contact:
    """Somebody or something touched.

    Attributes:
        mover: "robot", or the name of the body that it pushes.
        other: name of the person, the furniture or the wall.
        person: whether it was somebody.
        start: when it began [s].
        end: when it was last seen [s].
        peak: greatest normal force of one physics step [N].
    """

    mover: str
    other: str
    person: bool
    start: float
    end: float
    peak: float


@dataclass
class Clearance:
    """Least distances so far [m]; infinite beyond `REACH`, and beyond `THINGS_REACH` for things."""

    people: dict[str, float] = field(default_factory=dict)
    things: dict[str, float] = field(default_factory=dict)

    @property
    def person(self) -> float:
        """To anybody."""
        return min(self.people.values(), default=math.inf)

    @property
    def thing(self) -> float:
        """To anything."""
        return min(self.things.values(), default=math.inf)


class Proximity:
    """Watches robot and cart.

    Attributes:
        contacts: all so far, in the order in which they began.
        clearance: least distances so far.
    """

    def __init__(self, client: BulletClient, movers: Mapping[str, str], people: Iterable[str]) -> None:
        """Start watching.

        Args:
            client: the world.
            movers: name in Bullet of the robot and of what it pushes, by the name to report.
            people: names of people.
        """
        self._client, self._people = client, tuple(people)
        self._movers = {name: client.body(body) for name, body in movers.items()}
        self._names = {number: name for name, number in client.bodies.items()}
        ours = set(self._movers.values()) | {client.body(FLOOR)}
        self._others = {number: name for number, name in self._names.items() if number not in ours}
        self.contacts: list[Contact] = []
        self.clearance = Clearance()
        self._going_on: dict[tuple[str, str], Contact] = {}

    def watch_touches(self, time: float) -> None:
        """Take note of what touches; call after each physics step, `time` [s]."""
        for mover, number in self._movers.items():
            for point in self._client.api.getContactPoints(number):
                other = self._others.get(point[2] if point[1] == number else point[1])
                if other is not None and point[8] < TOUCHING:
                    self._touch(time, mover, other, float(point[9]))

    def _touch(self, time: float, mover: str, other: str, force: float) -> None:
        known = self._going_on.get((mover, other))
        if known is None or time - known.end > APART:
            known = Contact(mover, other, other in self._people, time, time, force)
            self._going_on[mover, other] = known
            self.contacts.append(known)
        known.end, known.peak = time, max(known.peak, force)

    def near_people(
        self, places: Mapping[str, tuple[float, float]], centre: tuple[float, float]
    ) -> dict[str, Nearness]:
        """Measure how near people are.

        Args:
            places: where everybody is (x, y) [m], by name.
            centre: of the robot (x, y) [m]; who is farther than 3.5 m away is not looked at.
        """
        found = {}
        for name, (x, y) in places.items():
            if math.hypot(x - centre[0], y - centre[1]) > 3.5:
                continue
            nearest = self._nearest(self._client.body(name), REACH)
            if nearest is None:
                continue
            found[name] = nearest
            least = self.clearance.people
            least[name] = min(least.get(name, math.inf), nearest.distance)
        return found

    def measure_things(self) -> None:
        """Measure how near furniture and walls are."""
        low, high = [math.inf] * 3, [-math.inf] * 3
        api = self._client.api
        for number in self._movers.values():
            for link in range(-1, api.getNumJoints(number)):
                box = api.getAABB(number, link)
                low = [min(a, b) for a, b in zip(low, box[0], strict=True)]
                high = [max(a, b) for a, b in zip(high, box[1], strict=True)]
        low, high = [value - THINGS_REACH for value in low], [value + THINGS_REACH for value in high]
        least = self.clearance.things
        for number in sorted({pair[0] for pair in api.getOverlappingObjects(low, high) or ()}):
            name = self._others.get(number)
            if name is None or name in self._people:
                continue
            nearest = self._nearest(number, THINGS_REACH)
            if nearest is not None:
                least[name] = min(least.get(name, math.inf), nearest.distance)

    def _nearest(self, other: int, reach: float) -> Nearness | None:
        """Give distance and direction from a body to the nearest of robot and cart within `reach` [m]."""
        best: tuple[float, tuple[float, float]] | None = None
        for number in self._movers.values():
            for point in self._client.api.getClosestPoints(other, number, reach):
                if best is None or point[8] < best[0]:
                    a, b = point[5], point[6]
                    best = point[8], (b[0] - a[0], b[1] - a[1])
        if best is None:
            return None
        distance, (x, y) = best
        size = math.hypot(x, y)
        if size < 1e-6:
            return Nearness(distance, (0.0, 0.0))
        sign = 1.0 if distance > 0 else -1.0  # points of bodies that overlap lie the other way round
        return Nearness(distance, (sign * x / size, sign * y / size))
