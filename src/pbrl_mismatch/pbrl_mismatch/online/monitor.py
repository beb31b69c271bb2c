"""The watch over every object: models come in, what is heard comes in, alarms come out.

A window is tested against the model that was there before it. A model that is published while everything is foretold
takes the place of the one before if it says something else; while a mismatch is showing, the model stays, for a
learner is already learning from what the mismatch does. Before an alarm the newest model has its say, and draws of the
one in use: if one of them foretells the last windows, it is used from then on (`second_look`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pbrl_bag.types import Recording
from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.online.evidence import Noise
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.online.reading import Reading, readings_of
from pbrl_mismatch.online.second_look import WORTH, Looked, as_adjusted, nearest_draws, replayed, run
from pbrl_mismatch.online.watch import ReadingTest
from pbrl_mismatch.online.windows import Grid, Look, cut_look, looks_due
from pbrl_model.errors import ModelError
from pbrl_model.posterior import Posterior

MEMORY = 12
"""Looks that others are asked about before an alarm."""
HISTORY = 60
"""Windows that draws are held against before they are asked, laid end to end."""
ELSEWHERE = 3.0
"""A model whose mean is further than this many standard deviations from what is used says something else."""
SHARPER = 0.5
"""So does one that knows a parameter to less than this share of what the one in use began with."""


@dataclass(frozen=True)
class Alarm:
    """Where the model of one object and what was heard have parted.

    Attributes:
        object: its name.
        time: end of the data that made it significant [s].
        p_value: chance of so large a statistic within the promised time if the model were right.
        size: times the noise that poses were off along what a left-out wrench would do.
        model_class: of the model that failed.
    """

    object: str
    time: float
    p_value: float
    size: float
    model_class: str

    @property
    def verdict(self) -> str:
        """Return it in a sentence."""
        return (
            f"{self.object}: its {self.model_class} model no longer foretells how it moves, off by {self.size:.1f} "
            f"times the noise (p = {self.p_value:.1g}); diagnosing"
        )


class ObjectWatch:
    """The watch over one object.

    Args:
        name: of the object.
        options: of the watch.

    Attributes:
        reason: why the last windows could not be tested; empty where they could.
        looked: end of the last look [s], minus infinity before the first.
    """

    def __init__(self, name: str, options: MonitorOptions) -> None:
        self.name = name
        self.options = options
        self.reason = ""
        self.looked = -math.inf
        self.tested = 0
        self._newest: Posterior | None = None
        self._used: Posterior | None = None
        self._tests: list[ReadingTest] = []
        self._recent: deque[tuple[Looked, Noise]] = deque(maxlen=MEMORY)
        self._history: deque[Cuts] = deque(maxlen=HISTORY)
        self._quiet_until = -math.inf

    @property
    def evidence(self) -> float:
        """Return the logarithm of the statistic that is compared with the threshold: of the reading that does best."""
        return min((test.highest for test in self._tests), default=-math.inf)

    @property
    def model(self) -> Posterior | None:
        """Return the model in use."""
        return self._used

    def give(self, posterior: Posterior, since: float = -math.inf) -> None:
        """Take the newest model; the first one is tested on what comes after `since` [s]."""
        if self._newest is None:
            self.looked = max(self.looked, since)
        self._newest = posterior

    def new_clock(self) -> None:
        """Expect times of another clock."""
        self.looked, self._quiet_until = -math.inf, -math.inf
        self._recent.clear()
        self._history.clear()
        for test in self._tests:
            test.forget()

    def hear(self, recording: Recording) -> Alarm | None:
        """Test what is complete; return an alarm where the model has failed."""
        alarm = None
        for look in looks_due(recording, self.name, self.looked, self.options):
            self.looked = look.end
            self._adopt()
            if not self._tests:
                continue
            try:
                cuts = cut_look(recording, self.name, look, self.options)
                self.reason = ""
            except (ModelError, MismatchError) as error:
                self.reason = str(error)
                continue
            alarm = self._test(look, cuts) or alarm
        return alarm

    def _test(self, look: Look, cuts: dict[Grid, Cuts]) -> Alarm | None:
        looked = look.end, cuts
        self._recent.append((looked, self._tests[0].noise))
        self._history.extend(window for grid, window in cuts.items() if grid == (max(self.options.windows), 0))
        run(self._tests, looked, counts=look.end > self._quiet_until)
        self.tested += len(cuts)
        if self.evidence < self.options.threshold or self._foretold_otherwise():
            return None
        best = min(self._tests, key=lambda test: test.highest)
        alarm = Alarm(
            self.name,
            look.end,
            float(min(1.0, math.exp(self.options.threshold - self.evidence) * self.options.false_alarm)),
            max(best.size.values()),
            self._used.model_class if self._used else "",
        )
        self._quiet_until = look.end + self.options.rest
        for test in self._tests:
            test.forget()
        return alarm

    def _adopt(self) -> None:
        """Take the newest model where that is due."""
        if self._newest is None or self._newest is self._used:
            return
        if self._tests and (not any(test.calm for test in self._tests) or not self._differs(self._newest)):
            return
        self._use(self._newest)

    def _use(self, posterior: Posterior) -> list[ReadingTest]:
        noise = self._tests[0].noise if self._tests else None
        self._used = posterior
        self._tests = [ReadingTest(each, self.options) for each in readings_of(posterior)]
        for test in self._tests:
            test.noise = noise or test.noise
        return self._tests

    def _differs(self, posterior: Posterior) -> bool:
        """Tell whether a model says something else than the one in use, or the same much more sharply."""
        if self._used is None or posterior.model_class != self._used.model_class:
            return True
        fresh = readings_of(posterior)
        return len(fresh) != len(self._tests) or any(
            _apart(test, reading) for test, reading in zip(self._tests, fresh, strict=True)
        )

    def _foretold_otherwise(self) -> bool:
        """Tell whether another model, or a draw of the one in use, foretells the last looks; it is then used."""
        looks, noise = [looked for looked, _ in self._recent], self._recent[0][1]
        threshold = self.options.threshold

        def tested(readings: list[Reading]) -> list[ReadingTest]:
            tests = replayed(readings, looks, noise, self.options)
            return sorted(tests, key=lambda test: test.highest)

        if tested([as_adjusted(test) for test in self._tests])[0].highest < threshold:
            return False  # what speaks against it goes further back than what is remembered
        newest = self._newest if self._newest is not self._used else None
        if newest is not None and tested(list(readings_of(newest)))[0].highest < threshold:
            self._use(newest)
            return True
        longest = max(self.options.windows)
        last = [window for _, cuts in looks for (length, _), window in cuts.items() if length == longest]
        heard = [*self._history, *last]
        draws = tested([near for test in self._tests for near in nearest_draws(test.reading, heard, self.options)])
        found = [test for test in draws if test.highest < threshold - WORTH]
        if found:
            self._tests = found[: len(self._tests)]
        return bool(found)


class MismatchMonitor:
    """Watches every object of which a model is known.

    Args:
        options: None: the defaults.
    """

    def __init__(self, options: MonitorOptions | None = None) -> None:
        self.options = options or MonitorOptions()
        self.objects: dict[str, ObjectWatch] = {}

    def give(self, posteriors: Mapping[str, Posterior], since: float = -math.inf) -> None:
        """Take models by object, as they are published.

        Args:
            posteriors: the newest.
            since: the first model of an object is tested on what comes after that [s].
        """
        for name, posterior in posteriors.items():
            self.objects.setdefault(name, ObjectWatch(name, self.options)).give(posterior, since)

    def new_clock(self) -> None:
        """Expect times of another clock: a bag that is played again, a simulator that was started anew."""
        for one in self.objects.values():
            one.new_clock()

    def hear(self, recording: Recording) -> tuple[Alarm, ...]:
        """Take in what has been heard so far; return what has become significant since the last call.

        Args:
            recording: the same as at the last call with more at its end; what is older than `needed` may be missing.
        """
        held = {grasp.object for grasp in recording.grasps}
        alarms = []
        for name, one in sorted(self.objects.items()):
            if name in held and name in recording.bodies and name in recording.object_poses:
                alarms.append(one.hear(recording))
        return tuple(alarm for alarm in alarms if alarm is not None)

    @property
    def needed(self) -> float:
        """Return how much of the past must be kept for the next windows [s]."""
        chosen = self.options
        return max(chosen.windows) + chosen.context + chosen.lookahead + 2.0 * chosen.hop + SLACK


SLACK = 4.0
"""Kept beyond that [s]: the smoother's margin, and a stream that is late."""


def _apart(test: ReadingTest, reading: Reading) -> bool:
    off = reading.mean - test.coordinates
    both = test.covariance + reading.covariance
    distance = float(off @ np.linalg.solve(both, off)) / len(off)
    sharper = np.diag(reading.covariance) < SHARPER**2 * np.diag(test.reading.covariance)
    return distance > ELSEWHERE**2 or bool(np.any(sharper))
