"""The figure of what a diagnosis cannot tell: six panels, each a limit and what the recording leaves open."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pbrl_bringup.experiments.figures import save

Array = NDArray[np.float64]

OPEN, TRUTH, GREY, OTHER = "#1f6fb4", "#c0392b", "#7a7a7a", "#e08a00"
SIZE = (12.5, 7.6)


@dataclass(frozen=True)
class Ridge:
    """Two parameters that a recording ties together.

    Attributes:
        columns: their names.
        draws: (n, 2) from the posterior of a fit that is told what was concealed.
        truth: of the two, NaN where it is not known.
        correlation: of the posterior.
        size: standard deviations along the ridge and across it, in the coordinates of the fit.
    """

    columns: tuple[str, str]
    draws: Array
    truth: tuple[float, float]
    correlation: float
    size: tuple[float, float]


@dataclass(frozen=True)
class Friction:
    """Friction coefficients (n,) over speed (n,) [m/s] of two laws, and the speeds (T,) of a push [m/s]."""

    speed: Array
    sticking: Array
    plain: Array
    seen: Array


@dataclass(frozen=True)
class Drawn:
    """Everything that is drawn.

    Attributes:
        place: of a second wheel.
        outline: (k, 2) of its table [m].
        ellipse: (n, 2) as the report has it [m], None where it has none.
        mass: and the force sensor's scale.
        odds: of what was concealed over what it is taken for, log [nat], by what they are.
        lengths: of windows [s].
        scales: of the noise that a told law needs over them, by effect.
        friction: of feet that stick.
    """

    place: Ridge
    outline: Array
    ellipse: Array | None
    mass: Ridge
    odds: dict[str, float]
    lengths: tuple[float, ...]
    scales: dict[str, list[float]]
    friction: Friction


def draw(drawn: Drawn, out: Path) -> Path:
    """Draw the panels into `out`."""
    figure = Figure(figsize=SIZE, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 3).ravel()
    _place(panels[0], drawn)
    _mass(panels[1], drawn.mass)
    _odds(panels[2], drawn.odds)
    _friction(panels[3], drawn.friction)
    _speeds(panels[4], drawn.friction)
    _lengths(panels[5], drawn)
    for letter, axes in zip("abcdef", panels, strict=True):
        title = axes.get_title()
        axes.set_title("")
        axes.set_title(f"{letter}  {title}", loc="left", fontsize=10)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    return save(figure, out)


def _place(axes: Axes, drawn: Drawn) -> None:
    axes.fill(*drawn.outline.T, facecolor="none", edgecolor=GREY, lw=1.2, label="table, from above")
    axes.plot(*drawn.place.draws.T, ".", color=OPEN, ms=3, alpha=0.4, label="where the wheel may be")
    if drawn.ellipse is not None:
        axes.plot(*np.vstack([drawn.ellipse, drawn.ellipse[:1]]).T, color=OPEN, lw=1.0, ls=(0, (4, 3)), label="95 %")
    axes.plot(*drawn.place.truth, "*", color=TRUTH, ms=12, label="where it is")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]", fontsize=9)
    axes.set_ylabel("y [m]", fontsize=9)
    axes.legend(fontsize=7, frameon=False)
    axes.set_title("A second wheel's place")


def _mass(axes: Axes, mass: Ridge) -> None:
    axes.plot(*mass.draws.T, ".", color=OPEN, ms=3, alpha=0.4, label="both may be")
    axes.plot(*mass.truth, "*", color=TRUTH, ms=12, label="what they are")
    axes.set_xlabel("mass [kg]", fontsize=9)
    axes.set_ylabel("force sensor's scale", fontsize=9)
    axes.legend(fontsize=7, frameon=False)
    axes.set_title("A sensor's scale and the mass")


def _odds(axes: Axes, odds: dict[str, float]) -> None:
    names = list(odds)
    axes.barh(range(len(names)), list(odds.values()), color=[OPEN] * len(names))
    axes.axvspan(-3.0, 3.0, color=GREY, alpha=0.2, lw=0)
    axes.axvline(0.0, color="black", lw=0.6)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.set_xscale("symlog", linthresh=10.0)
    axes.set_xlabel("log odds for what it was [nat]; grey: even", fontsize=9)
    axes.set_title("Two names for one motion")


def _friction(axes: Axes, friction: Friction) -> None:
    axes.plot(100.0 * friction.speed, friction.sticking, color=OPEN, label="feet that stick")
    axes.plot(100.0 * friction.speed, friction.plain, color=OTHER, ls="--", label="plain friction")
    axes.set_ylim(0.0)
    axes.set_xlabel("speed [cm/s]", fontsize=9)
    axes.set_ylabel("friction coefficient", fontsize=9)
    axes.legend(fontsize=7, frameon=False)
    axes.set_title("Laws that differ only near rest")


def _speeds(axes: Axes, friction: Friction) -> None:
    axes.hist(100.0 * friction.seen, bins=40, color=GREY)
    axes.axvspan(0.0, 100.0 * friction.speed[_nearly_plain(friction)], color=OPEN, alpha=0.25, lw=0)
    axes.set_xlabel("speed in the same recording [cm/s]", fontsize=9)
    axes.set_ylabel("samples", fontsize=9)
    axes.set_title("The part that tells them apart (blue)")


def _nearly_plain(friction: Friction) -> int:
    """Return the first sample at which both laws are within a tenth of each other."""
    near = np.abs(friction.sticking - friction.plain) < 0.1 * np.maximum(friction.plain, 1e-9)
    return int(np.argmax(near)) if near.any() else len(near) - 1


def _lengths(axes: Axes, drawn: Drawn) -> None:
    told = {"viscous_drag": ("films under the feet", OTHER), "breakaway_friction": ("feet that stick and let go", OPEN)}
    for name, scale in drawn.scales.items():
        label, colour = told[name]
        axes.plot(drawn.lengths, scale, "o-", color=colour, ms=4, label=label)
    axes.axhline(1.0, color="black", lw=0.6)
    axes.set_ylim(0.0)
    axes.set_xlabel("length of what is predicted [s]", fontsize=9)
    axes.set_ylabel("error over the noise", fontsize=9)
    axes.legend(fontsize=7, frameon=False)
    axes.set_title("Told laws, predicting further")
