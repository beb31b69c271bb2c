"""The sequential test of one model of one object: a Shiryaev-Roberts sum of e-values on every grid of windows.

R grows as R <- (1 + R) e. With E[e] = 1 under the model, R minus the number of windows is a martingale, so that R is
above c somewhere in n windows with a chance of at most n / c (Doob), and it forgets a quiet past by itself: the sum is
that of the likelihood ratios of every moment at which a mismatch may have begun. Shin, Ramdas and Rinaldo,
*E-detectors* (2023); Roberts (1966).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.online.evidence import KEPT, Noise, Window, adjusted, grown, log_e_value, look, no_sharper
from pbrl_mismatch.online.lasting import Lasting
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.online.reading import Reading
from pbrl_mismatch.online.windows import Grid
from pbrl_mismatch.search.objective import Objective

CALM = float(np.log(3.0))
"""A statistic below this (logarithm) is nothing to think of: the windows behind it have been foretold."""


@dataclass
class ReadingTest:
    """The test of one reading of a model; it adjusts its parameters by windows that it has foretold.

    Attributes:
        reading: of the posterior.
        options: of the watch.
        noise: known so far.
        statistic: logarithm of R by grid.
        size: times the noise that the last windows' poses were off along what a wrench would do, by grid.
        coordinates: (K,) of the parameters as adjusted.
        covariance: (K, K) of them.
        lasting: the bet on what lasts.
    """

    reading: Reading
    options: MonitorOptions
    noise: Noise = field(default_factory=Noise)
    statistic: dict[Grid, float] = field(default_factory=dict)
    size: dict[Grid, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.coordinates, self.covariance = self.reading.mean.copy(), self.reading.covariance.copy()
        self.lasting = Lasting(self.reading)
        self._waiting: deque[tuple[float, Cuts]] = deque()

    @property
    def highest(self) -> float:
        """Return the logarithm of the largest statistic."""
        return max((*self.statistic.values(), self.lasting.highest))

    @property
    def calm(self) -> bool:
        """Tell whether the last windows, each for itself, have been foretold."""
        return max(self.statistic.values(), default=-np.inf) <= CALM

    def floor(self, cuts: Cuts) -> float:
        """Return the size of the sensor's own error in a window [N]."""
        first, steps = int(cuts.span[0, 0]), int(cuts.span[0, 1])
        force = float(np.sqrt(np.mean(np.sum(cuts.track.felt[first : first + steps, :2] ** 2, axis=1))))
        return float(np.hypot(self.options.sensor_floor, self.options.sensor_share * force))

    def seen(self, cuts: Cuts) -> Window:
        """Return a window as this reading sees it."""
        objective = Objective(self.reading.hypothesis, cuts, self.floor(cuts))
        return look(objective, self.coordinates, self.covariance)

    def take(self, grid: Grid, cuts: Cuts, end: float, *, counts: bool) -> float:
        """Take in a window.

        Args:
            grid: that it belongs to.
            cuts: the window alone.
            end: of it [s].
            counts: False: adjust only.

        Returns:
            Logarithm of its e-value.
        """
        window = self.seen(cuts)
        value = log_e_value(window, self.noise, self.options.forces)
        self.size[grid] = float(np.sqrt(np.mean(window.explained**2))) if len(window.explained) else 0.0
        if counts:
            self.statistic[grid] = grown(self.statistic.get(grid, -np.inf), value)
        if grid == (max(self.options.windows), 0):
            self._waiting.append((end, cuts))
            self.lasting.take(cuts, self.floor(cuts), self.noise, counts=counts)
            self.noise = self.noise.with_window(window)
        return value

    def settle(self, now: float) -> None:
        """Learn from the windows that lie so far back that no window to come overlaps them.

        Slopes are taken where the windows before have led to, so that hundreds of windows together say what none of
        them does (where along its axle a wheel is that rolls freely): what was not known stays a little so.
        """
        if not self.calm:
            return
        while self._waiting and self._waiting[0][0] <= now - max(self.options.windows) + 1e-6:
            window = self.seen(self._waiting.popleft()[1])
            self.coordinates, covariance = adjusted(window.residual, window.slope, self.coordinates, self.covariance)
            self.covariance = no_sharper(covariance, self.reading.covariance, KEPT)

    def forget(self) -> None:
        """Begin the statistics anew."""
        self.statistic.clear()
        self.lasting = Lasting(self.reading)
        self._waiting.clear()
