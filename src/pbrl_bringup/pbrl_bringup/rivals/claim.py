"""What every rival is given and what it gives back: where the baseline is wrong, and a better prediction.

A rival gets what the diagnosis gets, by the same library: the recording laid out as a track, the fitted baseline, and
the wrench that the baseline lacks. It may learn from all but the blocks that are held out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.rivals.samples import Interval, Regimes, Samples, regimes_of, take_samples
from pbrl_mismatch.data.cuts import Cuts, cut_windows, held_out_blocks, inside, touching
from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted
from pbrl_mismatch.search.heldout import errors
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective

Array = NDArray[np.float64]
WrenchOf = Callable[[Array], Array]
"""From states (n, 6) in `world` to the wrench (n, 3) that is lacking, in the body's axes."""

KNOT = 0.1
"""Between knots of a wrench that is added to a simulation [s]."""
ROUNDS = 4
"""Of: simulate, ask for the wrench along the way that came out."""


@dataclass(frozen=True)
class Given:
    """What a rival works on.

    Attributes:
        track: the recording.
        hypothesis: the best of the baselines.
        coordinates: (1, K) its fit without what is held out.
        floor: size of the wrist sensor's own error in motion [N].
        heldout: windows that are not to be learned from, or None where there is nothing to spare.
        residual: wrench that the baseline lacks.
        samples: n of them.
        regimes: that the samples fall into.
        open: (n,) samples that may be learned from: moving, in no held-out block.
    """

    track: Track
    hypothesis: Hypothesis
    coordinates: Array
    floor: float
    heldout: Cuts | None
    residual: ResidualWrench
    samples: Samples
    regimes: Regimes
    open: NDArray[np.bool_]

    @property
    def row(self) -> Array:
        """Return (WIDTH,) the baseline's parameter row."""
        return self.hypothesis.rows(self.coordinates)[0]

    @property
    def wrench(self) -> Array:
        """Return (n, 3) the lacking wrench at the samples, body's axes [N, N, N m]."""
        return self.residual.body[self.samples.step]

    @property
    def sd(self) -> Array:
        """Return (n, 3) its standard deviations."""
        variance = np.diagonal(self.residual.body_covariance[self.samples.step], axis1=1, axis2=2)
        return np.sqrt(np.maximum(variance, 1e-12))


@dataclass(frozen=True)
class Claim:
    """What a rival says; none of them names a cause.

    Attributes:
        rival: its name.
        when: intervals in which the baseline is wrong [s].
        regimes: names of the regimes in which it is wrong, by axis; axes that are missing follow from `when`.
        heldout: position error of its forecasts of what was held out [m]; NaN where nothing could be.
        seconds: of CPU, beside the baseline's fit, which all share.
        notes: what must not be read into it.
    """

    rival: str
    when: tuple[Interval, ...]
    regimes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    heldout: float = float("nan")
    seconds: float = 0.0
    notes: tuple[str, ...] = ()


Rival = Callable[[Given], Claim]


def give(fitted: Fitted, options: DiagnoseOptions) -> Given:
    """Lay out what rivals work on: the track and the baseline of a diagnosis, which are theirs as well.

    Args:
        fitted: the best of the baselines, as a diagnosis finds it.
        options: of that diagnosis.
    """
    track = fitted.peak.objective.cuts.track
    kept, heldout = _split(track, options)
    coordinates = _refitted(fitted, kept, options)
    samples = take_samples(track)
    free = samples.moving.copy()
    if heldout is not None:
        free &= ~samples.inside(held_out_blocks(track, options.block, options.every))
    residual = residual_wrench(track, fitted.hypothesis.rows(coordinates)[0])
    return Given(
        track,
        fitted.hypothesis,
        coordinates,
        options.sensor_floor,
        heldout,
        residual,
        samples,
        regimes_of(samples),
        free,
    )


