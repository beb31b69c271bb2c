"""The body controller: Jacobians, limits, tick, steering, jitter; object paths and grasps from afar in Bullet."""

from __future__ import annotations

import math
import statistics
from dataclasses import asdict
from pathlib import Path

import numpy as np

from pbrl_bringup.benches.control_grasps import FAULTS, GraspTrial, grasp_trial, provoked_trial
from pbrl_bringup.benches.control_jitter import jitter_rows
from pbrl_bringup.benches.control_laws import (
    heading,
    jacobian_error,
    limit_excess,
    tick_times,
    workspace_margin,
)
from pbrl_bringup.benches.control_paths import PathTrial, free_path, locked_path
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.parallel import in_parallel

POSTURES, PATHS, GRASPS, HOUR = 1000, 20, 40, 3600.0
END, TURN, FORCE = 0.03, math.radians(2.0), 40.0
"""Errors of a path's end [m, rad], force at a grip [N]."""
RATIO = 1.5
"""Of a grip's force to the expected one."""
TICK_RUNS = 5
"""Of the tick, each way in turn: a shared machine's speed is not the same twice."""
WAY = 2.0
"""Of the paths on which steering is measured [m]."""
STEERED = {
    "20 degrees to the left": heading(math.radians(20.0), 0.1),
    "20 degrees to the right": heading(math.radians(-20.0), 0.1),
    "an arc of 2 m radius": (0.1, 0.0, 0.05),
}


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Measure the rows on whole-body control."""
    rng = np.random.default_rng(seed)
    excess = limit_excess(rng, 60.0 if quick else HOUR)
    rows = [
        at_most("Jacobians against finite differences, worst", jacobian_error(rng, POSTURES), "m, rad", 1e-6),
        at_most("limits exceeded in an hour of random commands, most", max(excess.values()), "SI", 0.0, **excess),
        _tick_row(200 if quick else 5000),
        *_steering_rows(),
    ]
    trials: list[PathTrial | GraspTrial] = []
    if not quick:
        rows += jitter_rows(seed, out)
        free = in_parallel(free_path, [(seed, k) for k in range(PATHS)], "paths of a free table")
        locked = in_parallel(locked_path, [(seed, k) for k in range(PATHS)], "paths of a table with a locked caster")
        grasps = in_parallel(grasp_trial, [(seed, k) for k in range(GRASPS)], "grasps from 1.5 m away")
        faults = in_parallel(provoked_trial, [(seed, k) for k in range(len(FAULTS))], "grasps that must fail")
        trials = [*free, *locked, *grasps, *faults]
        rows += [*_free_rows(free), _locked_row(locked), *_grasp_rows(grasps, faults)]
    return Measured(rows, {"limits": excess, "trials": [asdict(trial) for trial in trials]})


def _tick_row(count: int) -> Row:
    """Return the median tick, the median of runs, beside that of the thesis's way in the same runs."""
    methods = ("program", "pseudo-inverse")
    runs = [[1e3 * statistics.median(tick_times(count, method)) for method in methods] for _ in range(TICK_RUNS)]
    ours, thesis = (statistics.median(column) for column in zip(*runs, strict=True))
    each = ", ".join(f"{run[0]:.3f}" for run in runs)
    return at_most("one controller tick, median", ours, "ms", 0.2, runs=each, pseudo_inverse=thesis)


def _steering_rows() -> list[Row]:
    rows = []
    for name, twist in STEERED.items():
        found = {way: workspace_margin(way, twist, WAY) for way in ("predictive", "waypoint", "none")}
        beside = {f"{way}, margin": found[way]["margin"] for way in ("waypoint", "none")}
        what = f"workspace margin over 2 m, {name}"
        rows.append(at_least(what, found["predictive"]["margin"], "m", 0.05, **beside))
        rows.append(at_least(f"share of that way covered, {name}", found["predictive"]["done"], "1", 1.0))
    return rows


def _free_rows(trials: list[PathTrial]) -> list[Row]:
    near = [each.phase == "done" and each.error <= END and each.yaw_error <= TURN for each in trials]
    gentle = [each.force <= FORCE for each in trials]
    worst = {f"{kind}, worst": _worst(trials, kind) for kind in dict.fromkeys(each.kind for each in trials)}
    return [
        at_least("paths of a free table that end within 3 cm and 2 degrees", sum(near), "of 20", 19, **worst),
        at_least("those whose grip force stays under 40 N", sum(gentle), "of 20", 19),
    ]


def _worst(trials: list[PathTrial], kind: str) -> str:
    own = [each for each in trials if each.kind == kind]
    error, turn = max(each.error for each in own), math.degrees(max(each.yaw_error for each in own))
    return f"{100 * error:.1f} cm, {turn:.1f} deg, {max(each.force for each in own):.0f} N"


def _locked_row(trials: list[PathTrial]) -> Row:
    ratios = [each.force / each.expected for each in trials]
    kept = sum(ratio <= RATIO for ratio in ratios)
    return at_least(
        "paths with a locked caster known: grip force within 1.5 of the expected",
        kept,
        "of 20",
        19,
        median_ratio=float(np.nanmedian(ratios)),
        worst_ratio=float(np.nanmax(ratios)),
    )


def _grasp_rows(grasps: list[GraspTrial], faults: list[GraspTrial]) -> list[Row]:
    """Return how many grasps succeed, and how many failures are known as such, drawn and provoked."""
    failed = [each for each in [*grasps, *faults] if not each.success]
    why = {f"{each.kind}, {each.number}": each.status for each in grasps if not each.success}
    unseen = {f"{each.kind}, {each.number}": each.status for each in failed if not each.detected}
    return [
        at_least("grasps of a table from 1.5 m away", sum(each.success for each in grasps), "of 40", 38, **why),
        at_least(
            "failures that were detected and say why",
            sum(each.detected for each in failed),
            f"of {len(failed)}",
            len(failed),
            **unseen,
        ),
    ]
