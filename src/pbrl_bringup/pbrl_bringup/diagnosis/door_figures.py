"""Figures of a door's diagnosis: force against angle, the door from above, the odds, held-out errors."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pbrl_mismatch.joint.diagnosis import DoorDiagnosis
from pbrl_mismatch.joint.reported import Finding

Array = NDArray[np.float64]

BLUE, ORANGE, GREY, PURPLE = "#0067a8", "#c45500", "#8a9096", "#a3377a"
ROUND = 10.0
"""Degrees to either side of a catch, at least, that are drawn large."""
SHOWN = 6


def force_against_angle(found: DoorDiagnosis) -> Figure:
    """Draw felt force, baseline, repaired model and what each leaves, all of it and large where the catch is."""
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    focus = _focus(found)
    columns = 1 if focus is None else 2
    rows = figure.subplots(
        2, columns, sharex="col", sharey="row", squeeze=False, height_ratios=(2.0, 1.0), width_ratios=(3, 2)[:columns]
    )
    for column in range(columns):
        top, bottom = rows[:, column]
        _forces(top, found)
        _left(bottom, found)
        bottom.set_xlabel("degrees opened" if column == 0 else "the same, large; shaded: blocks held out together")
        for axes in (top, bottom):
            axes.spines[["top", "right"]].set_visible(False)
            _places(axes, found)
    if focus is not None:
        rows[0, 1].set_xlim(*focus)
        for axes in rows[:, 1]:
            _shade(axes, found, focus)
    rows[0, 0].set_ylabel("force along the door's path [N]")
    rows[1, 0].set_ylabel("felt less predicted [N]")
    rows[0, 0].legend(frameon=False, fontsize=9, loc="upper right")
    return figure


def side_by_side(doors: Mapping[str, DoorDiagnosis]) -> Figure:
    """Draw force against angle of several doors beside each other."""
    figure = Figure(figsize=(11.0, 3.8), layout="constrained")
    row = figure.subplots(1, len(doors), sharey=True, squeeze=False)[0]
    for axes, (name, found) in zip(row, doors.items(), strict=True):
        _forces(axes, found)
        _places(axes, found)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_title(f"{name}: {' + '.join(each.effect for each in found.effects)}", fontsize=10)
        axes.set_xlabel("degrees opened")
        axes.legend(frameon=False, fontsize=9, loc="upper right")
    row[0].set_ylabel("force along the door's path [N]")
    return figure


def _forces(axes: Axes, found: DoorDiagnosis) -> None:
    angle = np.degrees(found.pull.angle)
    axes.plot(angle, found.pull.force, ".", color="black", ms=3, label="felt")
    axes.plot(angle, found.baseline.law_force(found.pull), "--", color=ORANGE, lw=1.5, label="constant friction")
    if found.effects:
        axes.plot(angle, found.repaired.law_force(found.pull), color=BLUE, lw=1.5, label="repaired")
        axes.plot(
            angle, found.blocks.after, ".", color=BLUE, ms=2.5, alpha=0.6, label="repaired, block held out of its fit"
        )


def _left(axes: Axes, found: DoorDiagnosis) -> None:
    angle = np.degrees(found.pull.angle)
    axes.plot(angle, found.pull.force - found.blocks.before, color=ORANGE, lw=1.0, alpha=0.8)
    if found.effects:
        axes.plot(angle, found.pull.force - found.blocks.after, color=BLUE, lw=1.0)
    axes.axhline(0.0, color="black", lw=0.6)


def _catch(found: DoorDiagnosis) -> Finding | None:
    return next((each for each in found.effects if each.effect == "detent"), None)


def _focus(found: DoorDiagnosis) -> tuple[float, float] | None:
    """Return what to draw large [degrees], or None where nothing has a place."""
    catch = _catch(found)
    if catch is None or catch.place is None:
        return None
    low, high = np.degrees(catch.place)
    middle, half = 0.5 * (low + high), max(high - low, 0.5 * ROUND)
    return max(middle - half, math.degrees(found.pull.angle.min())), middle + half


def _places(axes: Axes, found: DoorDiagnosis) -> None:
    """Mark the catch's angle with two standard deviations."""
    catch = _catch(found)
    if catch is None:
        return
    entry = catch.parameters["detent_angle"]
    mean, sd = math.degrees(float(entry["mean"])), math.degrees(float(entry["sd"]))
    axes.axvspan(mean - 2.0 * sd, mean + 2.0 * sd, color=PURPLE, alpha=0.25, lw=0)
    axes.axvline(mean, color=PURPLE, lw=1.0, label=f"detent at {mean:.1f} ± {2.0 * max(sd, 0.05):.1f}° (95 %)")


