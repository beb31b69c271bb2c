"""What a process thinks in tests: jobs are words."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable

from pbrl_namo.executive import ProcessThinker


def make() -> Callable[[str], object]:
    return answer


def forever() -> None:
    time.sleep(600.0)


def shortly() -> None:
    time.sleep(3.0)


def answer(job: str) -> object:
    if job == "die":
        os._exit(3)
    if job == "sleep":
        forever()
    if job == "nap":
        time.sleep(0.5)
    return os.getpid() if job == "who" else len(job)


if __name__ == "__main__":  # a node that is killed while another process thinks for it
    thinker = ProcessThinker(make)
    thinker.begin("who")
    while (pid := thinker.poll()) is None:
        time.sleep(0.01)
    thinker.begin("sleep")
    print(pid, flush=True)
    sys.stdin.read()
