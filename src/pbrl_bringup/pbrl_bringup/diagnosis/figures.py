"""Figures of a diagnosis as SVG text: the residual on the floor and over time, the odds, held-out errors."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_bringup.diagnosis.told import acting_legend, acting_times
from pbrl_control.planar import placed
from pbrl_mismatch.data.missing import in_missing
from pbrl_mismatch.data.residual import ResidualWrench
from pbrl_mismatch.data.track import origin_of
from pbrl_mismatch.diagnose import ObjectDiagnosis
from pbrl_mismatch.observability.strengths import rounded

Array = NDArray[np.float64]

EVERY, OUTLINE_EVERY = 0.3, 2.0
"""Between arrows, and between outlines, on the floor [s]."""
SURE = 6.0
"""Standard deviations at which an arrow's colour is full."""
BESIDE = 0.5
"""For so long before and after a missing stretch what is left out is hardly told either [s]."""
SHOWN = 8
BLUE, ORANGE, GREY, PURPLE = "#0067a8", "#c45500", "#8a9096", "#a3377a"


def floor(body: BodyGeometry, found: ObjectDiagnosis) -> str:
    """Draw the way of the object with the left-out force at its centre of mass, and where effects are."""
    figure, axes = _canvas(7.2, 6.0)
    residual = found.residual
    time, frame = residual.time, frames(found)
    for sample in _spaced(time, OUTLINE_EVERY):
        corners = placed(body.footprint, frame[sample])
        axes.fill(*corners.T, facecolor="none", edgecolor=GREY, lw=0.6, alpha=0.6)
    for episode in np.split(np.arange(len(time)), residual.first[1:]):
        axes.plot(*residual.state[episode, :2].T, color="black", lw=1.0)
    _arrows(axes, residual)
    for entry in found.report["effects"]:
        _where(axes, entry, frame[-1])
    axes.set_title(" ")  # room for the arrows' key, of which the layout knows nothing
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    return _svg(figure)


def frames(found: ObjectDiagnosis) -> Array:
    """Return (T, 3) where the object's own frame is along its smoothed path, which is its nominal centre of mass's."""
    com = found.baseline.peak.objective.cuts.track.body[1:3]
    return np.stack([origin_of(state, com) for state in found.residual.path])


def _arrows(axes: Axes, residual: ResidualWrench) -> None:
    """Draw forces, the surer the stronger in colour, with a key of a round number of newtons."""
    at = _spaced(residual.time, EVERY)
    force, sure = residual.world[at, :2], residual.significance[at]
    typical = float(np.quantile(np.hypot(*force.T), 0.95)) or 1.0
    span = float(np.ptp(residual.state[:, :2], axis=0).max()) + 0.5
    arrows = axes.quiver(
        *residual.state[at, :2].T,
        *force.T,
        sure,
        cmap="autumn_r",
        norm=Normalize(0.0, SURE),
        angles="xy",
        scale_units="xy",
        scale=typical / (0.18 * span),
        width=0.004,
        zorder=3,
    )
    round_one = float(f"{typical:.1g}")
    axes.quiverkey(arrows, 0.12, 1.03, round_one, f"{round_one:g} N left out", labelpos="E")
    bar = axes.figure.colorbar(ScalarMappable(Normalize(0.0, SURE), "autumn_r"), ax=axes, shrink=0.6)
    bar.set_label("standard deviations from nothing")


def _where(axes: Axes, entry: Mapping[str, Any], last: Array) -> None:
    """Mark where an effect is: on the floor, or on the object at its last pose (3,)."""
    where = entry.get("where")
    if not where or not where.get("shape"):
        return
    shape = np.array(where["shape"], dtype=float).reshape(-1, 2)
    shape = shape if where["frame"] == "world" else placed(shape, last)
    if len(shape) > 2:
        axes.fill(*shape.T, facecolor=PURPLE, alpha=0.2, edgecolor=PURPLE, lw=1.5, zorder=4)
    else:
        axes.plot(*shape.T, "P", color=PURPLE, ms=10, zorder=4)
    if where.get("uncertainty"):
        around = np.array(where["uncertainty"], dtype=float)
        around = around if where["frame"] == "world" else placed(around, last)
        axes.plot(*np.vstack([around, around[:1]]).T, color=PURPLE, lw=1.0, ls=(0, (4, 3)), zorder=4)
    top = shape[np.argmax(shape[:, 1])]
    axes.annotate(
        entry["effect"], top, xytext=(0, 4), textcoords="offset points", color=PURPLE, fontsize=10, ha="center"
    )


