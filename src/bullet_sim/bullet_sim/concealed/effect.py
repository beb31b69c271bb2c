"""What every concealed effect has: a name, a step, and a truth about whether it acts."""

from __future__ import annotations

from abc import ABC, abstractmethod


class Effect(ABC):
    """One thing that is true and not told.

    Attributes:
        name: of the effect, as in a scene's `concealed` part.
        unit: of `strength`.
        target: body, gripper or number of what it is about.
    """

    name: str
    unit: str = "N"

    def __init__(self, target: str) -> None:
        """Take note of what it is about."""
        self.target = target

    @property
    def key(self) -> str:
        """Name and target, as `tether.table_a`."""
        return f"{self.name}.{self.target}"

    def update(self, time: float) -> None:  # noqa: B027 - most effects act by being there
        """Act on the next physics step, which begins at `time` [s]."""

    @abstractmethod
    def strength(self) -> float:
        """Give how hard it acts now, in `unit`."""

    def acting(self) -> bool:
        """Tell whether it makes a difference now."""
        return self.strength() > 0
