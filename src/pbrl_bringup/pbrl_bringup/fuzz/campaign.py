"""Gives inputs to every reader, each in a process of its own that may die, and collects what was found."""

from __future__ import annotations

import json
import os
import selectors
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pbrl_bringup.fuzz.worker import MOST_MEMORY, PATIENCE

SILENCE = 60.0
"""Without a word for so long on the wall clock [s], a process hangs: it waits for something that never comes."""
BEGINNING = 300.0
"""The same before its first input: what it needs is loaded, and compiled once."""
KEPT = 20
"""Findings of a reader that are kept one by one; of more, only the number is."""


@dataclass(frozen=True)
class Finding:
    """One input that was not dealt with as it should be.

    Attributes:
        reader: that was given it.
        index: of the input, which seed, reader and index make again.
        fault: what happened.
        trace: where, innermost first.
    """

    reader: str
    index: int
    fault: str
    trace: str


@dataclass
class Tally:
    """What became of the inputs of one reader.

    Attributes:
        inputs: that were read.
        refused: of them, with an error of ours.
        seconds: of processor time in all [s].
        slowest: input [s].
        memory: peak of the process while it read [bytes].
        faults: inputs that were not dealt with as they should be.
        findings: the first of them, each place and kind once.
    """

    inputs: int = 0
    refused: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    memory: int = 0
    faults: int = 0
    findings: list[Finding] = field(default_factory=list)

    def add(self, finding: Finding) -> None:
        """Take note of a finding."""
        self.faults += 1
        alike = [
            each for each in self.findings if (each.trace or each.fault[:40]) == (finding.trace or finding.fault[:40])
        ]
        if not alike and len(self.findings) < KEPT:
            self.findings.append(finding)


def shares_of(shares: Mapping[str, float], count: int) -> dict[str, int]:
    """Return how many of `count` inputs each reader is given; each gets one at least, and the sum is `count`.

    Args:
        shares: relative to each other.
        count: at least as many as there are readers.
    """
    whole, rest = sum(shares.values()), count - len(shares)
    given = {name: 1 + int(rest * share / whole) for name, share in shares.items()}
    most = max(given, key=lambda name: given[name])
    given[most] += count - sum(given.values())
    return given


def attack(
    name: str, seed: int, count: int, told: Callable[[int], None], until: Callable[[], bool] = lambda: False
) -> Tally:
    """Give a reader its inputs; where a process ends, the next goes on behind the input that ended it.

    Args:
        name: of the reader.
        seed: of the campaign.
        count: of inputs.
        told: is called with how many are done.
        until: tells whether no further input is to be read.
    """
    tally, begin = Tally(), 0
    with tempfile.TemporaryDirectory(prefix="pbrl_fuzz_") as place:
        while begin < count and not (begin and until()):
            begin = _one_process(name, seed, range(begin, count), Path(place), tally, told, until)
    return tally


def _one_process(
    name: str,
    seed: int,
    span: range,
    place: Path,
    tally: Tally,
    told: Callable[[int], None],
    until: Callable[[], bool],
) -> int:
    """Run one process until it is done or ends; return the index to go on with."""
    work = place / "work"
    shutil.rmtree(work, ignore_errors=True)
    command = [sys.executable, "-m", "pbrl_bringup.fuzz", name, str(seed), str(span.start), str(span.stop), str(work)]
    environment = {
        **os.environ,
        "ROS_LOG_DIR": str(place / "log"),
        "MPLCONFIGDIR": str(place / "plots"),
        "PYTHONWARNINGS": "ignore",
    }
    last: dict[str, Any] = {}
    index, enough = span.start - 1, False
    with (place / "err").open("wb") as errors:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, env=environment)
        try:
            for line in _lines(process):
                if "index" in line:
                    index = line["index"]
                    told(index)
                last = line.get("total", last)
                if "total" in line and until():  # between two inputs: none is cut off
                    enough = True
                    process.kill()
                if outcome := line.get("outcome"):
                    fault = outcome["fault"] or f"{outcome['memory'] / 2**20:.0f} MiB of memory"
                    tally.add(Finding(name, outcome["index"], fault, outcome["trace"]))
        except TimeoutError:
            process.kill()
        code = process.wait()
    tally.inputs += int(last.get("count", 0))
    tally.refused += int(last.get("refused", 0))
    tally.seconds += float(last.get("seconds", 0.0))
    tally.slowest = max(tally.slowest, float(last.get("slowest", 0.0)))
    tally.memory = max(tally.memory, int(last.get("memory", 0)))
    if code == 0 or enough:
        return span.stop
    tail = _tail((place / "err").read_text(encoding="utf-8", errors="replace"))
    if index < span.start:
        raise RuntimeError(f"the process of {name!r} ended with {code} before its first input: {tail}")
    tally.inputs += 1
    tally.add(Finding(name, index, _end(code), tail))
    if code == -signal.SIGPROF:
        tally.slowest = max(tally.slowest, PATIENCE)
    return index + 1


def _tail(text: str) -> str:
    """Return where a process was when it was ended, or what it said last."""
    words = text.rpartition("(most recent call first):")[2].split()
    return " ".join(words[:60] if "(most recent call first):" in text else words[-60:])


def _end(code: int) -> str:
    """Say how a process ended."""
    if code == -signal.SIGPROF:
        return f"still reading after {PATIENCE:g} s of processor time"
    if code == -signal.SIGKILL:
        return f"silent for {SILENCE:g} s"
    return f"ended the process with {signal.Signals(-code).name if code < 0 else code}"


def _lines(process: subprocess.Popen[bytes]) -> Any:
    """Yield what a process tells, line by line.

    Raises:
        TimeoutError: it is silent for too long.
    """
    assert process.stdout is not None
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        rest, patience = b"", BEGINNING
        while True:
            started = time.monotonic()
            if not selector.select(patience):
                raise TimeoutError(f"nothing for {time.monotonic() - started:.0f} s")
            data = os.read(process.stdout.fileno(), 1 << 16)
            if not data:
                return
            patience = SILENCE
            *lines, rest = (rest + data).split(b"\n")
            yield from (json.loads(line) for line in lines if line.startswith(b"{"))


def holds(tallies: Mapping[str, Tally]) -> bool:
    """Tell whether nothing was found, and memory stayed within what it may take."""
    return not any(each.faults for each in tallies.values()) and max(t.memory for t in tallies.values()) <= MOST_MEMORY