def over_time(found: ObjectDiagnosis) -> str:
    """Draw the left-out wrench over time with two standard deviations, and when effects begin and end."""
    residual = found.residual
    missing = found.baseline.peak.objective.cuts.track.missing
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    rows = figure.subplots(3, 1, sharex=True)
    time = residual.time - residual.time[0]
    spread = 2.0 * np.sqrt(np.einsum("tii->ti", residual.covariance))
    # What is missing is told to within kilonewtons: an axis that shows those shows nothing else.
    known = ~in_missing(residual.time, missing, BESIDE)
    names = ("force to the right [N]", "force away [N]", "turning moment [N m]")
    for k, (axes, name) in enumerate(zip(rows, names, strict=True)):
        axes.spines[["top", "right"]].set_visible(False)
        for part in np.split(np.arange(len(time)), residual.first[1:]):
            low, high = residual.world[part, k] - spread[part, k], residual.world[part, k] + spread[part, k]
            axes.fill_between(time[part], low, high, color=ORANGE, alpha=0.25, lw=0)
            axes.plot(time[part], residual.world[part, k], color=ORANGE, lw=1.2)
        axes.axhline(0.0, color="black", lw=0.6)
        axes.set_ylabel(name, fontsize=8)
        if missing and known.any():
            low, high = (residual.world[known, k] + sign * spread[known, k] for sign in (-1.0, 1.0))
            axes.set_ylim(*(1.05 * np.array([min(low.min(), 0.0), max(high.max(), 0.0)])))
        for start, end in acting_times(found.report):
            axes.axvspan(start - residual.time[0], end - residual.time[0], color=PURPLE, alpha=0.12, lw=0)
        for each in missing:
            start, end = each.start - residual.time[0], each.end - residual.time[0]
            axes.axvspan(start, end, facecolor="white", edgecolor=GREY, hatch="////", lw=0, zorder=2.5)
    legend = acting_legend(found.report)
    shaded = f"; shaded: when {legend}" if legend else ""
    hatched = "; hatched: left out, not to be believed" if missing else ""
    rows[-1].set_xlabel(f"seconds since the first grasp{shaded}{hatched}")
    return _svg(figure)


def odds(found: ObjectDiagnosis) -> str:
    """Draw the probabilities of the likeliest hypotheses."""
    shown = found.hypotheses[:SHOWN][::-1]
    figure, axes = _canvas(4.4, 0.8 + 0.34 * max(len(shown), 1))
    names = [" + ".join(each.effects) or "nothing was left out" for each in shown]
    best = max((each.log_weight for each in shown), default=0.0)
    axes.barh(names, [each.probability for each in shown], color=BLUE)
    for row, each in enumerate(shown):
        behind = "" if each.log_weight == best else f"  {best - each.log_weight:.0f} nats behind"
        axes.text(each.probability, row, f" {each.probability:.3f}{behind}", va="center", fontsize=8)
    axes.set_xlim(0.0, 1.45)
    axes.set_xticks([0.0, 0.5, 1.0])
    axes.set_xlabel("probability", fontsize=9)
    return _svg(figure)


def held_out(found: ObjectDiagnosis) -> str:
    """Draw errors of the baseline and of the repair on what was held out, beside the noise."""
    figure = Figure(figsize=(4.4, 1.9), layout="constrained")
    columns = figure.subplots(1, 2)
    kinds = (("rmse_position_m", "position [mm]", 1000.0), ("rmse_yaw_rad", "heading [degrees]", 180.0 / math.pi))
    for axes, (name, label, factor) in zip(columns, kinds, strict=True):
        axes.spines[["top", "right"]].set_visible(False)
        told = found.report["heldout"][name]
        bars = {"noise": (told["noise_floor"], GREY), "model": (told["baseline"], ORANGE)}
        if found.repaired is not found.baseline:
            bars = {"noise": bars["noise"], "repaired": (told["repaired"], BLUE), "before": bars["model"]}
        known = [math.nan if value is None else factor * value for value, _ in bars.values()]
        axes.barh(list(bars), known, color=[colour for _, colour in bars.values()])
        for row, value in enumerate(known):
            if math.isfinite(value):
                axes.text(value, row, f" {rounded(value)}", va="center", fontsize=8)
        axes.set_xlabel(label, fontsize=9)
        axes.margins(x=0.25)
        axes.locator_params(axis="x", nbins=4)
    return _svg(figure)


def _canvas(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _svg(figure: Figure) -> str:
    """Return a figure as an SVG element; the same figure gives the same text."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _spaced(time: Array, every: float) -> Sequence[int]:
    """Return samples about `every` [s] apart."""
    chosen, last = [], -math.inf
    for sample, moment in enumerate(time.tolist()):
        if abs(moment - last) >= every:
            chosen.append(sample)
            last = moment
    return chosen
