"""One thing, made ready for all openings that it could make: its outline, its worlds, what is worth trying with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation.body import Body
from pbrl_namo.manipulation.policies import Commands
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.stances import Stances
from pbrl_namo.manipulation.worlds import Worlds
from pbrl_namo.scene import NamoScene


@dataclass(frozen=True)
class Study:
    """One thing, made ready for all openings that it could make.

    Attributes:
        body: its outline.
        worlds: it may be in.
        commands: worth trying.
        stances: grasps on all its faces; made when they are first asked for.
    """

    body: Body
    worlds: Worlds
    commands: Commands
    _scene: NamoScene = field(repr=False)
    _name: str
    _settings: ManipulationSettings = field(repr=False)

    @cached_property
    def stances(self) -> Stances:
        """Return grasps on all faces."""
        return Stances.of(self._scene, self._name, self._settings.step_spacing, self._settings.grasping)

    @classmethod
    def of(
        cls,
        scene: NamoScene,
        name: str,
        beliefs: Mapping[str, ObjectBelief],
        rng: np.random.Generator,
        settings: ManipulationSettings,
    ) -> Study:
        """Sample worlds of a thing.

        Raises:
            NamoError: nothing is believed of it, or of another outline.
        """
        if name not in beliefs:
            raise NamoError(f"beliefs: expected one of {name!r}, got {', '.join(beliefs) or 'none'}; see prior_belief")
        footprint = scene.movable[name].footprint
        if not shapely.Polygon(footprint).equals(shapely.Polygon(beliefs[name].footprint)):
            raise NamoError(
                f"belief of {name!r}: expected one of the outline in the scene, got one of another; make it anew"
            )
        worlds = Worlds.sample(beliefs[name], scene.poses[name], rng, settings.worlds, settings.constraints)
        return cls(
            Body.of(footprint, beliefs[name].stops), worlds, Commands.of(worlds, settings), scene, name, settings
        )
