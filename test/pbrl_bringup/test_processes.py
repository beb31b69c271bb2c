"""Programs that are started together are gone together, however stubborn they are and however the parent ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import psutil
import pytest

from pbrl_bringup import processes
from pbrl_bringup.errors import BringupError
from pbrl_bringup.processes import Programs

PATIENT = "import signal; signal.sigwait({signal.SIGUSR1})"
STUBBORN = (
    "import signal; [signal.signal(n, signal.SIG_IGN) for n in (2, 15)]; print('up', flush=True); signal.sigwait({10})"
)


def python(code: str) -> list[str]:
    return [sys.executable, "-c", code]


def wait_for_output(log: Path, pid: int) -> None:
    process = psutil.Process(pid)
    while not log.read_text() and process.is_running():
        with pytest.raises(psutil.TimeoutExpired):
            process.wait(0.02)


def test_none_is_left_at_the_end_of_the_block(tmp_path: Path) -> None:
    with Programs(tmp_path) as programs:
        pids = [programs.start(name, python(PATIENT)).process.pid for name in ("one", "two")]
        assert all(map(psutil.pid_exists, pids))
    assert not any(map(psutil.pid_exists, pids))


def test_one_that_ignores_signals_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        processes, "GRACE", tuple((number, 0.1) for number, _ in processes.GRACE[:2]) + processes.GRACE[2:]
    )
    with Programs(tmp_path) as programs:
        program = programs.start("stubborn", python(STUBBORN))
        wait_for_output(program.log, program.process.pid)
        assert programs.stop("stubborn") == -signal.SIGKILL


def test_what_a_program_left_behind_is_killed(tmp_path: Path) -> None:
    leaver = f"import subprocess, sys; print(subprocess.Popen([sys.executable, '-c', {PATIENT!r}]).pid, flush=True)"
    with Programs(tmp_path) as programs:
        program = programs.start("leaver", python(leaver))
        program.process.wait()
        child = psutil.Process(int(program.log.read_text()))
        assert child.is_running()
    gone, alive = psutil.wait_procs([child], timeout=5)
    assert gone
    assert not alive


def test_a_program_that_ends_by_itself_is_noticed_with_its_last_words(tmp_path: Path) -> None:
    with Programs(tmp_path) as programs:
        programs.start("sim", python("raise SystemExit('scene: no table')")).process.wait()
        with pytest.raises(BringupError, match=r"sim ended with exit code 1: scene: no table"):
            programs.check()


def test_they_die_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    parent = textwrap.dedent(f"""
        import signal
        from pathlib import Path
        from pbrl_bringup.processes import Programs
        programs = Programs(Path({str(tmp_path)!r}))
        print(programs.start("child", {python(PATIENT)!r}).process.pid, flush=True)
        signal.sigwait({{signal.SIGUSR1}})
    """)
    with subprocess.Popen(python(parent), stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        child = psutil.Process(int(process.stdout.readline()))
        process.kill()
    gone, alive = psutil.wait_procs([child], timeout=5)
    assert gone
    assert not alive


def test_an_interrupted_parent_leaves_none(tmp_path: Path) -> None:
    parent = textwrap.dedent(f"""
        import signal
        from pathlib import Path
        from pbrl_bringup.processes import Programs
        # Tests that a shell runs in the background are started with interrupts ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with Programs(Path({str(tmp_path)!r})) as programs:
            print(programs.start("child", {python(PATIENT)!r}).process.pid, flush=True)
            signal.pause()
    """)
    with subprocess.Popen(python(parent), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        child = int(process.stdout.readline())
        process.send_signal(signal.SIGINT)
    assert not psutil.pid_exists(child)


def test_a_name_is_used_once(tmp_path: Path) -> None:
    with Programs(tmp_path) as programs:
        programs.start("sim", python(PATIENT))
        with pytest.raises(BringupError, match="two programs are called 'sim'"):
            programs.start("sim", python(PATIENT))


def test_a_program_that_is_not_there_is_an_error_of_one_line(tmp_path: Path) -> None:
    with Programs(tmp_path) as programs, pytest.raises(BringupError, match=r"sim: .*cannot be started"):
        programs.start("sim", [str(tmp_path / "nothing")])


def test_who_is_not_missed_is_let_go_once_and_the_others_go_on(tmp_path: Path) -> None:
    with Programs(tmp_path) as programs:
        programs.start("spare", python("print('enough'); raise SystemExit(2)"))
        programs.start("needed", python(PATIENT))
        assert programs.ended("spare", 60.0)
        assert programs.let_go({"needed"}) == []
        with pytest.raises(BringupError, match="spare ended with exit code 2: enough"):
            programs.check()
        (gone,) = programs.let_go({"spare", "needed"})
        assert (gone.name, gone.last_line()) == ("spare", "enough")
        assert programs.let_go({"spare"}) == []
        programs.check()
        assert programs.names == ("needed",)


def test_who_is_struck_is_the_node_of_that_very_name(tmp_path: Path) -> None:
    with Programs(tmp_path) as programs:
        struck, left = (
            programs.start(name, [*python(PATIENT), "-r", f"__node:={name}"]).process for name in ("sim", "sim_2")
        )
        programs.strike("sim", signal.SIGSTOP)
        assert os.WIFSTOPPED(os.waitpid(struck.pid, os.WUNTRACED)[1])
        assert psutil.Process(left.pid).status() != psutil.STATUS_STOPPED
        programs.strike("sim", signal.SIGKILL)
        assert struck.wait(10.0) == -signal.SIGKILL
        programs.strike("sim", signal.SIGKILL)  # is gone
        assert left.poll() is None
