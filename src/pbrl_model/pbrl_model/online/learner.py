"""Learning while it happens: windows come in as they are complete, and the posterior of each object goes on from there.

The first posterior is the batch search's, as soon as there is motion enough. Each further window reweighs the particles
(IBIS, see `inference.smc`). The search is done again, over all that is kept and with the cloud among its starts, when
twice as much has been seen as at the last one, and earlier when new windows are not what the posterior foretold: a mode
that was missed, or data that change the mind, are not lost that way.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import replace

import numpy as np

from pbrl_bag.types import BodyGeometry, Recording
from pbrl_model.errors import ModelError
from pbrl_model.fitting.options import FitOptions
from pbrl_model.online.cloud import Tracked, absorb, search
from pbrl_model.online.memory import Learned, OnlineOptions, adopted, body_of, enough, remembered, target_of
from pbrl_model.online.report import posterior_of
from pbrl_model.online.windows import Piece, cut, holds_of, joined_windows, next_stretch
from pbrl_model.posterior import Posterior
from pbrl_model.sensing.windows import Windows

__all__ = ["Learned", "ObjectLearner", "OnlineLearner", "OnlineOptions", "adopted"]

SEARCH_GROWTH = 2.0
"""The search is done again when there are so many times the windows of the last one."""
SURPRISE = 0.5
"""Nats a recorded number: windows foretold worse than the others by this call for a search."""
COLLAPSE = 0.02
"""So few of the particles left by new windows call for a search."""
SEARCH_REST, SEARCH_REST_SHARE = 2, 0.25
"""Windows between two searches at least, and as a share of those at the last one: surprise that stays is no news."""


class ObjectLearner:
    """Learns about one object.

    Args:
        learned: so far.
        options: of the learning.
        posterior: that goes with what was learned so far.
        done: up to when the recording that comes has been learned from already [s].

    Attributes:
        learned: so far.
        posterior: of it; None before the first.
        reason: why nothing, or not all, is learned; empty where there is none.
    """

    def __init__(
        self, learned: Learned, options: OnlineOptions, posterior: Posterior | None = None, done: float = -math.inf
    ):
        self.learned = learned
        self.options = options
        self.posterior = posterior
        self.reason = ""
        self._done = done
        self._pending: list[Piece] = []

    @property
    def last_used(self) -> float:
        """Return the end of the last data learned from [s], on their clock; 0 before the first."""
        return float(self.learned.motions[-1].time[-1]) if self.learned.motions else 0.0

    @property
    def name(self) -> str:
        """Return the object's name."""
        return self.learned.geometry.name

    def new_clock(self) -> None:
        """Forget up to when the recording was cut: what comes next is on another clock."""
        self._done = -math.inf

    def hear(self, recording: Recording, *, at_the_end: bool = False) -> None:
        """Cut what is complete; a stretch that cannot be read is left out, and `reason` says why."""
        com = body_of(self.learned).com
        fit = self.options.fit
        for hold in holds_of(recording, self.name):
            while stretch := next_stretch(
                recording, self.name, hold, length=fit.window, since=self._done, at_the_end=at_the_end
            ):
                self._done = stretch.last
                try:
                    self._pending.append(
                        cut(recording, self.name, hold, com, stretch, gravity=fit.gravity, delay=self.learned.delay)
                    )
                    self.reason = ""
                except ModelError as error:
                    self.reason = str(error)

    def learn(self) -> bool:
        """Learn from what was cut; tell whether the posterior has changed.

        Raises:
            ModelError: no model of the class explains what was seen.
        """
        if not self._pending:
            return False
        pieces, self._pending = self._pending, []
        rng = np.random.default_rng([self.options.fit.seed, zlib.crc32(self.name.encode()), self.learned.updates])
        before = self.learned
        self.learned = remembered(before, pieces, self.options.most_windows)
        if before.tracked is None:
            if not enough(self.learned):
                return False
            self._search(rng, None)
        else:
            self._go_on(rng, before.tracked, joined_windows([piece.windows for piece in pieces]))
        self._report(rng)
        return True

    def _go_on(self, rng: np.random.Generator, tracked: Tracked, fresh: Windows) -> None:
        """Absorb windows; search again where it is due."""
        windows, seen, searched = self.learned.windows, self.learned.seen, self.learned.searched
        assert windows is not None
        keep = windows.take(np.arange(max(0, len(windows) - len(fresh))))
        rested = seen - searched >= max(SEARCH_REST, SEARCH_REST_SHARE * searched)
        if len(keep) == 0 or (rested and seen >= SEARCH_GROWTH * searched):
            self._search(rng, tracked)
            return
        try:
            found = absorb(rng, tracked, fresh, keep)
        except ModelError:  # no particle allows what came
            self._search(rng, None)
            return
        self.learned = replace(self.learned, tracked=found)
        usual = _level(tracked.windows, tracked.mean_log_likelihood)
        surprised = found.left < COLLAPSE * self.options.particles or _level(fresh, found.foretold) < usual - SURPRISE
        if rested and surprised:
            self._search(rng, found)

    def _search(self, rng: np.random.Generator, known: Tracked | None) -> None:
        """Search everything that is kept, with a cloud among the starts."""
        windows = self.learned.windows
        assert windows is not None
        found = search(
            rng, target_of(self.learned, windows, self.options.fit), self.learned.motions, self.options.particles, known
        )
        self.learned = replace(self.learned, tracked=found, searched=self.learned.seen)

    def _report(self, rng: np.random.Generator) -> None:
        self.learned = replace(self.learned, updates=self.learned.updates + 1)
        tracked = self.learned.tracked
        assert tracked is not None
        model_class = self.options.fit.model_class
        self.posterior = posterior_of(rng, self.name, model_class, tracked, self.learned.motions)


