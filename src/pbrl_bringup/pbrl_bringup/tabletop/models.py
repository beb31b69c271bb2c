"""Displacement models for experiments: taught once on a simulated desk, handed to trials as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bringup.tabletop.desk_run import DeskRun, random_layout
from pbrl_bringup.tabletop.teaching import Seen, teach
from pbrl_bringup.terminal import progress
from pbrl_control.planar import Array
from pbrl_planner.tabletop import Desk, ForwardModel, LearnedDisplacements, Objective, PhysicsDisplacements, pushes_of
from pbrl_planner.tabletop.descent import descend
from pbrl_planner.tabletop.knowledge import ONCE, TOLD_BY
from tabletop_sim.catalogue import DeskItem
from tabletop_sim.scene import DeskScene, Vision, desk_folder, load_desk

TRAVELS = (0.05, 0.015)
"""Of the ball in a push [m]: the thesis's, and a short one to set things right."""
MARGIN, ORIENTATION = 0.004, 0.4
"""Of the descents that look for the best layout, as `TabletopSettings` has them [m], [m/rad]."""


@dataclass(frozen=True)
class Taught:
    """A forward model as plain data.

    Attributes:
        forward: which, of `FORWARD_MODELS`.
        data: as its `as_dict` gives it.
        pushes: that taught it.
    """

    forward: str
    data: Mapping[str, Any]
    pushes: int

    def model(self, effector: float, seed: int) -> ForwardModel:
        """Return the model, for a ball of a radius [m]."""
        if self.forward == "physics":
            return PhysicsDisplacements.from_dict(self.data, effector, seed=seed)
        return LearnedDisplacements.from_dict(self.data)


def desk_scene(name: str, vision: Vision) -> DeskScene:
    """Return a desk of the workspace whose items are seen in pictures or with noise."""
    scene = load_desk(name)
    return scene.model_copy(update={"vision": scene.vision.model_copy(update={"source": vision})})


def objective_file(name: str) -> Path:
    """Return where an objective of the workspace is."""
    return desk_folder().parent / "objectives" / f"{name}.yaml"


def taught(scene: DeskScene, seed: int, forward: str = "tables") -> Taught:
    """Teach the items of a desk, one of each kind: what is learned of one plate holds for all.

    Args:
        scene: the desk.
        seed: of the simulator.
        forward: which forward model; the world model is taught one push of each primitive.
    """
    first = {_make(item): name for name, item in reversed(list(scene.items.items())) if not item.obstacle}
    alone = scene.model_copy(update={"items": {name: scene.items[name] for name in first.values()}})
    physics = forward == "physics"
    with DeskRun(alone, seed=seed) as run, progress("pushes that teach") as bar:
        model, seen = teach(run, pushes_of((TOLD_BY,) if physics else TRAVELS), ONCE if physics else None, told=bar)
        told: Mapping[str, Any] = _observed(seen, run.desk.effector, seed) if physics else model.as_dict()
    whole = {name: told[first[_make(item)]] for name, item in scene.items.items() if not item.obstacle}
    return Taught(forward, whole, len(seen))


def _observed(seen: Sequence[Seen], effector: float, seed: int) -> Mapping[str, Any]:
    """Return what was seen as the world model keeps it."""
    physics = PhysicsDisplacements(effector, seed=seed)
    for name, push, moved in seen:
        physics.update(name, push, moved)
    return physics.as_dict()


def best_known(objective: Objective, layouts: Sequence[Array]) -> tuple[Array, float]:
    """Return the best layout that descents from many layouts (n, 3) find, and its cost."""
    found = [descend(objective, layout, MARGIN, ORIENTATION) for layout in layouts]
    return min(found, key=lambda pair: pair[1])


def random_layouts(desk: Desk, seed: int, count: int) -> list[Array]:
    """Draw layouts, each from a generator of its own."""
    return [random_layout(desk, np.random.default_rng([seed, number])) for number in range(count)]


def _make(item: DeskItem) -> tuple[object, ...]:
    """Return what makes two items the same but for where they lie."""
    return tuple(value for name, value in item.model_dump().items() if name != "pose")
