"""Learns in a thread from what a listener hears, so that callbacks stay alive."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from pbrl_bag.errors import BagError
from pbrl_model.errors import ModelError
from pbrl_model.online.learner import ObjectLearner, OnlineLearner
from pbrl_model.online.live import LiveRecording
from pbrl_model.online.state import Stored, save
from pbrl_model.online.windows import CONTEXT, SILENCE
from pbrl_model.posterior import Posterior
from pbrl_model.ros.listener import RecordingListener
from pbrl_model.sensing.motion import MARGIN

QUIET = 2.0
"""Nothing heard for so long [s]: the data have come to their end, and what is there is all there is."""
PATIENCE = 0.5
"""Waited for a step to end [s], at most; what it would have learned is lost, what was learned before is on disk."""

Changed = Callable[[Mapping[str, Posterior], float], None]
"""(posteriors that have changed, by object; end of the last data used [s])."""


class OnlineWorker:
    """Feeds a learner from a listener.

    Args:
        learner: with what is known already.
        listener: whose messages are followed.
        folder: where states are kept; None: nowhere.
        changed: called in the worker's thread.
        warn: takes a line for a human.
        period: between two looks at what has come [s].
    """

    def __init__(
        self,
        learner: OnlineLearner,
        listener: RecordingListener,
        folder: Path | None,
        changed: Changed,
        warn: Callable[[str], None],
        period: float,
    ):
        self._learner = learner
        self._listener = listener
        self._folder = folder
        self._changed = changed
        self._warn = warn
        self._period = period
        self._live = LiveRecording()
        self._clocks = 0
        self._heard_at = time.monotonic()
        self._ended = True
        self._said: dict[str, str] = {}
        self._given: list[tuple[Stored, bool]] = []
        self._stop = threading.Event()
        self._busy = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="online learning", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._listener.follow()
        self._thread.start()

    def stop(self) -> None:
        """End; a step that takes long is left behind."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(PATIENCE)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Begin no step within the block; one that has begun ends first."""
        with self._busy:
            yield

    def give(self, stored: Stored, *, heard: bool) -> None:
        """Go on from something else; for use while paused.

        Args:
            stored: of one object.
            heard: whether it was learned from what this worker hears, too: that is then not learned from twice.
        """
        self._given.append((stored, heard))

    def _run(self) -> None:
        while not self._stop.wait(self._period):
            with self._busy:
                self._take_given()
                try:
                    self.step()
                except Exception as error:  # a fault of ours must not end the learning, nor what is published
                    self._say("", f"internal error: {type(error).__name__}: {' '.join(str(error).split())}")

    def step(self) -> None:
        """Take in what has come, learn, keep and tell."""
        fresh = self._listener.fresh()
        for message in fresh:
            try:
                self._live.add(message.topic, message.decoded())
            except BagError as error:
                self._say(message.topic, str(error))
        if fresh:
            self._heard_at, self._ended = time.monotonic(), False
        elif self._ended or time.monotonic() - self._heard_at < QUIET:
            return
        else:
            self._ended = True
        if self._live.clocks != self._clocks:
            self._clocks = self._live.clocks
            self._learner.new_clock()
        if self._live.held:
            self._learn()
        self._live.forget(self._live.now - self._span)

    @property
    def _span(self) -> float:
        """Return what must be kept to cut the next windows [s]."""
        return (CONTEXT + 2) * self._learner.options.fit.window + 2.0 * MARGIN + SILENCE

    def _learn(self) -> None:
        try:
            recording = self._live.recording()
            names = self._learner.update(recording, at_the_end=self._ended)
        except (BagError, ModelError) as error:
            self._say("recording", str(error))
            return
        for name, one in self._learner.objects.items():
            self._say(name, one.reason)
        changed = {name: self._learner.objects[name] for name in names}
        for one in changed.values():
            self._keep(one)
        if changed and not self._stop.is_set():
            posteriors = {name: one.posterior for name, one in changed.items() if one.posterior is not None}
            self._changed(posteriors, max(one.last_used for one in changed.values()))

    def _keep(self, one: ObjectLearner) -> None:
        if self._folder is not None and one.posterior is not None:
            try:
                save(self._folder, Stored(one.learned, one.posterior, one.options.fit))
            except ModelError as error:
                self._say("state", str(error))

    def _take_given(self) -> None:
        for stored, heard in self._given:
            motions = stored.learned.motions
            done = float(motions[-1].time[-1]) if heard and motions else float("-inf")
            self._learner.resume(stored.learned, stored.posterior, stored.fit, done)
        self._given.clear()

    def _say(self, about: str, text: str) -> None:
        """Warn, once as long as it stays the same."""
        text = " ".join(text.split())
        if text and text != self._said.get(about) and not self._stop.is_set():
            self._warn(text)
        self._said[about] = text
