"""Figure 2 of the thesis: mean displacement by each push of each item, with intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pbrl_bringup.experiments.figures import canvas, save
from pbrl_bringup.experiments.tabletop_figure import COLOURS
from pbrl_planner.tabletop import PRIMITIVES, LearnedDisplacements, Push

AXES = (("along", 1e3, "mm"), ("across", 1e3, "mm"), ("turned", math.degrees(1.0), "deg"))
TRAVEL = 0.05


def draw(model: LearnedDisplacements, names: Sequence[str], out: Path) -> None:
    """Draw the pushes by 5 cm into `figure.png`: bars are means, whiskers hold the next push with 95 %."""
    figure, panels = canvas(len(AXES), width=12.0, height=3.9)
    wide = 0.8 / len(names)
    for axis, (axes, (title, scale, unit)) in enumerate(zip(panels, AXES, strict=True)):
        for number, name in enumerate(names):
            known = [model.of(name, Push(primitive, TRAVEL)) for primitive in PRIMITIVES]
            mean = scale * np.array([each.mean[axis] for each in known])
            half = scale * np.array(
                [np.ptp(model.interval(name, Push(primitive, TRAVEL))[:, axis]) / 2.0 for primitive in PRIMITIVES]
            )
            at = np.arange(len(PRIMITIVES)) + (number - (len(names) - 1) / 2.0) * wide
            axes.bar(at, mean, wide, color=COLOURS[number], label=name)
            axes.errorbar(at, mean, half, fmt="none", ecolor="#333", elinewidth=1.0, capsize=2.0)
        axes.axhline(0.0, color="#444", lw=0.8)
        axes.set_xticks(range(len(PRIMITIVES)), PRIMITIVES)
        axes.set_title(f"{title} [{unit}]", fontsize=10)
    panels[0].legend(fontsize=8)
    figure.suptitle("What a push by 5 cm does, in the item's frame; whiskers hold the next push with 95 %", fontsize=10)
    save(figure, out)
