"""Caster swivel: a body that one takes to slide freely stands on casters that have to turn first."""

from __future__ import annotations

import numpy as np

from bullet_sim.casters import Casters
from bullet_sim.catalogue import CasterSettings
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture


class CasterSwivelSettings(CasterSettings):
    """The casters that stand in the place of a plain table's feet; see `catalogue.CasterSettings`."""


class CasterSwivel(Effect):
    """How far the casters are from trailing: the largest angle between a fork and the way its mount goes."""

    name, unit = "caster_swivel", "rad"

    def __init__(self, body: Furniture, casters: Casters) -> None:
        """Watch casters that are built in."""
        super().__init__(body.name)
        self._body, self._casters = body, casters

    def strength(self) -> float:
        """Give the angle [rad]; zero while the body stands."""
        pose, twist = self._body.state()
        worst = 0.0
        for caster, angle in zip(self._casters.links, self._casters.angles(), strict=True):
            arm = pose.matrix @ np.array([*caster.place, 0.0])
            vx, vy = twist.linear[0] - twist.angular[2] * arm[1], twist.linear[1] + twist.angular[2] * arm[0]
            if vx * vx + vy * vy > 1e-4:
                off = np.arctan2(vy, vx) - pose.yaw - angle
                worst = max(worst, abs(float((off + np.pi) % (2 * np.pi) - np.pi)))
        return worst

    def acting(self) -> bool:
        """Tell whether one has more than 0.2 rad to turn."""
        return self.strength() > 0.2
