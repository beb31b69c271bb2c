"""What a learned model says of one body, in numbers that go by the names that reports use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bullet_sim.catalogue import Body, OnCasters
from bullet_sim.client import GRAVITY
from bullet_sim.concealed.foot_friction import OnGlides

Array = NDArray[np.float64]

TREAD, LEAST_LOAD = 0.7, 5.0
"""Sliding friction of a wheel's tread; least load that bears on one [N]."""


@dataclass(frozen=True)
class Sensor:
    """The force sensor that a model was learned with.

    Attributes:
        gripper: whose it is.
        turn: (3, 3) rotation from its axes to the body's when it first held the body.
    """

    gripper: str
    turn: Array


@dataclass(frozen=True)
class Told:
    """What a model says of one body.

    Attributes:
        name: of the body in the scene.
        body: its settings there.
        values: numbers by name.
        effects: names of all effects of the model.
        sensor: that it was learned with; None: the file does not say.
        began: first moment of the recording that it was learned from, on the clock of its times [s].
    """

    name: str
    body: Body
    values: Mapping[str, float]
    effects: tuple[str, ...]
    sensor: Sensor | None = None
    began: float = 0.0

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def get(self, name: str, default: float = 0.0) -> float:
        """Return a number, or what it is when nothing is said."""
        return self.values.get(name, default)

    def place(self, name: str) -> list[float]:
        """Return a point from two numbers."""
        return [self[f"{name}_x"], self[f"{name}_y"]]

    @property
    def weight(self) -> float:
        """Weight of the body [N]."""
        return self["mass"] * GRAVITY

    @property
    def on_feet(self) -> float:
        """Share of the weight that slides on feet, 0..1: wheels on struts carry the rest."""
        if isinstance(self.body, OnCasters) or "caster_swivel" in self.effects:
            return float(OnGlides.model_fields["load_share"].default)
        wheels = [self.load(key) for key in ("", "2") if f"wheel{key}_x" in self.values]
        return max(1.0 - sum(wheels) / self.weight, 0.2)

    def load(self, key: str) -> float:
        """Return what bears on a wheel [N]: the first, "", or the second, "2"."""
        along, across = frictions(self, key)
        return max(LEAST_LOAD, max(along, across) * self.weight / TREAD)


def frictions(told: Told, key: str) -> tuple[float, float]:
    """Return friction of a wheel along and across its heading; below zero across means the same as along."""
    along = told[f"wheel{key}_mu_x" if key else "mu_x"]
    across = told.get(f"wheel{key}_mu_y" if key else "mu_y", -1.0)
    return along, along if across < 0.0 else across
