"""Watches in a thread what a listener hears, so that callbacks stay alive."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from pbrl_bag.errors import BagError
from pbrl_mismatch.online.diagnosing import DiagnosisWorker, options_for
from pbrl_mismatch.online.found import Findings, Found
from pbrl_mismatch.online.monitor import Alarm, MismatchMonitor
from pbrl_mismatch.online.slices import heard_to_the_end, last_holds
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_model.errors import ModelError
from pbrl_model.online.live import LiveRecording
from pbrl_model.posterior import Posterior
from pbrl_model.ros.listener import RecordingListener

PATIENCE = 1.0
"""Waited for a step to end [s]."""
QUIET = 1.0
"""Nothing heard for so long [s]: what there is for a diagnosis is all there will be."""
LONGEST = 10.0
"""A diagnosis that is asked for begins so long after that in any case [s]: the object may be held on to."""

Changed = Callable[[tuple[Found, ...], float], None]
"""(everything that was found, newest stamp heard [s])."""


class Watcher:
    """Feeds a monitor from a listener, and diagnoses after an alarm.

    Args:
        monitor: with its options.
        listener: whose messages are followed.
        options: of a diagnosis; None: there is none.
        changed: called in the watcher's thread.
        warn: takes a line for a human.
        period: between two looks at what has come [s].
    """

    def __init__(
        self,
        monitor: MismatchMonitor,
        listener: RecordingListener,
        options: DiagnoseOptions | None,
        changed: Changed,
        warn: Callable[[str], None],
        period: float,
    ) -> None:
        self._monitor = monitor
        self._listener = listener
        self._options = options
        self._changed = changed
        self._warn = warn
        self._period = period
        self._live = LiveRecording()
        self._clocks = self._left_out = 0
        self._heard_at = time.monotonic()
        self._findings = Findings()
        self._worker = DiagnosisWorker()
        self._gathering: dict[str, Alarm] = {}
        self._asked: dict[str, tuple[float, float]] = {}
        self._given: dict[str, Posterior] = {}
        self._said: dict[str, str] = {}
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="mismatch watch", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._listener.follow()
        self._thread.start()

    def stop(self) -> None:
        """End; a diagnosis that is under way is given up."""
        self._stop.set()
        self._worker.stop()
        if self._thread.is_alive():
            self._thread.join(PATIENCE)

    def give(self, posteriors: Mapping[str, Posterior]) -> None:
        """Take models as they are published; safe from any thread."""
        with self._lock:
            self._given.update(posteriors)

    @property
    def next_push(self) -> Mapping[str, Any] | None:
        """Return the push that would tell most of what was found apart, in the form of `report.json`."""
        return self._findings.next_push

    def diagnose_again(self, name: str, since: float) -> None:
        """Diagnose an object anew with all that was heard, once it was let go of; safe from any thread.

        Args:
            name: of the object.
            since: a hold that ends after this is waited for, with what comes late of it [s, recording's clock].
        """
        with self._lock:
            self._asked[name] = (since, time.monotonic())

    def _run(self) -> None:
        while not self._stop.wait(self._period):
            try:
                self.step()
            except Exception as error:  # a fault of ours must not end the watch
                self._say("", f"internal error: {type(error).__name__}: {' '.join(str(error).split())}")

    def step(self) -> None:
        """Take in what has come, test, begin diagnoses that are due, and tell what is new."""
        if self._take_messages():
            self._heard_at = time.monotonic()
        with self._lock:
            given, self._given = self._given, {}
        self._monitor.give(given, self._live.now)
        if self._live.held:
            self._watch()
        self._begin_diagnoses()
        done = self._worker.done()
        if done:
            self._findings.add_diagnoses(done)
            self._tell()
        self._live.forget(self._live.now - self._monitor.needed)

    def _take_messages(self) -> bool:
        fresh = self._listener.fresh()
        for message in fresh:
            try:
                self._live.add(message.topic, message.decoded())
            except BagError as error:
                self._say(message.topic, str(error))
        if self._live.clocks != self._clocks:
            self._clocks = self._live.clocks
            self._monitor.new_clock()
            self._gathering.clear()
            self._findings.forget()
            self._worker.forget()
            with self._lock:
                self._asked.clear()
            self._tell()
        if self._live.left_out > 2 * self._left_out:
            self._left_out = self._live.left_out
            self._warn(f"{self._left_out} messages came late or twice so far and were left out")
        return bool(fresh)

    def _watch(self) -> None:
        try:
            alarms = self._monitor.hear(self._live.recording())
        except (BagError, ModelError) as error:
            self._say("recording", str(error))
            return
        self._say("recording", "")
        for name, one in self._monitor.objects.items():
            self._say(name, one.reason)
        if alarms and not self._stop.is_set():
            self._findings.add_alarms(alarms)
            self._tell()
            for alarm in alarms:
                self._warn(alarm.verdict)
                if self._options is not None:
                    self._gathering.setdefault(alarm.object, alarm)  # a later one would put it off

    def _begin_diagnoses(self) -> None:
        """Diagnose where enough was heard since the alarm or of the push that was asked for, or nothing more comes."""
        quiet = time.monotonic() - self._heard_at > QUIET
        wait = self._monitor.options.gather
        due = {name: one for name, one in self._gathering.items() if quiet or self._live.now >= one.time + wait}
        with self._lock:
            over = [name for name, asked in sorted(self._asked.items()) if quiet or self._is_over(name, *asked)]
            for name in over:
                del self._asked[name]
        again = {name: self._findings.alarm_of(name) for name in over}
        due |= {name: alarm for name, alarm in again.items() if alarm is not None}
        for alarm in due.values():
            self._gathering.pop(alarm.object, None)
            assert self._options is not None
            try:
                recording = self._listener.recording(since=alarm.time)
                recording = last_holds(recording, alarm.object, self._monitor.options.keep)
            except BagError as error:
                self._say("diagnosis", str(error))
                continue
            self._worker.start(recording, alarm.object, options_for(self._options, alarm.object, alarm.model_class))

    def _is_over(self, name: str, since: float, at: float) -> bool:
        """Tell whether the push of an object is, that was begun at `since` [s] and asked about at `at` [s, steady]."""
        if time.monotonic() - at > LONGEST:
            return True
        try:
            return heard_to_the_end(self._live.recording(), name, since)
        except BagError:  # said where it is watched
            return False

    def _tell(self) -> None:
        if not self._stop.is_set():
            self._changed(self._findings.entries, max(self._live.now, 0.0))

    def _say(self, about: str, text: str) -> None:
        """Warn, once as long as it stays the same."""
        text = " ".join(text.split())
        if text and text != self._said.get(about) and not self._stop.is_set():
            self._warn(text)
        self._said[about] = text
