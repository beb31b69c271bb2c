"""Desks, models and layouts that the tests share."""

from __future__ import annotations

import numpy as np

from pbrl_planner.tabletop import (
    Aligned,
    Apart,
    Desk,
    Item,
    LearnedDisplacements,
    Near,
    Objective,
    Table,
    pushes_of,
)

TRAVELS = (0.05, 0.015)
ERASER, REMOTE, SCALE = Item("eraser", 0.13, 0.05), Item("remote", 0.18, 0.05), Item("scale", 0.20, 0.16)
PUNCH = Item("hole_punch", 0.12, 0.08)


def model_of(desk: Desk, travels: tuple[float, ...] = TRAVELS, noise: float = 0.02) -> LearnedDisplacements:
    """A model such as pushes in the simulator give: along by the travel, turns by an arc on a lever."""
    rng, model = np.random.default_rng(5), LearnedDisplacements()
    for item in desk.items:
        for push in pushes_of(travels):
            mean = np.append(push.travel * push.direction, 0.0)
            if push.primitive.endswith("turn"):
                turn = np.arctan2(push.travel, 0.75 * item.length) * (1.0 if push.primitive[0] == "+" else -1.0)
                mean = np.array([-0.08 * push.travel, 0.37 * mean[1], turn])
            for _ in range(5):
                model.update(item.name, push, mean * (1.0 + noise * rng.normal(size=3)) + rng.normal(0.0, 5e-4, 3))
    return model


def three(obstacle: bool = False) -> Desk:
    """The thesis's desk."""
    fixed = ((PUNCH, np.array([0.0, 0.0, np.pi / 2])),) if obstacle else ()
    return Desk(Table.of(0.8, 0.5), (ERASER, REMOTE, SCALE), fixed)


def laid(plates: int, platters: int) -> tuple[Desk, Objective]:
    """A table that is to be laid: plates far from each other, platters straight and in the middle."""
    dishes = tuple(Item(f"plate_{k}", 0.2, 0.2) for k in range(plates))
    trays = tuple(Item(f"platter_{k}", 0.3, 0.18) for k in range(platters))
    desk = Desk(Table.of(1.4, 1.0), dishes + trays)
    names, others = tuple(each.name for each in dishes), tuple(each.name for each in trays)
    terms = [
        Apart(term="apart", items=names, weight=0.1),
        Near(term="near", items=others),
        Aligned(term="aligned", items=others, weight=0.2),
    ]
    return desk, Objective.of(desk, terms)


def layout_of(desk: Desk, rng: np.random.Generator, margin: float = 0.02) -> np.ndarray:
    """A random layout in which nothing overlaps."""
    low, high = np.append(desk.table.low, -np.pi), np.append(desk.table.high, np.pi)
    while True:
        layout = rng.uniform(low, high, (len(desk.items), 3))
        if not desk.fault(layout, margin):
            return layout
