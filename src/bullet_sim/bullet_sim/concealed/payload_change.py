"""Payload change: somebody puts a thing on a body while it is pushed, or takes one off it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.quiet import bullet
from bullet_sim.settings import Positive, Settings, Vector2

SIDE = 0.20
"""Of the box [m]."""

HOLD = 1.0e5
"""Most force [N] with which the box is held where it was put."""


class PayloadChangeSettings(Settings):
    """A box of a mass of its own, beyond what the body weighs.

    Attributes:
        mass: of the box [kg].
        at: moment [s] at which it is put on, at rest in the room, or taken off.
        place: (x, y) [m] of its middle on the body's top, body's frame.
        taken_off: whether it stands there from the start and is lifted off, instead of being put on.
    """

    mass: Positive = 10.0
    at: Annotated[float, Field(ge=0, le=3600)]
    place: Vector2 = (0.0, 0.0)
    taken_off: bool = False


class PayloadChange(Effect):
    """A body of its own in Bullet, held on the top by a rigid constraint: together they keep their momentum."""

    name, unit = "payload_change", "kg"

    def __init__(self, client: BulletClient, body: Furniture, settings: PayloadChangeSettings) -> None:
        """Take note of the box; it is made when it is put on."""
        super().__init__(body.name)
        self._client, self._body, self._settings = client, body, settings
        self._box: tuple[int, int] | None = None
        self._changed = False
        if settings.taken_off:
            self._put_on()

    def update(self, time: float) -> None:
        """Put the box on, or take it off, when the moment has come."""
        if self._changed or time < self._settings.at:
            return
        self._changed = True
        if self._settings.taken_off:
            self._take_off()
        else:
            self._put_on()

    def _put_on(self) -> None:
        api, pose = self._client.api, self._body.pose()
        look = api.createVisualShape(bullet.GEOM_BOX, halfExtents=[SIDE / 2] * 3, rgbaColor=[0.5, 0.4, 0.25, 1])
        place = [*self._settings.place, SIDE / 2]
        box = api.createMultiBody(
            baseMass=self._settings.mass,
            baseVisualShapeIndex=look,
            basePosition=pose.point(place).tolist(),
            baseOrientation=pose.quaternion.tolist(),
        )
        self._client.add(f"payload_on_{self._body.name}", box)
        inertia = self._settings.mass * SIDE**2 / 6
        api.changeDynamics(box, -1, localInertiaDiagonal=[inertia] * 3)
        tag = self._body.tag_offset
        held = api.createConstraint(
            self._client.body(self._body.name),
            -1,
            box,
            -1,
            bullet.JOINT_FIXED,
            [0, 0, 0],
            [tag[0] + place[0], tag[1] + place[1], tag[2] + place[2]],
            [0, 0, 0],
        )
        api.changeConstraint(held, maxForce=HOLD)
        self._box = held, box

    def _take_off(self) -> None:
        assert self._box is not None
        held, _ = self._box
        self._client.api.removeConstraint(held)
        self._client.remove(f"payload_on_{self._body.name}")
        self._box = None

    def strength(self) -> float:
        """Give what lies on the body beyond the body that was told [kg]: before it is taken off, after it is put on."""
        return self._settings.mass if self._box is not None else 0.0
