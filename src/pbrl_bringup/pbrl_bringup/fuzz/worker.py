"""The process that reads hostile inputs: one reader, one input after the other, with limits of its own.

Before each input it says which it is about to read, so that whoever watches it knows what killed it. Nothing that it
reads may be run, and nothing may be written but into the folder for that.
"""

from __future__ import annotations

import faulthandler
import json
import os
import resource
import signal
import sys
import time
import traceback
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from pbrl_bringup.cli.errors import is_for_the_user

PATIENCE = 5.0
"""Processor time that one input may take [s]."""
BACKSTOP = 6 << 30
"""Memory that the process may ask for [bytes]: what asks for more is told so, and is a finding by its peak anyway."""
MOST_MEMORY = 1 << 30
"""Peak of the process [bytes] beyond which an input is told of."""
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod")
_RUNS = ("subprocess.Popen", "os.exec", "os.system", "os.posix_spawn", "os.fork", "pickle.find_class", "socket.connect")
_OWN = ("/dev/null", "/dev/shm", *filter(None, map(os.environ.get, ("NUMBA_CACHE_DIR", "MPLCONFIGDIR"))))
"""What Python itself and compiled kernels write, whatever is read."""


@dataclass(frozen=True)
class Outcome:
    """What became of one input.

    Attributes:
        index: of the input.
        refused: whether it was refused with an error of ours.
        seconds: that it took.
        memory: peak of the process meanwhile [bytes].
        fault: what was wrong; empty: nothing.
        trace: where.
    """

    index: int
    refused: bool
    seconds: float
    memory: int
    fault: str = ""
    trace: str = ""


def generator(seed: int, reader: str, index: int) -> np.random.Generator:
    """Return what draws one input: the same in every run, whatever was read before."""
    return np.random.default_rng([seed, zlib.crc32(reader.encode()), index])


class Guard:
    """Takes note of what Python is about to do to files outside of a folder, and of programs and connections.

    Args:
        allowed: folder into which may be written.
    """

    def __init__(self, allowed: Path) -> None:
        self.faults: list[str] = []
        self._allowed = os.path.realpath(allowed)
        self.on = False
        sys.addaudithook(self._hook)

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        if event == "open":
            path, mode, flags = arguments
            if isinstance(path, str | bytes) and ((flags or 0) & _WRITES or set(str(mode or "")) & set("wax+")):
                self._check(event, path)
        elif event in _CHANGES:
            for path in arguments[:2]:
                if isinstance(path, str | bytes | os.PathLike):
                    self._check(event, os.fspath(path))
        elif event in _RUNS and not (event == "pickle.find_class" and _is_of_a_cache()):
            self.faults.append(f"{event} {str(arguments)[:80]}")

    def _check(self, event: str, path: str | bytes) -> None:
        text = os.fsdecode(path)
        if not text.startswith(_OWN) and not os.path.realpath(text).startswith(self._allowed + os.sep):
            self.faults.append(f"{event} outside of its folder: {text[:80]!r}")


def _is_of_a_cache() -> bool:
    """Tell whether it is a compiled kernel that is being loaded, from our own cache."""
    frame = sys._getframe(2)
    while frame is not None and "/numba/core/caching.py" not in frame.f_code.co_filename:
        frame = frame.f_back  # type: ignore[assignment]
    return frame is not None


class Subject(Protocol):
    """What is given hostile inputs."""

    def make(self, rng: np.random.Generator) -> Any:
        """Draw an input."""

    def read(self, made: Any) -> None:
        """Give it to what reads it."""


def read_all(name: str, subject: Subject, seed: int, span: range, place: Path) -> Iterator[Outcome]:
    """Make and read inputs one after the other.

    Args:
        name: of the reader, from which its inputs are drawn.
        subject: it.
        seed: of the whole campaign.
        span: indices of the inputs.
        place: folder of this process.
    """
    guard = Guard(place)
    for index in span:
        print(json.dumps({"index": index}), flush=True)
        made = subject.make(generator(seed, name, index))
        _forget_peak()
        signal.setitimer(signal.ITIMER_PROF, PATIENCE)
        guard.faults.clear()
        guard.on = True
        started = time.process_time()
        refused, fault, trace = _read(subject, made)
        seconds = time.process_time() - started
        guard.on = False
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        fault = "; ".join(filter(None, dict.fromkeys((fault, *guard.faults)))) or _strange(place)
        yield Outcome(index, refused, seconds, _peak(), fault, trace)


def _read(subject: Subject, made: Any) -> tuple[bool, str, str]:
    """Return whether an input was refused, what was wrong, and where."""
    try:
        subject.read(made)
    except Exception as error:
        if is_for_the_user(error):
            return True, _form_of(str(error)), ""
        return False, f"{type(error).__name__}: {' '.join(str(error).split())[:200]}", _where(error)
    return False, "", ""


def _form_of(message: str) -> str:
    """Return what is wrong with a message to the user; empty: nothing."""
    if not message.strip():
        return "an error without a message"
    return ""


def _where(error: Exception) -> str:
    """Return the innermost places of an error in code of this workspace, and its very innermost."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "/src/" in frame.filename and "/fuzz/" not in frame.filename][-3:]
    return " < ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in [frames[-1], *reversed(ours)])


def _strange(place: Path) -> str:
    """Return what lies beside the folders `in` and `out` that should not."""
    found = [each.name for each in place.iterdir() if each.name not in ("in", "out")]
    return f"written beside its folder: {found[0]!r}" if found else ""


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def _peak() -> int:
    """Return the peak of the resident memory since it was forgotten [bytes]."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) << 10
    return 0


def work(name: str, subject: Subject, seed: int, span: range, place: Path) -> None:
    """Read inputs in a process of its own, and tell of each in a line of JSON."""
    faulthandler.enable()
    faulthandler.register(signal.SIGPROF, chain=True)
    resource.setrlimit(resource.RLIMIT_DATA, (BACKSTOP, BACKSTOP))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.chdir(place)
    warnings.simplefilter("ignore")
    total = {"count": 0, "refused": 0, "seconds": 0.0, "slowest": 0.0, "memory": 0}
    for outcome in read_all(name, subject, seed, span, place):
        total["count"] += 1
        total["refused"] += outcome.refused
        total["seconds"] += outcome.seconds
        total["slowest"] = max(total["slowest"], outcome.seconds)
        total["memory"] = max(total["memory"], outcome.memory)
        line: dict[str, Any] = {"total": total}
        if outcome.fault or outcome.memory > MOST_MEMORY:
            line["outcome"] = asdict(outcome)
        print(json.dumps(line), flush=True)
