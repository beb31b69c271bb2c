"""What is known of pushes: one of two forward models, how it is taught, and the file that it is kept in."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop.desk import Desk
from pbrl_planner.tabletop.displacement import ForwardModel, LearnedDisplacements
from pbrl_planner.tabletop.lessons import Lessons, LessonSettings, Teaching
from pbrl_planner.tabletop.physics import PhysicsDisplacements
from pbrl_planner.tabletop.primitives import pushes_of

FORWARD_MODELS = ("tables", "physics")
"""The thesis's tables of displacements, or the world model: friction under each item."""
ONCE = LessonSettings(least=1, most=1)
TOLD_BY = 0.05
"""Travel of the pushes that the world model is taught by [m]; it knows then what others do."""


class _Kept(ForwardModel, Protocol):
    """A forward model that can be written down."""

    def as_dict(self) -> Mapping[str, object]:
        """Return it as plain data."""
        ...


class Knowledge:
    """What is known of pushes.

    Args:
        kind: one of `FORWARD_MODELS`.
        travels: of the pushes that are planned with [m].
        effector: radius of the ball that pushes [m].
        file: JSON that it is read from, if it is there, and written to; None: it is not kept.
        seed: of inference.

    Raises:
        PlannerError: there is no such kind, or the file is none of it.
    """

    def __init__(
        self,
        kind: str,
        travels: tuple[float, ...],
        *,
        effector: float = Desk.effector,
        file: Path | None = None,
        seed: int = 0,
    ) -> None:
        if kind not in FORWARD_MODELS:
            raise PlannerError(f"forward model: expected one of {', '.join(FORWARD_MODELS)}, got {kind!r}")
        self._kind, self._travels, self._effector, self._file, self._seed = kind, travels, effector, file, seed
        self._model: _Kept = self._empty() if file is None or not file.exists() else self._read(file)

    @property
    def model(self) -> ForwardModel:
        """What pushes do; it goes on learning."""
        return self._model

    def is_taught(self, desk: Desk) -> bool:
        """Say whether enough is known to plan for the items of a desk."""
        if isinstance(self._model, PhysicsDisplacements):
            return all(self._model.count(name) >= self._model.least for name in desk.names)
        try:
            for item in desk.items:
                self._model.displacements(item, pushes_of(self._travels))
        except PlannerError:
            return False
        return True

    def lessons(self, desk: Desk) -> Teaching:
        """Return the task of learning it: every push several times, or one of each kind for the world model."""
        if self._kind == "physics":
            return Teaching(Lessons(desk, pushes_of((TOLD_BY,)), ONCE))
        return Teaching(Lessons(desk, pushes_of(self._travels)))

    def take_in(self, taught: Teaching) -> None:
        """Know from now on what was seen in lessons, instead of what was known."""
        if self._kind == "tables":
            self._model = taught.lessons.model
        else:
            self._model = physics = self._empty_physics()
            for name, push, moved in taught.seen:
                physics.update(name, push, moved)

    def write(self) -> None:
        """Write it to its file, if it has one.

        Raises:
            PlannerError: that is not possible.
        """
        if self._file is None:
            return
        try:
            self._file.write_text(json.dumps(self._model.as_dict(), indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise PlannerError(f"model: expected to write {self._file}, got {error}") from error

    def _empty_physics(self) -> PhysicsDisplacements:
        return PhysicsDisplacements(self._effector, seed=self._seed)

    def _empty(self) -> _Kept:
        return self._empty_physics() if self._kind == "physics" else LearnedDisplacements()

    def _read(self, file: Path) -> _Kept:
        try:
            data = json.loads(file.read_text(encoding="utf-8"))
            if self._kind == "physics":
                return PhysicsDisplacements.from_dict(data, self._effector, seed=self._seed)
            return LearnedDisplacements.from_dict(data)
        except (OSError, ValueError, AttributeError, TypeError, OverflowError, RecursionError, PlannerError) as error:
            raise PlannerError(
                f"model: expected a JSON file of displacement models ({self._kind}), got {file}: {error}"
            ) from error
