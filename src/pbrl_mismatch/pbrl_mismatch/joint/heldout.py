"""Held-out force: every other block of the way is predicted from the blocks between, and the rest from the beginning.

A door is often pulled once. Neighbouring samples are not independent, so whole blocks of the angle are left out, and
what is compared is the laws' prediction alone: the texture, which could carry a felt force into the next block, has no
part in it. Each cell is predicted once, by a fit that did not see its block.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.joint.evidence import SENSOR_FLOOR, TEXTURE_LENGTH, Explained
from pbrl_mismatch.joint.laws import Law
from pbrl_mismatch.joint.pull import LEAST_CELLS, Pull
from pbrl_mismatch.joint.search import baseline_of, extended
from pbrl_mismatch.joint.texture_kernel import whitened

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK = np.radians(1.0)
"""Width of what is held out at a time [rad]: half a catch, so that either half of the blocks has seen its flanks."""
WIDER = tuple(np.radians([0.5, 2.0, 3.0, 5.0]))
"""Other widths, told beside it [rad]."""
OFFSETS = 4
"""Blocks are laid so many ways, each shifted by its share of a width."""
FIRST = 0.6
"""Share of the angle from which the rest is predicted."""


@dataclass(frozen=True)
class HeldOut:
    """Predictions of what was held out.

    Attributes:
        width: of a block [rad]; NaN where the rest was predicted from the beginning.
        out: (n,) whether a cell was held out from the fit that is drawn: odd blocks, or the rest.
        before: (n,) force as the baseline predicts it [N]; NaN where it was not predicted.
        after: (n,) as the repaired model does.
        rmse_before: root mean square errors over all ways of laying blocks [N].
        rmse_after: of the repaired model.
        worst_ratio: largest ratio of the two, over the ways of laying blocks.
        score_before: mean over the ways of the log density of what was held out [nat].
        score_after: of the repaired model.
    """

    width: float
    out: Mask
    before: Array
    after: Array
    rmse_before: float
    rmse_after: float
    worst_ratio: float
    score_before: float
    score_after: float

    @property
    def ratio(self) -> float:
        """Return the error after over that before."""
        return self.rmse_after / self.rmse_before if self.rmse_before > 0.0 else math.nan


def in_blocks(pull: Pull, laws: Sequence[Law], width: float = BLOCK, offsets: int = OFFSETS) -> HeldOut:
    """Predict every block from those between, for baseline and laws, with blocks laid several ways."""
    ways = []
    for shift in range(offsets):
        start = pull.angle.min() - width * shift / offsets
        odd = np.floor((pull.angle - start) / width).astype(np.int64) % 2 == 1
        ways.append((odd, _both_halves(pull, laws, odd)))
    squares = np.array([[np.mean((each[:, k] - pull.force) ** 2) for k in (0, 1)] for _, (each, _) in ways])
    rmse = np.sqrt(squares.mean(axis=0))
    score = np.mean([scores for _, (_, scores) in ways], axis=0)
    odd, (predicted, _) = ways[0]
    worst = float(np.sqrt((squares[:, 1] / squares[:, 0]).max()))
    return _held_out(width, odd, predicted, rmse, worst, score)


def from_beginning(pull: Pull, laws: Sequence[Law], share: float = FIRST) -> HeldOut | None:
    """Predict the last of the angle from its first share, or None where a part is too short to say anything."""
    rest = pull.angle > pull.angle.min() + share * pull.reach
    if min(rest.sum(), (~rest).sum()) < LEAST_CELLS // 2:
        return None
    predicted = np.full((len(pull), 2), np.nan)
    predicted[rest], score = _predicted(pull.take(~rest), pull.take(rest), laws)
    rmse = np.sqrt(np.mean((predicted[rest] - pull.force[rest, None]) ** 2, axis=0))
    ratio = float(rmse[1] / rmse[0]) if rmse[0] > 0.0 else math.nan
    return _held_out(math.nan, rest, predicted, rmse, ratio, score)


def _held_out(width: float, out: Mask, predicted: Array, rmse: Array, worst: float, score: Array) -> HeldOut:
    before, after = predicted.T
    return HeldOut(width, out, before, after, float(rmse[0]), float(rmse[1]), worst, float(score[0]), float(score[1]))


def refit(pull: Pull, laws: Sequence[Law]) -> tuple[Explained, Explained]:
    """Return baseline and laws fitted to a pull from nothing but that pull."""
    base = baseline_of(pull)
    found = base
    for law in laws:
        found = extended(found, law)
    return base, found


def _both_halves(pull: Pull, laws: Sequence[Law], odd: Mask) -> tuple[Array, Array]:
    predicted, score = np.empty((len(pull), 2)), np.zeros(2)
    for out in (odd, ~odd):
        predicted[out], gained = _predicted(pull.take(~out), pull.take(out), laws)
        score += gained
    return predicted, score


def _predicted(seen: Pull, unseen: Pull, laws: Sequence[Law]) -> tuple[Array, Array]:
    """Return (m, 2) forces and (2,) log densities of unseen cells, by baseline and by laws fitted to seen ones."""
    forces, scores = [], []
    for fitted in refit(seen, laws):
        forces.append(fitted.law_force(unseen))
        scores.append(_log_density(unseen, forces[-1], float(fitted.values[-1])))
    return np.column_stack(forces), np.array(scores)


def _log_density(pull: Pull, force: Array, texture: float) -> float:
    """Return the log density of felt forces about predicted ones, with sensor noise and texture [nat]."""
    left = (pull.force - force)[:, None]
    white = np.empty_like(left)
    half = whitened(left, pull.step, SENSOR_FLOOR, texture, TEXTURE_LENGTH, white)
    return float(-0.5 * np.sum(white**2) - half - 0.5 * len(left) * math.log(2.0 * math.pi))


def noise_of(pull: Pull) -> float:
    """Return the noise of one cell's force as neighbours show it [N]: the robust spread of second differences."""
    second = pull.force[2:] - 2.0 * pull.force[1:-1] + pull.force[:-2]
    return float(1.4826 * np.median(np.abs(second)) / math.sqrt(6.0))


def correlation_length(pull: Pull, left: Array) -> float:
    """Return the way over which what is left of the force loses all but 1/e of its correlation [rad], of all holds."""
    holds = [pull.number == number for number in np.unique(pull.number)]
    ways = [float(np.ptp(pull.travelled[rows])) for rows in holds]
    step = sum(ways) / max(len(pull) - len(holds), 1)
    power = np.zeros(len(pull) + 1)
    for rows, way in zip(holds, ways, strict=True):
        even = pull.travelled[rows].min() + np.linspace(0.0, way, round(way / step) + 1 if step > 0.0 else 1)
        values = np.interp(even, pull.travelled[rows], (left - left.mean())[rows])
        power[: len(values)] += np.correlate(values, values, "full")[len(values) - 1 :]
    below = np.flatnonzero(power < power[0] / math.e)
    return step * float(below[0] if len(below) else len(pull))
