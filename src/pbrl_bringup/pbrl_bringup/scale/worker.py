"""What runs in a worker: its set-up, with the check that it is one of ours, and a piece."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

import dask
from distributed import Worker, WorkerPlugin, get_worker

from pbrl_bringup.parallel import THREADS

Result = TypeVar("Result")

PACKAGES = (
    *("pbrl_bag", "pbrl_model", "pbrl_mismatch", "pbrl_control", "pbrl_planner", "pbrl_namo"),
    *("bullet_sim", "krang_sim", "pr2_cart_sim", "tabletop_sim", "pbrl_bringup"),
)


class WrongWorkerError(Exception):
    """A worker would not give the results that this process would; the message says what to do."""


class OneOfOurs(WorkerPlugin):
    """Sees that a worker runs the same code in one thread, at its start or when a client comes.

    Args:
        code: what `code_of` says where the client is.
    """

    name = "pbrl"

    def __init__(self, code: str) -> None:
        self.code = code

    def setup(self, worker: Worker) -> None:
        """Check the worker, and keep compiled code that it loads later to one thread.

        Raises:
            WrongWorkerError: it has several threads, or other code.
        """
        check_worker(worker, self.code)
        if "numba" not in sys.modules:  # which reads it once, and refuses to compile where it is changed afterwards
            os.environ.update(dict.fromkeys(THREADS, "1"))


def check_worker(worker: Worker, code: str) -> None:
    """See that a worker gives the results that the client's own process would.

    Args:
        worker: the worker.
        code: what `code_of` says where the client is.

    Raises:
        WrongWorkerError: it has several threads, or other code.
    """
    if worker.state.nthreads != 1:
        raise WrongWorkerError(
            f"worker {worker.address}: expected one thread, got {worker.state.nthreads}; compiled code is not "
            "shared by threads: start it with --nthreads 1 and as many --nworkers as there are cores"
        )
    if code_of() != code:
        raise WrongWorkerError(
            f"worker {worker.address}: expected the same code as here, got another version; update it there, and "
            "start the worker anew"
        )


def run_piece(trial: Callable[..., Result], arguments: tuple[Any, ...], code: str) -> Result:
    """Run one piece of work.

    Args:
        trial: what to run.
        arguments: of it.
        code: what `code_of` says where the client is.

    Raises:
        WrongWorkerError: the worker, which may have come only now, is none of ours.
        Exception: what the trial raises.
    """
    check_worker(get_worker(), code)
    if "numba" in sys.modules:  # it may have been loaded before the set-up
        sys.modules["numba"].set_num_threads(1)
    # A piece brings no work of its own to the cluster; xarray would ask it for a lock of every file.
    with dask.config.set(scheduler="synchronous"):
        return trial(*arguments)


@cache
def code_of() -> str:
    """Return a checksum of the workspace's Python files when it was first asked for: the same gives the same results.

    A process that stays has what it once loaded, whatever has become of the files since.
    """
    seen = hashlib.sha256()
    for package in PACKAGES:
        found = find_spec(package)
        for place in sorted((found.submodule_search_locations if found else None) or ()):
            for path in sorted(Path(place).rglob("*.py")):
                seen.update(f"{package}/{path.relative_to(place)}\n".encode())
                seen.update(path.read_bytes())
    return seen.hexdigest()
