"""LISDD's protocol on the lacking wrench: a form is found on one half of each regime, tested on the other.

Re-implemented after the outline of arXiv 2606.23215, for pushed furniture in the place of buildings: the data are
split into regimes; in each, one half of the samples picks the structure of the correction, the other half tests it
against no correction with an F-test, and Benjamini and Hochberg's procedure (JRSS B 57, 1995) keeps the share of false
regimes at a level. Regimes are bins of time, of floor, of speed and of direction. What the outline leaves open, as the
structures that are offered and the size of the bins, is ours.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from pbrl_bringup.rivals.claim import Claim, Given, heldout_error
from pbrl_bringup.rivals.samples import CELL, SECTORS, SPEEDS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEVEL = 0.05
"""Share of false ones among the regimes that are claimed."""
STRIDE = 2
"""Every so many samples are used: the smoother's wrench remembers itself."""
LEAST = 8
"""Samples of a regime below which it is not tested."""
AT_REST = 0.005
"""Speed at which a direction is half-defined [m/s]."""
FORMS = ("constant in the body", "constant in the world", "along the velocity", "in proportion to the velocity")


def design(form: str, state: Array) -> Array:
    """Return (n, 3, k) what a structure makes of states (n, 6): wrench in the body's axes by coefficient."""
    c, s = np.cos(state[:, 2]), np.sin(state[:, 2])
    u, v = c * state[:, 3] + s * state[:, 4], -s * state[:, 3] + c * state[:, 4]
    w, zero, one = state[:, 5], np.zeros_like(c), np.ones_like(c)
    rows: list[tuple[Array, ...]]
    if form == "constant in the body":
        rows = [(one, zero, zero), (zero, one, zero), (zero, zero, one)]
    elif form == "constant in the world":
        rows = [(c, s, zero), (-s, c, zero), (zero, zero, one)]
    else:
        speed = np.sqrt(u * u + v * v + AT_REST**2) if form == "along the velocity" else one
        turn = np.sqrt(w * w + AT_REST**2) if form == "along the velocity" else one
        rows = [(u / speed, zero), (v / speed, zero), (zero, w / turn)]
    return np.stack([np.stack(row, -1) for row in rows], 1)


@dataclass(frozen=True)
class Tested:
    """One regime after its test.

    Attributes:
        axis: of the regime.
        name: of the regime.
        form: the structure that its first half picked.
        coefficients: (k,) from all of its samples.
        p_value: of the second half.
    """

    axis: str
    name: str
    form: str
    coefficients: Array
    p_value: float


def test_regime(state: Array, wrench: Array, sd: Array) -> tuple[str, Array, float]:
    """Pick a structure on every other sample and test it on the rest.

    Args:
        state: (n, 6) of the regime's samples, in order of time.
        wrench: (n, 3) that is lacking, body's axes.
        sd: (n, 3) its standard deviations.

    Returns:
        Structure, coefficients from all samples, p-value of the second half.
    """
    first, second = np.arange(len(state)) % 2 == 0, np.arange(len(state)) % 2 == 1
    best = min(FORMS, key=lambda form: _regressed(form, state[first], wrench[first], sd[first])[1])
    b = (wrench[second] / sd[second]).ravel()
    a = (design(best, state[second]) / sd[second][..., None]).reshape(len(b), -1)
    solved, _, rank, _ = np.linalg.lstsq(a, b, rcond=None)
    rest = float(np.sum((b - a @ solved) ** 2))
    freedom = len(b) - int(rank)
    gain = float(b @ b) - rest
    # A smoother's wrench is smoother than its errors: what is left never counts less than their variance.
    p_value = float(f_distribution.sf(gain / max(int(rank), 1) / max(rest / freedom, 1.0), int(rank), freedom))
    return best, _regressed(best, state, wrench, sd)[0], p_value


def _regressed(form: str, state: Array, wrench: Array, sd: Array) -> tuple[Array, float]:
    """Return coefficients of a structure, and what it leaves with a price on each (BIC)."""
    b = (wrench / sd).ravel()
    a = (design(form, state) / sd[..., None]).reshape(len(b), -1)
    solved = np.asarray(np.linalg.lstsq(a, b, rcond=None)[0], dtype=np.float64)
    rest = float(np.sum((b - a @ solved) ** 2))
    return solved, len(b) * float(np.log(rest / len(b) + 1e-30)) + a.shape[1] * float(np.log(len(b)))


