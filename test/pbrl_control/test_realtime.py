"""Real-time priority: taken for all threads, or refused in one line; always in a process of its own."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import os, resource, threading
from pathlib import Path
from pbrl_control.errors import ControlError
from pbrl_control.realtime import take_priority
if {strip}:
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    if os.geteuid() == 0:
        os.setuid(65534)
stop = threading.Event()
other = threading.Thread(target=stop.wait)
other.start()
try:
    take_priority({priority})
    print({{os.sched_getscheduler(int(each.name)) for each in Path("/proc/self/task").iterdir()}})
except ControlError as error:
    print(error)
stop.set()
"""


def said(priority: int, strip: bool) -> str:
    script = SCRIPT.format(priority=priority, strip=strip)
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.strip()


def test_none_changes_nothing() -> None:
    assert said(0, strip=False) == "{0}"


def test_every_thread_has_it_or_it_is_refused_in_one_line() -> None:
    found = said(10, strip=False)
    assert found == "{1}" or found.startswith("priority: expected to be allowed SCHED_FIFO 10, got "), found


def test_without_the_right_it_says_what_to_do() -> None:
    assert "allow `rtprio` in /etc/security/limits.conf" in said(10, strip=True)