def _level(windows: Windows, value: float) -> float:
    """Return a log density for each recorded number, the noise of the poses put aside [nat]."""
    noise = float(np.sum(windows.seen * np.log(windows.noise)[:, None, :]))
    return (value + noise) / max(windows.observations, 1)


class OnlineLearner:
    """Learns about every object that is held.

    Args:
        options: None: the defaults.
    """

    def __init__(self, options: OnlineOptions | None = None):
        self.options = options or OnlineOptions()
        self.objects: dict[str, ObjectLearner] = {}

    def resume(self, learned: Learned, posterior: Posterior, fit: FitOptions, done: float = -math.inf) -> None:
        """Go on from what is known of an object.

        Args:
            learned: so far.
            posterior: that goes with it.
            fit: options that it was learned with; they hold for this object from now on.
            done: up to when the recording that comes has been learned from already [s].
        """
        options = replace(self.options, fit=fit)
        self.objects[posterior.object] = ObjectLearner(learned, options, posterior, done)

    def posteriors(self) -> dict[str, Posterior]:
        """Return what has been learned, by object."""
        return {name: one.posterior for name, one in self.objects.items() if one.posterior is not None}

    def new_clock(self) -> None:
        """Expect times of another clock: a recording that is played again, a simulator that was started anew."""
        for one in self.objects.values():
            one.new_clock()

    def update(self, recording: Recording, *, at_the_end: bool = False) -> tuple[str, ...]:
        """Take in what has been heard so far; return the names of the objects whose posterior has changed.

        Args:
            recording: the same as at the last call with more at its end; what was used up may be missing.
            at_the_end: nothing more will come for now, so that there is nothing to wait for.
        """
        changed = []
        wanted = self.options.fit.objects
        for name in sorted({grasp.object for grasp in recording.grasps}):
            if name not in recording.bodies or name not in recording.object_poses or (wanted and name not in wanted):
                continue
            one = self._learner(recording, name)
            one.hear(recording, at_the_end=at_the_end)
            try:
                if one.learn():
                    changed.append(name)
            except ModelError as error:
                one.reason = str(error)
        return tuple(changed)

    def _learner(self, recording: Recording, name: str) -> ObjectLearner:
        """Return the learner of an object; one whose body has another shape by now begins anew."""
        body, stream = recording.bodies[name], recording.object_poses[name]
        known = self.objects.get(name)
        if known is not None and _same_body(known.learned.geometry, body):
            return known
        oriented = bool(np.any(np.isfinite(stream.quaternion)))
        self.objects[name] = ObjectLearner(Learned(body, oriented), self.options)
        return self.objects[name]


def _same_body(one: BodyGeometry, other: BodyGeometry) -> bool:
    """Tell whether what was learned of one body is true of the other."""
    masses = np.array([one.nominal_mass, other.nominal_mass])
    return (
        one.footprint.shape == other.footprint.shape
        and np.allclose(one.footprint, other.footprint, atol=1e-6)
        and (np.isnan(masses).all() or bool(np.isclose(*masses)))
    )
