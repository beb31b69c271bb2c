"""Bodies that nobody was told of: fixed ones in the way (`hidden_obstacle`), and ones that give way (`unseen_body`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bullet_sim.catalogue import Block, Fixture
from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.prisms import build_prism
from bullet_sim.settings import Positive

Array = NDArray[np.float64]

TOUCH = 0.5
"""Force [N] from which on a contact counts."""


class HiddenObstacleSettings(Fixture):
    """A fixed prism: a pillar, a door stop, a box screwed to the floor; see `catalogue.Fixture`."""

    kind: Literal["fixture"] = "fixture"
    height: Positive = 1.0


class UnseenBodySettings(Block):
    """A prism that slides when it is met: a crate, a bin; see `catalogue.Block`."""

    kind: Literal["block"] = "block"
    height: Positive = 0.80
    nominal_mass: Positive = 8.0
    friction: Positive = 0.3


class HiddenBody(Effect):
    """A body in Bullet like any other; only `/scene` and the tags do not know it.

    Attributes:
        furniture: the body, for scoring only.
    """

    def __init__(
        self,
        client: BulletClient,
        known: Mapping[str, Furniture],
        settings: HiddenObstacleSettings | UnseenBodySettings,
        target: str,
    ) -> None:
        """Put it into the room."""
        super().__init__(target)
        self._client = client
        self.furniture = build_prism(client, f"{self.name}_{target}", settings)
        self._number = client.body(self.furniture.name)
        self._known = {client.body(name) for name in known}

    def strength(self) -> float:
        """Give the sum of the normal forces between it and known bodies [N]."""
        contacts = self._client.api.getContactPoints(bodyA=self._number)
        return float(sum(contact[9] for contact in contacts if contact[2] in self._known))

    def acting(self) -> bool:
        """Tell whether a known body leans on it."""
        return self.strength() > TOUCH


class HiddenObstacle(HiddenBody):
    """A fixed one."""

    name = "hidden_obstacle"


class UnseenBody(HiddenBody):
    """A movable one."""

    name = "unseen_body"
