"""What a window hardly shows and many windows do: an offset of the sensor, its turn, a slope, ballast.

Such a mismatch lasts. So there is a second bet against the model: a few alternatives that have one of these beside the
model's own parameters, each learning from window to window as the model does. The ratio of what they and the model
foretold of a window, both from the windows before, is an e-value again, and the mean of several sums of such is one sum
(`watch`). What a window's own wrench would have to pay for nine times a window, they pay for once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.effects.effect import Parameter, plain
from pbrl_mismatch.online.evidence import KEPT, Array, Noise, adjusted, grown, linearised, no_sharper
from pbrl_mismatch.online.reading import Reading
from pbrl_mismatch.search.objective import Objective

ALTERNATIVES: tuple[tuple[Parameter, ...], ...] = (
    (plain("bias_x", 0.0, 1.0), plain("bias_y", 0.0, 1.0), plain("bias_torque", 0.0, 0.3)),
    (plain("sensor_turn", 0.0, 0.05),),
    (plain("slope_x", 0.0, 0.01), plain("slope_y", 0.0, 0.01)),
    (plain("com_x", 0.0, 0.03), plain("com_y", 0.0, 0.03)),
)
"""What each of them has beside the model's parameters, and how large it is taken to be."""
BESIDE = tuple(parameter for each in ALTERNATIVES for parameter in each)
SAME = 0.05
"""Share of those sizes that is no mismatch: no simulation is exact, and over half an hour it would be noticed."""


@dataclass(frozen=True)
class Belief:
    """A Gaussian over the coordinates, which learns from windows.

    Attributes:
        mean: (K,).
        covariance: (K, K).
        first: (K, K) the covariance that it began with.
    """

    mean: Array
    covariance: Array
    first: Array

    def after(self, residual: Array, slope: Array, at: Array, noise: Noise) -> tuple[float, Belief]:
        """Return the log density that it gave a window (up to what all beliefs share), and what it is after it.

        Args:
            residual: (n,) whitened.
            slope: (n, K) whitened.
            at: (K,) where it was linearised.
            noise: known from windows before.
        """
        off = residual - slope @ (self.mean - at)
        lower = np.linalg.cholesky(np.eye(len(off)) + slope @ self.covariance @ slope.T)
        white = np.linalg.solve(lower, off)
        density = -0.5 * (noise.freedom + len(off)) * np.log(noise.squares + white @ white)
        mean, covariance = adjusted(white, np.linalg.solve(lower, slope), self.mean, self.covariance)
        told = float(density - np.sum(np.log(np.diag(lower))))
        return told, replace(self, mean=mean, covariance=no_sharper(covariance, self.first, KEPT))


class Lasting:
    """The bet on one of the alternatives, against one reading of a model.

    Args:
        reading: of the posterior.

    Attributes:
        statistic: (A,) logarithm of the sum R of each alternative.
    """

    def __init__(self, reading: Reading) -> None:
        known = reading.hypothesis.parameters
        self._hypothesis = replace(reading.hypothesis, parameters=(*known, *BESIDE))
        self._model = self._belief(reading, ())
        self._others = [self._belief(reading, each) for each in ALTERNATIVES]
        self.statistic = np.full(len(ALTERNATIVES), -np.inf)

    def _belief(self, reading: Reading, large: tuple[Parameter, ...]) -> Belief:
        """Return what is believed beforehand, with all that stands beside a model small but some."""
        known = len(reading.mean)
        spread = [each.spread * (1.0 if each in large else SAME) for each in BESIDE]
        covariance = np.diag(np.concatenate([np.zeros(known), spread]) ** 2)
        covariance[:known, :known] = reading.covariance
        return Belief(np.concatenate([reading.mean, np.zeros(len(BESIDE))]), covariance, covariance)

    @property
    def highest(self) -> float:
        """Return the logarithm of the mean of the sums."""
        return float(np.logaddexp.reduce(self.statistic) - np.log(len(self.statistic)))

    def take(self, cuts: Cuts, floor: float, noise: Noise, *, counts: bool) -> None:
        """Take in a window that no window before overlaps.

        Args:
            cuts: the window alone.
            floor: size of the sensor's own error [N].
            noise: known from windows before.
            counts: False: learn only.
        """
        at = self._model.mean
        residual, spread, slope = linearised(Objective(self._hypothesis, cuts, floor), at)
        lower = np.linalg.cholesky(np.eye(len(residual)) + spread @ spread.T)
        residual, slope = np.linalg.solve(lower, residual), np.linalg.solve(lower, slope)
        by_model, self._model = self._model.after(residual, slope, at, noise)
        for k, other in enumerate(self._others):
            by_other, self._others[k] = other.after(residual, slope, at, noise)
            if counts:
                self.statistic[k] = grown(float(self.statistic[k]), by_other - by_model)
