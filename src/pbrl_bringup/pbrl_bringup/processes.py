"""Programs that are started together and are all gone afterwards, however the parent ends.

Each program leads a process group of its own, so that Ctrl-C at the terminal reaches the parent only
and the parent stops the others in order. Where the parent is killed, the kernel kills them.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Callable, Container, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import psutil

from pbrl_bringup.errors import BringupError

PR_SET_PDEATHSIG = 1
GRACE = ((signal.SIGINT, 8.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 5.0))  # signal, seconds to obey it
_LIBC = ctypes.CDLL(None)


@dataclass(frozen=True)
class Program:
    """One running program and the file its output goes to."""

    name: str
    process: subprocess.Popen[bytes]
    log: Path

    def last_line(self) -> str:
        """Return the last line the program wrote, where a node says why it stopped."""
        with suppress(OSError):
            lines = self.log.read_text(encoding="utf-8", errors="replace").split("\n")
            return next((line.strip() for line in reversed(lines) if line.strip()), "it wrote nothing")
        return "it wrote nothing"


class Programs:
    """The programs of one graph. A context manager: at its end none is left.

    Args:
        logs: folder for one log file a program.
        environment: of the programs; None for the parent's own.

    Raises:
        BringupError: the folder cannot be made.
    """

    def __init__(self, logs: Path, environment: Mapping[str, str] | None = None) -> None:
        self._logs = logs
        self._environment = dict(os.environ if environment is None else environment)
        self._running: dict[str, Program] = {}
        try:
            logs.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BringupError(f"{logs}: expected a folder for logs: {error.strerror}; choose another") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.stop_all()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the programs that have been started and not stopped, in order of start."""
        return tuple(self._running)

    def start(self, name: str, command: Sequence[str]) -> Program:
        """Start a program under a name that is not in use.

        Raises:
            BringupError: the name is taken, or the program cannot be executed.
        """
        if name in self._running:
            raise BringupError(f"two programs are called {name!r}; give each a name of its own")
        log = self._logs / f"{name}.log"
        try:
            with log.open("wb") as file:
                process = subprocess.Popen(
                    list(command),
                    stdin=subprocess.DEVNULL,
                    stdout=file,
                    stderr=subprocess.STDOUT,
                    env=self._environment,
                    start_new_session=True,
                    preexec_fn=_die_with(os.getpid()),
                )
        except OSError as error:
            raise BringupError(f"{name}: {command[0]} cannot be started: {error.strerror}") from error
        self._running[name] = Program(name, process, log)
        return self._running[name]

    def let_go(self, names: Container[str]) -> list[Program]:
        """Return those of some programs that have ended by themselves, and forget them: they are not missed."""
        ended = [each for each in self._running.values() if each.name in names and each.process.poll() is not None]
        for program in ended:
            del self._running[program.name]
        return ended

    def check(self) -> None:
        """Raise BringupError, with its last words, if a program has ended by itself."""
        for program in self._running.values():
            code = program.process.poll()
            if code is not None:
                raise BringupError(f"{program.name} ended with exit code {code}: {program.last_line()}")

    def strike(self, name: str, number: signal.Signals) -> float:
        """Send a signal to every process of the node of a name, as a crash or a debugger would; return when [s].

        It is the node's own name that counts, as its command line gives it. Who is gone by then is left alone.
        """
        when = time.time()
        for process in psutil.Process().children(recursive=True):
            with suppress(psutil.Error):
                if f"__node:={name}" in process.cmdline():
                    process.send_signal(number)
        return when

    def ended(self, name: str, timeout: float) -> bool:
        """Wait for a program to end by itself; tell whether it did within `timeout` seconds."""
        try:
            self._running[name].process.wait(timeout)
        except subprocess.TimeoutExpired:
            return False
        return True

    def stop(self, name: str) -> int:
        """Stop one program: SIGINT, then SIGTERM, then SIGKILL; return its exit code."""
        program = self._running.pop(name)
        _stop_together([program])
        return program.process.returncode

    def stop_all(self) -> None:
        """Stop every program, the last started first to be told; none is left."""
        programs = list(reversed(self._running.values()))
        self._running.clear()
        _stop_together(programs)


def die_with_parent() -> None:
    """Have the kernel kill this process when the one that started it ends."""
    _LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _die_with(parent: int) -> Callable[[], None]:
    """Return what a child does before it becomes the program: tie its life to its parent's."""

    def prepare() -> None:
        die_with_parent()
        if os.getppid() != parent:  # the parent died before the tie was made
            os._exit(1)
        # A shell ignores SIGINT for what it starts in the background, and children inherit that.
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    return prepare


def _stop_together(programs: Sequence[Program]) -> None:
    for number, seconds in GRACE:
        waiting = [program for program in programs if program.process.poll() is None]
        for program in waiting:
            _signal_group(program, number)
        deadline = time.monotonic() + seconds
        for program in waiting:
            with suppress(subprocess.TimeoutExpired):
                program.process.wait(max(0.0, deadline - time.monotonic()))
    for program in programs:  # what a program itself started and left behind
        _signal_group(program, signal.SIGKILL)


def _signal_group(program: Program, number: signal.Signals) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(program.process.pid, number)
