"""Figures of `bench concealed`: who was taken for whom, from what strength on, p-values, errors before and after."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from pbrl_bringup.benches.concealed_rows import STRONG, interval, median
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.scoring import Score

EDGES = (0.0, 0.7, 1.0, 1.5, 2.2, 3.0, 5.0, 10.0, math.inf)
"""Of bins of strength over what an oracle detects."""
NOTICED, NAMED, ORACLE, BEFORE = "#7a7a7a", "#1f6fb4", "#2a9d5c", "#c8553d"


def draw_all(scores: Sequence[Score], out: Path) -> None:
    """Write every figure that the scores have something for into a folder."""
    if not scores:
        return
    shown = [each for each in scores if each.set in ("clean", "single")]
    pages = {"figure.png": confusion(shown) if shown else None, "p_values.png": p_values(scores)}
    for name in dict.fromkeys(each.set for each in scores if each not in shown):
        pages[f"confusion_{name}.png"] = confusion([each for each in scores if each.set == name], name)
    pages |= {"strength.png": strength(scores), "heldout.png": held_out(scores)}
    for name, page in pages.items():
        if page is not None:
            page.savefig(out / name, dpi=110)


def confusion(scores: Sequence[Score], name: str = "") -> Figure:
    """Draw what was concealed against what was named first, of a set that has a name or of those that need none."""
    told = list(dict.fromkeys("+".join(s.effects) or "nothing" for s in scores))
    rows = [*(each for each in DRAWS if each in told), *(each for each in told if each not in DRAWS)]
    columns = [*dict.fromkeys([*DRAWS, *(name for s in scores for name in s.named[:1])]), "unknown", "nothing"]
    counts = np.zeros((len(rows), len(columns)))
    for each in scores:
        said = "nothing" if not each.mismatch else each.named[0] if each.named else "unknown"
        counts[rows.index("+".join(each.effects) or "nothing"), columns.index(said)] += 1
    shares = counts / counts.sum(axis=1, keepdims=True)
    page = Figure(figsize=(2.6 + 0.36 * len(columns), 2.4 + 0.3 * len(rows)), layout="constrained")
    axes = page.subplots()
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for (row, column), count in np.ndenumerate(counts):
        if count:
            colour = "white" if shares[row, column] > 0.5 else "black"
            axes.text(column, row, f"{count:.0f}", ha="center", va="center", fontsize=8, color=colour)
    axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right", fontsize=8)
    axes.set_yticks(range(len(rows)), rows, fontsize=8)
    axes.set_xlabel("named first")
    axes.set_ylabel("concealed")
    of = f"{name}: what" if name else "What"
    axes.set_title(f"{of} was concealed, and what the diagnosis named first ({len(scores)} recordings)", fontsize=10)
    return page


def strength(scores: Sequence[Score]) -> Figure | None:
    """Draw which share of single effects is noticed and named against strength; None where no oracle was asked."""
    known = [each for each in scores if each.set == "single" and not math.isnan(each.times_detectable)]
    if not known:
        return None
    page = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = page.subplots()
    bins = [[s for s in known if low <= s.times_detectable < high] for low, high in itertools.pairwise(EDGES)]
    filled = [k for k, inside in enumerate(bins) if inside]
    for label, colour, shift, told in (
        ("noticed", NOTICED, -0.08, [[s.mismatch for s in bins[k]] for k in filled]),
        ("named first", NAMED, 0.08, [[s.first for s in bins[k]] for k in filled]),
    ):
        _shares(axes, np.arange(len(filled)) + shift, told, label, colour)
    names = [f"{EDGES[k]:g} to {EDGES[k + 1]:g}" if k + 2 < len(EDGES) else f"over {EDGES[k]:g}" for k in filled]
    ticks = [f"{name}\n({len(bins[k])})" for name, k in zip(names, filled, strict=True)]
    axes.set_xticks(range(len(filled)), ticks, fontsize=8)
    for limit in (1.0, STRONG):
        place = sum(EDGES[k] < limit for k in filled) - 0.5
        if 0.0 < place < len(filled) - 0.5:
            axes.axvline(place, color="0.7", linewidth=0.8, linestyle=":")
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel("strength over the least that a told oracle detects in 95 % (recordings)")
    axes.set_ylabel("share of recordings, 95 % interval")
    axes.legend(loc="lower right", frameon=False)
    axes.set_title("From what strength on is an effect noticed, and named?", fontsize=10)
    return page


def _shares(axes: Axes, places: np.ndarray, told: Sequence[Sequence[bool]], label: str, colour: str) -> None:
    middle = np.array([np.mean(each) for each in told])
    ends = np.array([[float(part) for part in interval(sum(each), len(each)).split(" to ")] for each in told])
    around = np.abs(ends.T - middle)
    axes.errorbar(places, middle, yerr=around, fmt="o-", color=colour, label=label, capsize=2.5, linewidth=1.2)


def p_values(scores: Sequence[Score]) -> Figure | None:
    """Draw the p-values of clean recordings, which should be even; None without clean ones."""
    known = [each.p_value for each in scores if each.set == "clean" and not math.isnan(each.p_value)]
    if not known:
        return None
    page = Figure(figsize=(5.4, 3.4), layout="constrained")
    axes = page.subplots()
    bins = np.linspace(0.0, 1.0, 21 if len(known) >= 60 else 11).tolist()
    axes.hist(known, bins=bins, color=NAMED, alpha=0.85, label="clean recordings")
    axes.axhline(len(known) / (len(bins) - 1), color="black", linewidth=1.0, linestyle="--", label="if even")
    axes.axvline(0.05, color=BEFORE, linewidth=1.0, label="alarm below 0.05")
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel("p-value of the baseline")
    axes.set_ylabel("recordings")
    axes.legend(frameon=False, fontsize=8)
    axes.set_title(f"p-values of {len(known)} recordings with nothing concealed", fontsize=10)
    return page


def held_out(scores: Sequence[Score]) -> Figure | None:
    """Draw held-out position errors before and after the repair and of a told oracle, by effect; None without any."""
    hidden = [each for each in scores if each.set == "single" and each.before > 0.0]
    effects = list(dict.fromkeys(each.effects[0] for each in hidden))
    if not effects:
        return None
    page = Figure(figsize=(7.2, 1.6 + 0.27 * len(effects)), layout="constrained")
    axes = page.subplots()
    for label, colour, marker, field in (
        ("baseline", BEFORE, "o", "before"),
        ("repaired", NAMED, "s", "after"),
        ("told oracle", ORACLE, "^", "oracle"),
        ("noise of a pose", "0.5", "|", "floor"),
    ):
        middles = [median([getattr(s, field) for s in hidden if s.effects[0] == name]) for name in effects]
        rows = np.arange(len(effects))
        axes.scatter(1000.0 * np.array(middles), rows, color=colour, marker=marker, s=34, label=label, zorder=3)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_yticks(range(len(effects)), effects, fontsize=8)
    axes.invert_yaxis()
    axes.grid(axis="x", color="0.9")
    axes.set_xlabel("position error over 4 s that were held out, median [mm]")
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.set_title("Does the repaired model predict what was held out?", fontsize=10)
    return page
