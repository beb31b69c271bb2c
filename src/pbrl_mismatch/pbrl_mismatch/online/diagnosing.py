"""Diagnoses in a process of its own, so that what is heard meanwhile is heard, and Ctrl-C ends the watch at once."""

from __future__ import annotations

import math
import pickle
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.types import Recording
from pbrl_mismatch.data.residual import ResidualWrench
from pbrl_mismatch.diagnose import diagnose
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.unknown.describe import SURE
from pbrl_model.errors import ModelError

BASELINES: Mapping[str, tuple[str, ...]] = {
    "free": ("free",),
    "wheel": ("free", "caster", "wheel"),
    "wheel+ground": ("free", "caster", "wheel", "ground", "wheel+ground"),
    "hinge": ("hinge",),
}
"""What is no mismatch, by the class of the model that failed."""
CHILD = "from pbrl_mismatch.online.diagnosing import main; main()"
"""Not with `-m`: what it pickles would be of a module `__main__`."""
PATIENCE = 2.0
"""Waited for a process that was told to end [s]."""
EVERY = 0.3
"""Between two forces that are told [s]."""
Job = tuple[Recording, str, DiagnoseOptions]
"""(recording, object, options)"""


@dataclass(frozen=True)
class Diagnosed:
    """What a diagnosis of one object said.

    Attributes:
        object: its name.
        report: this object's part of `report.json`; empty where the diagnosis failed.
        verdict: in a sentence, or why there is none.
        notes: what must not be read into it.
        next_push: in the form of `report.json`'s `next_experiment`, or None where there is nothing to tell apart.
        forces: (x, y, fx, fy) [m, N] in world where the model surely lacks a force, in order of time.
    """

    object: str
    report: Mapping[str, Any]
    verdict: str
    notes: tuple[str, ...] = ()
    next_push: Mapping[str, Any] | None = None
    forces: tuple[tuple[float, float, float, float], ...] = ()


def options_for(options: DiagnoseOptions, name: str, model_class: str) -> DiagnoseOptions:
    """Return the options with which one object is diagnosed, the model's class the baseline."""
    return options.model_copy(update={"objects": (name,), "baseline": BASELINES[model_class]})


def diagnose_object(recording: Recording, name: str, options: DiagnoseOptions) -> Diagnosed:
    """Diagnose one object; what goes wrong is the verdict."""
    try:
        found = diagnose(recording, options).objects[name]
    except (BagError, ModelError, MismatchError) as error:
        return Diagnosed(name, {}, f"{name}: not diagnosed: {' '.join(str(error).split())}")
    push = None if found.next_push is None else found.next_push.to_report()
    return Diagnosed(name, dict(found.report), found.notes[0], tuple(found.notes[1:]), push, _forces(found.residual))


def _forces(residual: ResidualWrench) -> tuple[tuple[float, float, float, float], ...]:
    """Return places and forces at the moments, `EVERY` apart, at which a left-out wrench is told from none."""
    told, last = [], -math.inf
    for row in np.flatnonzero(residual.significance > SURE).tolist():
        if abs(float(residual.time[row]) - last) >= EVERY:
            last = float(residual.time[row])
            (x, y), (fx, fy) = residual.state[row, :2].tolist(), residual.world[row, :2].tolist()
            told.append((x, y, fx, fy))
    return tuple(told)


class DiagnosisWorker:
    """Diagnoses one recording after the other in a process of its own."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: deque[Job] = deque()
        self._under_way: Job | None = None
        self._done: list[Diagnosed] = []
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._stopped = False

    def start(self, recording: Recording, name: str, options: DiagnoseOptions) -> None:
        """Diagnose an object of a recording as soon as the ones before are done; a newer one of it takes its place."""
        with self._lock:
            self._waiting = deque(job for job in self._waiting if job[1] != name)
            self._waiting.append((recording, name, options))
            if self._thread is None and not self._stopped:
                thread = threading.Thread(target=self._run, name="diagnosis", daemon=True)
                thread.start()
                self._thread = thread

    @property
    def busy(self) -> bool:
        """Tell whether a diagnosis is under way or waits."""
        with self._lock:
            return self._thread is not None

    def wait(self, seconds: float) -> bool:
        """Wait until nothing is under way, at most so long [s]; tell whether that is so."""
        with self._lock:
            thread = self._thread
        if thread is not None:
            thread.join(seconds)
        return not self.busy

    def done(self) -> list[Diagnosed]:
        """Return what has been found since the last call."""
        with self._lock:
            found, self._done = self._done, []
            return found

    def forget(self) -> None:
        """Give up what waits and what is under way; nothing that was found and not fetched yet is told any more."""
        with self._lock:
            self._waiting.clear()
            self._done.clear()
            self._under_way = None
            if self._process is not None:
                self._process.terminate()

    def stop(self) -> None:
        """End, without waiting for a diagnosis that is under way."""
        with self._lock:
            self._stopped = True
            thread = self._thread
        self.forget()
        if thread is not None:
            thread.join(PATIENCE)

    def _run(self) -> None:
        while True:
            with self._lock:
                if self._stopped or not self._waiting:
                    self._thread = None
                    return
                job = self._under_way = self._waiting.popleft()
            try:
                found = self._answer(job)
            except Exception as error:  # one job that cannot be done must not keep the others waiting for ever
                told = " ".join(str(error).split()) or type(error).__name__
                found = Diagnosed(job[1], {}, f"{job[1]}: not diagnosed: {told}")
            with self._lock:
                self._process = None
                if found is not None and self._under_way is job:
                    self._done.append(found)
                self._under_way = None

    def _answer(self, job: Job) -> Diagnosed | None:
        """Hand a job to a process of its own and return what it says, None where it was given up before."""
        recording, name, options = job
        told = pickle.dumps((replace(recording, notes=()), name, options.model_dump()))
        with self._lock:
            if self._under_way is not job:
                return None
            # A session of its own: Ctrl-C in the terminal is for the node, which then ends this.
            process = self._process = subprocess.Popen(
                [sys.executable, "-c", CHILD],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
        with process:
            out, errors = process.communicate(told)
        if process.returncode:
            lines = errors.decode(errors="replace").strip().splitlines()
            last = lines[-1] if lines else f"its process ended with {process.returncode}"
            return Diagnosed(name, {}, f"{name}: not diagnosed: {last}")
        try:
            answer: Diagnosed = pickle.loads(out)
        except Exception as error:  # something else was printed: a fault of ours must not end the watch
            return Diagnosed(name, {}, f"{name}: not diagnosed: its process answered {out[:40]!r} ({error})")
        return answer


def main() -> None:
    """Read a job from the input, write what was found to the output."""
    recording, name, options = pickle.load(sys.stdin.buffer)
    found = diagnose_object(recording, name, DiagnoseOptions(**options))
    sys.stdout.buffer.write(pickle.dumps(found))
