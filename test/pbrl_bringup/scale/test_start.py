"""Dask takes a second to load: a command that shares nothing out does without."""

from __future__ import annotations

import subprocess
import sys

MODULES = "pbrl_bringup.cli.app, pbrl_bringup.commands.bench, pbrl_bringup.commands.fit, pbrl_bringup.commands.diagnose"


def test_commands_load_without_dask() -> None:
    program = f"import sys, {MODULES}; print(*(name for name in sys.modules if name in ('dask', 'distributed')))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.split() == []