def _split(track: Track, options: DiagnoseOptions) -> tuple[Cuts, Cuts | None]:
    """Return windows to fit to, and those that are held out, as a diagnosis cuts them."""
    blocks = held_out_blocks(track, options.block, options.every)
    fitted, longest = cut_windows(track, options.windows[-1]), cut_windows(track, options.block)
    out, touched = inside(longest, blocks), touching(fitted, blocks)
    if not out.any() or touched.all():
        return fitted, None
    return fitted.take(~touched), longest.take(out)


def _refitted(fitted: Fitted, kept: Cuts, options: DiagnoseOptions) -> Array:
    """Return (1, K) coordinates of a baseline fitted to some windows alone."""
    objective = Objective(fitted.hypothesis, kept, options.sensor_floor)
    peak = climb(objective, fitted.peak.coordinates[:1], iterations=options.iterations[-1])
    return peak.coordinates[peak.best : peak.best + 1]


def heldout_error(given: Given, wrench_of: WrenchOf) -> float:
    """Return the position error [m] of forecasts by the baseline with a wrench added, over what was held out.

    Forecasts begin as a diagnosis's do (`search.heldout.Score`). The wrench is asked for along the simulated way, which
    depends on it: simulate, ask, simulate. Of these rounds the best in each window counts, which flatters a rival.

    Args:
        given: what a rival works on.
        wrench_of: the rival's prediction.
    """
    cuts = given.heldout
    if cuts is None:
        return float("nan")
    limit = 2.0 * np.abs(given.residual.body).max(axis=0) + 1e-9
    added = np.clip(wrench_of(_window_states(given)), -limit, limit).reshape(len(cuts), -1, 3)
    best = np.full(len(cuts), np.inf)
    kept = np.zeros((1, len(cuts), cuts.weight[0].size))
    for _ in range(ROUNDS):
        found = poses(given.row[None], cuts, cuts.told[None], added[None])
        off = cuts.pose - found[0]
        off[..., 2] -= 2.0 * np.pi * np.round(off[..., 2] / (2.0 * np.pi))
        residual = np.clip(np.nan_to_num(off * cuts.weight, nan=1e6), -1e6, 1e6).reshape(len(cuts), -1)
        misfit = np.sum(residual**2, axis=1)
        better = misfit < best
        kept[0, better], best[better] = residual[better], misfit[better]
        added = np.clip(wrench_of(_simulated_states(given, found[0])), -limit, limit).reshape(len(cuts), -1, 3)
    return errors(kept, cuts)[0]


def _knots(given: Given) -> int:
    cuts = given.heldout
    longest = int(cuts.span[:, 1].max()) if cuts is not None else 0
    return max(2, round(longest * given.track.dt / KNOT) + 1)


def _window_states(given: Given) -> Array:
    """Return (W K, 6) smoothed states at the knots of the held-out windows, to begin with."""
    cuts = given.heldout
    assert cuts is not None
    share = np.linspace(0.0, 1.0, _knots(given))
    step = cuts.span[:, :1] + np.round(share * cuts.span[:, 1:2]).astype(np.int64)
    return given.track.seen[np.minimum(step, cuts.span[:, 3:4])].reshape(-1, 6)


def _simulated_states(given: Given, found: Array) -> Array:
    """Return (W K, 6) states at the knots of simulated poses (W, N, 3) of the body's frame."""
    cuts, track = given.heldout, given.track
    assert cuts is not None
    knots = np.linspace(0.0, 1.0, _knots(given))
    states = np.empty((len(cuts), len(knots), 6))
    for w in range(len(cuts)):
        known = cuts.place[w] < cuts.span[w, 1]
        time = cuts.place[w][known] * track.dt
        x, y, theta = np.nan_to_num(found[w][known]).T
        c, s = np.cos(theta), np.sin(theta)
        com = np.stack([x + c * track.body[1] - s * track.body[2], y + s * track.body[1] + c * track.body[2], theta], 1)
        rate = np.gradient(com, time, axis=0)
        at = knots * cuts.span[w, 1] * track.dt
        for k in range(3):
            states[w, :, k], states[w, :, 3 + k] = np.interp(at, time, com[:, k]), np.interp(at, time, rate[:, k])
    return states.reshape(-1, 6)