def _shade(axes: Axes, found: DoorDiagnosis, focus: tuple[float, float]) -> None:
    width = math.degrees(found.blocks.width)
    start = math.degrees(found.pull.angle.min())
    for block in range(1, int((focus[1] - start) / width) + 1, 2):
        axes.axvspan(start + block * width, start + (block + 1) * width, color=GREY, alpha=0.15, lw=0, zorder=0)


def from_above(found: DoorDiagnosis) -> Figure:
    """Draw the handle's path, the hinge with its uncertainty, the felt force, and the sector where the catch acts."""
    figure = Figure(figsize=(5.6, 4.4), layout="constrained")
    axes = figure.subplots()
    pull, hinge = found.pull, found.pull.hinge
    place = _on_circle(found, pull.angle, 1.0)
    axes.plot(*place.T, color="black", lw=1.5)
    along = found.pull.hinge.sense * np.column_stack([-(place - hinge.centre)[:, 1], (place - hinge.centre)[:, 0]])
    along /= hinge.radius
    chosen = np.linspace(0, len(pull) - 1, 40).astype(int)
    arrows = axes.quiver(
        *place[chosen].T,
        *(pull.force[chosen, None] * along[chosen]).T,
        color=ORANGE,
        angles="xy",
        scale_units="xy",
        scale=pull.strength / (0.5 * hinge.radius),
        width=0.005,
    )
    axes.quiverkey(arrows, 0.62, 0.05, 5.0, "5 N along the path", labelpos="N")
    x, y = hinge.centre.tolist()
    axes.errorbar(x, y, xerr=2 * hinge.sd[0], yerr=2 * hinge.sd[1], fmt="o", color="black", capsize=3)
    axes.annotate("hinge", (x, y), xytext=(8, 6), textcoords="offset points")
    catch = _catch(found)
    if catch is not None and catch.place is not None:
        arc = _on_circle(found, np.linspace(*catch.place, 20), 1.0)
        axes.fill(*np.vstack([hinge.centre, arc]).T, color=PURPLE, alpha=0.3, lw=0)
        axes.annotate("detent", arc[-1], xytext=(6, 6), textcoords="offset points", color=PURPLE)
    axes.set_aspect("equal", adjustable="datalim")
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    return figure


def _on_circle(found: DoorDiagnosis, angle: Array, share: float) -> Array:
    hinge = found.pull.hinge
    turn = hinge.zero + hinge.sense * angle
    return hinge.centre + share * hinge.radius * np.column_stack([np.cos(turn), np.sin(turn)])


def odds(found: DoorDiagnosis) -> Figure:
    """Draw the likeliest sets of effects, and nothing, by how far they are behind the first."""
    shown = [*found.hypotheses[:SHOWN]]
    shown += [each for each in found.hypotheses[SHOWN:] if not each.effects]
    best = found.hypotheses[0].log_weight
    figure = Figure(figsize=(5.4, 0.9 + 0.36 * len(shown)), layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    names = [" + ".join(each.effects) or "constant friction alone" for each in shown]
    axes.barh(names, [each.probability for each in shown], color=BLUE)
    for row, each in enumerate(shown):
        behind = "" if each.log_weight == best else f", {best - each.log_weight:.0f} nats behind"
        axes.text(each.probability, row, f" {each.probability:.2f}{behind}", va="center", fontsize=8)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.6)
    axes.set_xticks([0.0, 0.5, 1.0])
    axes.tick_params(axis="y", labelsize=8)
    axes.set_xlabel("probability")
    return figure


def held_out(found: DoorDiagnosis) -> Figure:
    """Draw held-out errors by the width of what was left out, and of the rest predicted from the beginning."""
    entries = [
        (f"blocks of {math.degrees(each.width):.2g}°", each)
        for each in sorted((found.blocks, *found.wider), key=lambda each: each.width)
    ]
    entries += [] if found.rest is None else [("rest from first 60 %", found.rest)]
    figure = Figure(figsize=(5.4, 0.9 + 0.42 * len(entries)), layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    row = np.arange(len(entries))
    axes.barh(row - 0.2, [each.rmse_before for _, each in entries], 0.38, color=ORANGE, label="constant friction")
    if found.effects:
        axes.barh(row + 0.2, [each.rmse_after for _, each in entries], 0.38, color=BLUE, label="repaired")
    axes.set_yticks(row, [name for name, _ in entries], fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel("held-out force error, root mean square [N]")
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
