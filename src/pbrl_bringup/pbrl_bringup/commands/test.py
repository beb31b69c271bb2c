"""`./pbrl test`: style, types, then every test."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from pbrl_bringup.paths import workspace
from pbrl_bringup.terminal import say

CHECKED = ("src", "test", "examples")
MOST = 4
"""Files of tests that are run at once."""


def command(arguments: Sequence[str]) -> int:
    """Run ruff, mypy and pytest in the workspace; further `arguments` go to pytest.

    Returns:
        0, or the exit code of the first that fails.
    """
    root = workspace()
    packages = sorted(str(path.parent) for path in root.glob("src/*/*/py.typed"))
    steps = {
        "style": [sys.executable, "-m", "ruff", "check", *CHECKED],
        "format": [sys.executable, "-m", "ruff", "format", "--check", "--quiet", *CHECKED],
        "types": [sys.executable, "-m", "mypy", *packages],
    }
    for what, step in steps.items():
        code = run_step(step, root)
        if code:
            return code
        say(f"pbrl: {what} ok")
    return run_step([sys.executable, "-m", "pytest", *(arguments or [*at_once(), "test"])], root)


def at_once() -> list[str]:
    """Return the options of pytest by which files of tests are run beside each other, on as many cores as there are.

    Not on more than `MOST`: graphs of nodes run in real time, and want a core.
    """
    workers = min(len(os.sched_getaffinity(0)), MOST)
    return ["-n", str(workers), "--dist", "loadfile"] if workers > 1 else []


def run_step(step: Sequence[str], root: Path) -> int:
    """Run one checker to its end, its output going straight to the terminal.

    Bytecode is kept whatever is usual here: tests start hundreds of processes, and compiling is a third of their start.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    with subprocess.Popen(list(step), cwd=root, env=environment) as process:
        try:
            return process.wait()
        except BaseException:
            process.terminate()
            raise
