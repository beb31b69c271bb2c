"""A diagnosis in a process of its own: its verdict comes back, a failure is a verdict, ending it waits for nobody."""

from __future__ import annotations

import errno
import subprocess
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch.online import diagnosing
from pbrl_mismatch.online.diagnosing import Diagnosed, DiagnosisWorker, diagnose_object, options_for
from pbrl_mismatch.online.found import Findings, Found
from pbrl_mismatch.online.monitor import Alarm
from pbrl_mismatch.options import DiagnoseOptions

PATIENCE = 120.0  # [s]
ALARM = Alarm("table", 12.0, 1e-4, 5.0, "free")


def unmoved(recording: Recording) -> Recording:
    """A recording in which nothing is held."""
    return replace(recording, grasps=())


def test_what_goes_wrong_is_the_verdict(concealed_recording: Callable[..., Recording]) -> None:
    found = diagnose_object(
        unmoved(concealed_recording("clean", 1, seconds=4.0)), "table", options_for(DiagnoseOptions(), "table", "free")
    )
    assert found.report == {} and found.verdict.startswith("table: not diagnosed: ") and "\n" not in found.verdict


def test_another_process_says_the_same(concealed_recording: Callable[..., Recording]) -> None:
    recording = unmoved(concealed_recording("clean", 1, seconds=4.0))
    options = options_for(DiagnoseOptions(), "table", "free")
    worker = DiagnosisWorker()
    worker.start(recording, "table", options)
    assert worker.wait(PATIENCE)
    assert worker.done() == [diagnose_object(recording, "table", options)]
    worker.start(recording, "table", options)
    worker.stop()
    assert not worker.busy and worker.done() == []


def test_what_was_begun_before_it_forgot_is_never_told(
    concealed_recording: Callable[..., Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, began = unmoved(concealed_recording("clean", 1, seconds=4.0)), threading.Event()
    options = options_for(DiagnoseOptions(), "table", "free")

    class Told(subprocess.Popen[bytes]):
        def __init__(self, *given: Any, **named: Any) -> None:
            super().__init__(*given, **named)
            began.set()

    worker = DiagnosisWorker()
    with monkeypatch.context() as patched:
        patched.setattr(diagnosing, "CHILD", "import time; time.sleep(600)")
        patched.setattr(diagnosing.subprocess, "Popen", Told)
        worker.start(recording, "table", options)
        worker.start(recording, "chair", options)
        assert began.wait(PATIENCE)
        worker.forget()
    worker.start(recording, "table", options)
    assert worker.wait(PATIENCE)
    assert worker.done() == [diagnose_object(recording, "table", options)]
    worker.start(recording, "table", options)
    assert worker.wait(PATIENCE)
    worker.forget()
    assert worker.done() == [], "nor what was ready and had not been fetched"


class Unpacked(DiagnoseOptions):
    """Options that cannot be handed to another process."""

    def model_dump(self, **_: Any) -> dict[str, Any]:
        return {"seed": lambda: 0}


@pytest.mark.parametrize(("refused", "reason"), [("process", "no more processes"), ("job", "pickle")])
def test_a_job_that_cannot_be_begun_is_the_verdict_and_the_next_one_is_done(
    refused: str, reason: str, concealed_recording: Callable[..., Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = unmoved(concealed_recording("clean", 1, seconds=4.0))
    options = options_for(DiagnoseOptions(), "table", "free")

    def no_more(*_: Any, **__: Any) -> None:
        raise BlockingIOError(errno.EAGAIN, "no more processes")

    worker = DiagnosisWorker()
    with monkeypatch.context() as patched:
        if refused == "process":
            patched.setattr(diagnosing.subprocess, "Popen", no_more)
        worker.start(recording, "table", Unpacked() if refused == "job" else options)
        assert worker.wait(PATIENCE)
    (found,) = worker.done()
    assert found.report == {} and found.verdict.startswith("table: not diagnosed: ") and reason in found.verdict
    worker.start(recording, "table", options)
    assert worker.wait(PATIENCE)
    assert worker.done() == [diagnose_object(recording, "table", options)]


def test_the_class_that_failed_is_the_baseline() -> None:
    chosen = options_for(DiagnoseOptions(seed=3), "table", "wheel+ground")
    assert chosen.objects == ("table",) and chosen.seed == 3
    assert {"wheel", "wheel+ground"} <= set(chosen.baseline)


def test_entries_are_alarms_first_and_diagnoses_later() -> None:
    findings = Findings()
    findings.add_diagnoses([Diagnosed("chair", {}, "chair: ...")])
    assert findings.entries == ()
    findings.add_alarms([ALARM])
    assert findings.entries == (Found(ALARM),) and "diagnosing" in findings.entries[0].verdict
    findings.add_diagnoses([Diagnosed("table", {"unknown": True}, "table: something is left out")])
    assert findings.entries[0].verdict == "table: something is left out"
    later = replace(ALARM, time=50.0)
    findings.add_alarms([later])
    (entry,) = findings.entries
    assert entry.alarm == later and entry.diagnosed is not None
    findings.forget()
    assert findings.entries == ()
