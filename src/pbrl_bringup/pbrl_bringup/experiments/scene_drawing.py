"""Rooms and bodies seen from above."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from pbrl_model.agents.domain import Scene
from pbrl_model.agents.obstacles import placed

Array = NDArray[np.float64]


def draw_room(axes: Axes, scene: Scene) -> Axes:
    """Draw floor and walls of a scene [m]; return the axes."""
    axes.add_patch(Polygon(scene.outline, closed=True, fc="#fafafa", ec="#444", lw=1.5))
    for wall in scene.walls:
        axes.add_patch(Polygon(wall, closed=True, fc="#777", ec="#444"))
    lower, upper = scene.outline.min(axis=0), scene.outline.max(axis=0)
    axes.set_xlim(lower[0] - 0.1, upper[0] + 0.1)
    axes.set_ylim(lower[1] - 0.1, upper[1] + 0.1)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    return axes


def draw_body(
    axes: Axes, footprint: Array, pose: Array, colour: str, *, filled: bool = False, style: str = "-"
) -> Axes:
    """Draw a footprint (k, 2) at a pose (3,), with a line from its centre to its front; return the axes."""
    corners = placed(footprint, pose)
    axes.add_patch(
        Polygon(
            corners,
            closed=True,
            fc=colour if filled else "none",
            ec=colour,
            lw=1.2,
            ls=style,
            alpha=0.6 if filled else 1.0,
        )
    )
    ahead = placed(np.array([[0.0, 0.0], [float(footprint[:, 0].max()), 0.0]]), pose)
    axes.plot(*ahead.T, color=colour, lw=0.8, ls=style)
    return axes
