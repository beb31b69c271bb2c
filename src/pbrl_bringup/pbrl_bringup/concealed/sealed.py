"""Diagnoses behind a seal: a process that is handed a bag and settings, and gives back what it found."""

from __future__ import annotations

import json
import select
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pbrl_bringup.concealed.diagnoser import THIS
from pbrl_bringup.processes import die_with_parent

PATIENCE = 1800.0
"""For one diagnosis [s]."""


class SealedDiagnoser:
    """A diagnosing process, started when it is first asked, and anew after it fails. A context manager.

    Args:
        patience: for one diagnosis [s].
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self._patience = patience
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def ask(self, bag: Path, out: Path, options: Mapping[str, Any], *, rivals: bool) -> tuple[float, str]:
        """Have a bag diagnosed.

        Args:
            bag: folder.
            out: folder for what is found.
            options: settings of the diagnosis, by name in `DiagnoseOptions`.
            rivals: whether the rivals are asked as well.

        Returns:
            CPU seconds of the diagnosis (NaN where it never ended), and in a line what went wrong, or nothing.
        """
        process = self._started()
        assert process.stdin is not None and process.stdout is not None
        job = {"bag": str(bag), "out": str(out), "options": dict(options), "rivals": rivals}
        answer = ""
        with suppress(BrokenPipeError):
            process.stdin.write(json.dumps(job) + "\n")
            process.stdin.flush()
            if not select.select([process.stdout], [], [], self._patience)[0]:
                self.close()
                return float("nan"), f"no answer in {self._patience:.0f} s"
            answer = process.stdout.readline()
        if not answer:
            code = process.wait()
            self.close()
            return float("nan"), f"the diagnosing process ended with exit code {code}"
        told = json.loads(answer)
        return float(told["seconds"]), str(told["failed"])

    def close(self) -> None:
        """End the process, if there is one."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            with suppress(BrokenPipeError):
                if stream is not None:
                    stream.close()

    def _started(self) -> subprocess.Popen[str]:
        if self._process is None:
            command = [sys.executable, "-m", THIS]
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, preexec_fn=die_with_parent
            )
        return self._process
