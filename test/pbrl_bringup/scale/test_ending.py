"""A cluster that was started for a command ends with it, whatever ended it, and says nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import psutil
import pytest

PROGRAM = """
    import os, signal, sys, threading
    from pathlib import Path
    from pbrl_bringup.scale.cluster import cluster
    from pbrl_bringup.scale.pieces import run_pieces

    def work(number, folder):
        Path(folder, str(os.getpid())).touch()
        threading.Event().wait()

    if __name__ == "__main__":
        signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(143))  # as the command line does
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            with cluster("local:1") as client:
                list(run_pieces(client, work, [(0, sys.argv[1])]))
        except KeyboardInterrupt:
            sys.exit(130)
"""


@pytest.mark.parametrize(
    ("ending", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -signal.SIGKILL)]
)
def test_workers_end_with_the_command(tmp_path: Path, ending: signal.Signals, code: int) -> None:
    program, marks, said = tmp_path / "program.py", tmp_path / "marks", tmp_path / "said"
    program.write_text(textwrap.dedent(PROGRAM))
    marks.mkdir()
    command = [sys.executable, str(program), str(marks)]
    with (
        said.open("wb") as file,
        subprocess.Popen(command, stdout=file, stderr=file, start_new_session=True) as parent,
    ):
        try:
            main = psutil.Process(parent.pid)
            while not list(marks.iterdir()) and parent.poll() is None:
                psutil.wait_procs([main], timeout=0.05)
            begun = main.children(recursive=True)
            assert begun, said.read_text()
            if ending == signal.SIGINT:
                os.killpg(parent.pid, ending)  # as a terminal does
            else:
                parent.send_signal(ending)
            _, left = psutil.wait_procs(begun, timeout=30.0)
            assert not left
            assert parent.wait(30.0) == code
        finally:
            parent.kill()
    if ending != signal.SIGKILL:  # after which Python itself counts what was left
        assert said.read_text() == ""
