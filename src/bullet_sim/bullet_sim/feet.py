"""Feet that slide: dry friction at one point each, as a rubber foot has it.

A foot is an elastic bristle between body and floor. It carries shear up to `mu N`, with the coefficient of what the
foot stands on and the load that Bullet says it carries now; beyond that the bristle's root is dragged along, so that
friction opposes the way that this foot goes, in every direction alike (Dahl 1968; Canudas de Wit et al. 1995). Bullet's
own contact friction is not used for it: its cone is clipped along two fixed axes, and the force on a foot that slides
at 34 degrees to them points 15 degrees off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bullet_sim.client import BulletClient
from bullet_sim.motion import BodyMotion

FOOT_STIFFNESS, FOOT_DAMPING = 2.0e4, 300.0
"""Of a rubber foot in shear [N/m], [N s/m]: it gives way by 0.4 mm before it slides with 8 N."""

LOAD_TIME = 0.02
"""Time constant [s] over which a foot's load is averaged; contact forces of single steps flicker."""

FootLaw = Callable[[float, float, float, float], float]
"""Coefficient of a foot from what it was so far, its place (x, y) [m] in `world`, and its slip speed [m/s]."""


class RubberFoot:
    """The bristle of one foot.

    Attributes:
        slip: speed [m/s] with which its root was dragged over the floor in the last step; zero while it sticks.
    """

    def __init__(self, step: float) -> None:
        """Begin without shear; `step` is the physics step [s]."""
        self.slip = 0.0
        self._step, self._x, self._y = step, 0.0, 0.0

    def force(self, vx: float, vy: float, limit: float) -> tuple[float, float]:
        """Give the friction [N] on the body for the next step.

        Args:
            vx: velocity of the foot over the floor [m/s], `world` axes.
            vy: as `vx`.
            limit: most it holds now [N].
        """
        x, y = self._x + vx * self._step, self._y + vy * self._step
        shear = FOOT_STIFFNESS * math.hypot(x, y)
        self.slip = max(0.0, shear - limit) / FOOT_STIFFNESS / self._step
        if shear > limit:
            x, y = x * limit / shear, y * limit / shear
        self._x, self._y = x, y
        force_x, force_y = -FOOT_STIFFNESS * x - FOOT_DAMPING * vx, -FOOT_STIFFNESS * y - FOOT_DAMPING * vy
        size = math.hypot(force_x, force_y)
        back = limit / size if size > limit else 1.0
        return back * force_x, back * force_y


@dataclass(frozen=True)
class Foot:
    """One foot: its link, and its place (2,) [m] in the body's frame."""

    link: int
    place: tuple[float, float]


class Feet:
    """The feet of one body.

    Attributes:
        feet: in the order of the lists.
        coefficients: of friction in the next step.
        places: (x, y) [m] of each in `world`.
        speeds: slip speed of each [m/s].
        loads: smoothed normal force [N] under each.
        friction: size of the friction [N] of each in the next step.
    """

    def __init__(self, client: BulletClient, body: str, feet: Sequence[Foot], motion: BodyMotion) -> None:
        """Take note of feet without friction."""
        self.feet = tuple(feet)
        count = len(self.feet)
        self.coefficients, self.speeds, self.loads, self.friction = ([0.0] * count for _ in range(4))
        self.places = [(0.0, 0.0)] * count
        self._client, self._body, self._motion = client, client.body(body), motion
        self._rubber = [RubberFoot(client.step_time) for _ in self.feet]
        self._index = {foot.link: number for number, foot in enumerate(self.feet)}
        self._keep = math.exp(-client.step_time / LOAD_TIME)
        self._laws: list[FootLaw] = []
        self._tiles: list[FootLaw] = []
        self._floor = client.floor_friction

    def add_law(self, law: FootLaw) -> None:
        """Let a law decide of the feet's friction on a floor of friction 1, after those added before."""
        self._laws.append(law)

    def add_tile(self, law: FootLaw) -> None:
        """Let a tile with a friction of its own decide, after all laws and the floor."""
        self._tiles.append(law)

    def _coefficient(self, x: float, y: float, speed: float) -> float:
        """Give the coefficient of a foot at a place (x, y) [m] that slips with a speed [m/s]."""
        coefficient = 0.0
        for law in self._laws:
            coefficient = law(coefficient, x, y, speed)
        coefficient *= self._floor
        for tile in self._tiles:
            coefficient = tile(coefficient, x, y, speed)
        return coefficient

    def _weigh(self) -> None:
        """Bring the loads up to date."""
        seen = [0.0] * len(self.feet)
        for contact in self._client.api.getContactPoints(bodyA=self._body):
            number = self._index.get(contact[3])
            if number is not None:
                seen[number] += contact[9]
        keep = self._keep if any(self.loads) else 0.0
        self.loads = [keep * old + (1 - keep) * new for old, new in zip(self.loads, seen, strict=True)]

    def update(self) -> None:
        """Rub on the floor during the next step."""
        if not self._laws and not self._tiles:
            return
        motion = self._motion
        motion.look()
        self._weigh()
        for number, foot in enumerate(self.feet):
            x, y = self.places[number] = motion.point(foot.place)
            vx, vy = motion.speed_at((x, y))
            speed = self.speeds[number] = self._rubber[number].slip
            self.coefficients[number] = self._coefficient(x, y, speed)
            force_x, force_y = self._rubber[number].force(vx, vy, self.coefficients[number] * self.loads[number])
            self.friction[number] = math.hypot(force_x, force_y)
            if self.friction[number] > 0:
                motion.push((force_x, force_y, 0.0), (x, y, 0.0))