def discoveries(p_values: Array, level: float = LEVEL) -> Mask:
    """Return (n,) which of n tests are discoveries at a false discovery rate, by Benjamini and Hochberg."""
    count = len(p_values)
    order = np.argsort(p_values, kind="stable")
    below = np.flatnonzero(p_values[order] <= level * np.arange(1, count + 1) / max(count, 1))
    found = np.zeros(count, dtype=bool)
    if len(below):
        found[order[: below[-1] + 1]] = True
    return found


def lisdd(given: Given) -> Claim:
    """Claim regimes, and predict with the corrections of the axis in which they leave least."""
    started = time.process_time()
    tested = []
    for axis, bins in given.regimes.items():
        known = given.samples.moving if axis == "time" else given.open
        for name, inside in bins.items():
            rows = np.flatnonzero(inside & known)[::STRIDE]
            if len(rows) >= LEAST:
                split = test_regime(given.samples.state[rows], given.wrench[rows], given.sd[rows])
                tested.append(Tested(axis, name, *split))
    if not tested:
        note = f"expected a regime of at least {LEAST} samples, got none: nothing is claimed"
        return Claim("LISDD", (), notes=(note,), seconds=time.process_time() - started)
    found = discoveries(np.array([each.p_value for each in tested]))
    kept = [each for each, real in zip(tested, found, strict=True) if real]
    flagged = {axis: tuple(each.name for each in kept if each.axis == axis) for axis in given.regimes}
    late = given.samples.inside([])
    for name in flagged["time"]:
        late |= given.regimes["time"][name]
    edges = _speed_edges(given)
    corrections = {axis: {each.name: each for each in kept if each.axis == axis} for axis in _PLACES}
    best = min(_PLACES, key=lambda axis: _left(given, corrections[axis], axis, edges))
    heldout = heldout_error(given, lambda state: _corrected(state, corrections[best], best, edges))
    spent = time.process_time() - started
    note = "neighbouring samples depend on each other, so that the stated rate of false regimes is too low"
    return Claim("LISDD", given.samples.intervals(late), flagged, heldout, spent, (note,))


_PLACES = ("floor", "speed", "direction")
"""Axes on which a correction can predict what was held out; a bin of time has no other sample."""


def _speed_edges(given: Given) -> Array:
    moving = given.samples.state[given.samples.moving]
    return np.quantile(np.hypot(moving[:, 3], moving[:, 4]), np.linspace(0.0, 1.0, SPEEDS + 1))


def _corrected(state: Array, corrections: Mapping[str, Tested], axis: str, edges: Array) -> Array:
    """Return the wrench (n, 3) of the regimes that states (n, 6) are in.

    A body's centre stands for its feet: the correction of a cell is the mean over the cells around it.
    """
    found, counts = np.zeros((len(state), 3)), np.zeros(len(state))
    if axis == "speed":
        number = np.clip(np.searchsorted(edges, np.hypot(state[:, 3], state[:, 4]), side="right") - 1, 0, SPEEDS - 1)
    else:
        turn = np.arctan2(state[:, 4], state[:, 3]) - state[:, 2]
        number = np.floor((turn % (2.0 * np.pi)) / (2.0 * np.pi) * SECTORS).astype(int) % SECTORS
    for name, each in corrections.items():
        if axis == "floor":
            middle = (np.array([float(part) for part in name.split(",")]) + 0.5) * CELL
            inside = np.hypot(*(state[:, :2] - middle).T) < FOOT_REACH
        else:
            inside = number == int(name)
        if inside.any():
            found[inside] += design(each.form, state[inside]) @ each.coefficients
            counts[inside] += 1.0
    return found / np.maximum(counts, 1.0)[:, None]


FOOT_REACH = 1.0
"""Feet stand at most so far from the middle of a body [m]."""


def _left(given: Given, corrections: Mapping[str, Tested], axis: str, edges: Array) -> float:
    """Return what the corrections of an axis leave of the wrench that may be learned from, in variances."""
    left = given.wrench - _corrected(given.samples.state, corrections, axis, edges)
    return float(np.mean((left[given.open] / given.sd[given.open]) ** 2)) if given.open.any() else float("inf")
