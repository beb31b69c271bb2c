"""What constant friction on a hinge leaves out of two real doors: the catch, its angle, and held-out force."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

from pbrl_bag import Recording
from pbrl_bringup.benches.rows import Row, at_most
from pbrl_mismatch.joint.diagnosis import DoorDiagnosis, diagnose_doors, named_set
from pbrl_mismatch.joint.laws import laws_of
from pbrl_mismatch.joint.pull import Hinge, Pull
from pbrl_mismatch.joint.search import search
from pbrl_mismatch.joint.significance import p_value
from pbrl_mismatch.options import DiagnoseOptions

Array = NDArray[np.float64]

SHARE, NEAR = 0.5, 3.0
"""Held-out error over the baseline's at most; degrees between catch and largest force at most."""
DOORS, QUICK_DOORS, LEVEL = 200, 40, 0.05
"""Simulated doors without a catch, and the level at which they may be called one that has something left out."""


@dataclass(frozen=True)
class Found:
    """Rows and details of one part of the bench."""

    rows: list[Row]
    details: dict[str, Any]
    door: DoorDiagnosis | None = None


def catch_of(label: str, recording: Recording, seed: int, quick: bool) -> Found:
    """Diagnose one real door from constant friction on a hinge.

    Args:
        label: of the door, for the rows.
        recording: of its pull.
        seed: of every random draw.
        quick: leave out the choice of laws from half of the blocks.
    """
    found = next(iter(diagnose_doors(recording, DiagnoseOptions(baseline=("hinge",), seed=seed)).objects.values()))
    blocks, rest = found.blocks, found.rest
    widths = {
        f"blocks_of_{math.degrees(each.width):.2g}_degrees": each.ratio
        for each in sorted((blocks, *found.wider), key=lambda each: each.width)
    }
    rows = [
        _catch_row(label, found),
        at_most(
            f"{label}: held-out force error over that of constant friction, every other degree",
            blocks.ratio if found.effects else 1.0,
            "1",
            SHARE,
            baseline_N=blocks.rmse_before,
            repaired_N=blocks.rmse_after,
            worst_way_of_laying_blocks=blocks.worst_ratio,
            **widths,
        ),
    ]
    if rest is not None:
        what = f"{label}: the same, last 40 % of the angle from the first 60 %"
        rows.append(at_most(what, rest.ratio, "1", SHARE, baseline_N=rest.rmse_before, repaired_N=rest.rmse_after))
    if not quick:
        ratio, chosen = chosen_from_half(found, seed)
        what = f"{label}: every other degree, what is left out chosen from the seen half alone as well"
        rows.append(at_most(what, ratio, "1", SHARE, **chosen))
    return Found(rows, {label: dict(found.report)}, found)


def _catch_row(label: str, found: DoorDiagnosis) -> Row:
    """Return how far the catch is from where the force is largest."""
    peak = math.degrees(float(found.pull.angle[np.argmax(found.pull.force)]))
    catch = next((each for each in found.effects if each.effect == "detent"), None)
    what = f"{label}: catch's angle from where the force peaks"
    if catch is None:
        return at_most(what, math.nan, "deg", NEAR, named=" + ".join(each.effect for each in found.effects))
    entry = catch.parameters["detent_angle"]
    mean, sd = (math.degrees(float(entry[key])) for key in ("mean", "sd"))
    return at_most(
        what,
        abs(mean - peak),
        "deg",
        NEAR,
        catch_deg=mean,
        sd_deg=sd,
        peak_deg=peak,
        probability=catch.probability,
        named=" + ".join(each.effect for each in found.effects),
    )


def chosen_from_half(found: DoorDiagnosis, seed: int) -> tuple[float, dict[str, float | str]]:
    """Return the error over the baseline's where the laws too are chosen from every other block, and which."""
    pull, odd = found.pull, found.blocks.out
    left, names = np.empty(len(pull)), {}
    for half, out in (("odd", odd), ("even", ~odd)):
        weighed = search(np.random.default_rng(seed), pull.take(~out), laws_of())
        best = named_set(weighed) or weighed[0]
        left[out] = pull.force[out] - best.explained.law_force(pull.take(out))
        names[f"chosen_for_{half}"] = " + ".join(best.effects)
    before = pull.force - found.blocks.before
    ratio = float(np.sqrt(np.mean(left**2) / np.mean(before**2)))
    return ratio, {"repaired_N": float(np.sqrt(np.mean(left**2))), **names}


def false_alarms(seed: int, quick: bool) -> Found:
    """Return how often a simulated door with friction, texture and noise, and no catch, is called a mismatch."""
    count = QUICK_DOORS if quick else DOORS
    rng = np.random.default_rng([seed, 9])
    chances = np.array([p_value(rng, rough_door(rng), laws_of(), drawn=99) for _ in range(count)])
    alarms = int(np.sum(chances < LEVEL))
    low = float(beta.ppf(0.025, alarms, count - alarms + 1)) if alarms else 0.0
    high = float(beta.ppf(0.975, alarms + 1, count - alarms))
    what = f"{count} simulated doors without a catch: share called a mismatch at the 5 % level"
    power = np.array([p_value(rng, rough_door(rng, catch=1.0), laws_of(), drawn=99) for _ in range(count // 4)])
    beside = {"low": low, "high": high, "with_a_catch_of_1_N": float(np.mean(power < LEVEL))}
    row = Row(what, alarms / count, "1", "<= 0.05 within its 95 % interval", low <= LEVEL, {**beside})
    return Found([row], {"p_values": chances.tolist()})


def rough_door(rng: np.random.Generator, catch: float = 0.0) -> Pull:
    """Draw a door with constant friction, texture and sensor noise, and a catch of some newtons in a random place."""
    angle = np.radians(np.arange(0.0, 90.0, 0.4))
    count = len(angle)
    strength, length = rng.uniform(0.05, 0.3), np.radians(rng.uniform(1.0, 6.0))
    kept = math.exp(-float(angle[1]) / length)
    texture, state = np.empty(count), strength * rng.standard_normal()
    for n in range(count):
        texture[n] = state
        state = kept * state + strength * math.sqrt(1.0 - kept**2) * rng.standard_normal()
    force = rng.uniform(0.2, 2.0) + texture + rng.uniform(0.02, 0.2) * rng.standard_normal(count)
    place = rng.uniform(2.0, 80.0)
    force += catch * np.exp(-0.5 * (np.degrees(angle) - place) ** 2)
    time: Array = 0.05 * np.arange(count, dtype=np.float64)
    hinge = Hinge(np.zeros(2), 0.35, np.full(3, 0.002), 0.001, 0.0, 1.0)
    speed = np.asarray(0.35 * np.gradient(angle, time), dtype=np.float64)
    zeros = np.zeros(count)
    return Pull("door", hinge, angle, force, zeros, speed, np.ones(count), time, angle, zeros.astype(np.int64))
