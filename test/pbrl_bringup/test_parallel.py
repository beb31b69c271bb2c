"""Processes that work in parallel end with the one that began them, whatever ended it."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import psutil
import pytest

PROGRAM = """
    import os, signal, sys, time
    from pathlib import Path
    from pbrl_bringup.parallel import in_parallel

    def work(number, folder):
        Path(folder, str(os.getpid())).touch()
        while True:
            time.sleep(0.01)

    if __name__ == "__main__":
        signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(143))  # as the command line does
        in_parallel(work, [(number, sys.argv[1]) for number in range(8)], "jobs")
"""


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_their_parent(tmp_path: Path, ending: signal.Signals) -> None:
    program, marks = tmp_path / "program.py", tmp_path / "marks"
    program.write_text(textwrap.dedent(PROGRAM))
    marks.mkdir()
    with subprocess.Popen([sys.executable, str(program), str(marks)], stderr=subprocess.DEVNULL) as parent:
        try:
            main = psutil.Process(parent.pid)
            while not list(marks.iterdir()) and parent.poll() is None:
                psutil.wait_procs([main], timeout=0.05)
            begun = main.children(recursive=True)
            assert begun
            parent.send_signal(ending)
            _, left = psutil.wait_procs(begun, timeout=20.0)
            assert not left
        finally:
            parent.kill()
