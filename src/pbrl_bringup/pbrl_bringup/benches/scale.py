"""Many recordings on a Dask cluster of this machine: two workers against one, a worker killed, a thousand queued."""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import signal
import statistics
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import psutil
from distributed import Client

from bullet_sim.scene import load_scene
from pbrl_bag import read_recording
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.scale.cluster import cluster, process_ids
from pbrl_bringup.scale.pieces import Failed, run_pieces
from pbrl_bringup.simulate import simulate_push
from pbrl_bringup.terminal import progress
from pbrl_control.push_plan import load_plan
from pbrl_model.fitting.fit import FitOptions, fit_recording

SCENE, PLAN = "locked_caster", "turn_table"
FITS, QUICK_FITS = 8, 4
ROUNDS, QUICK_ROUNDS = 5, 1
QUEUED, QUICK_QUEUED = 1000, 40
FASTER = 1.7
MEMORY = 50.0  # [MB]
RUNS = "runs.txt"


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Fit one recording with several seeds on clusters of one and of two workers in turn, and queue many.

    Raises:
        BringupError: the push failed, or a piece.
    """
    bag, fits = recorded(seed, out), QUICK_FITS if quick else FITS
    jobs = [(bag, seed + number, out / RUNS) for number in range(fits)]
    rounds = QUICK_ROUNDS if quick else ROUNDS
    (out / RUNS).unlink(missing_ok=True)
    with cluster("local:1") as one, cluster("local:2") as two:
        for client, workers in ((one, 1), (two, 2)):  # libraries are loaded, and kernels from their cache
            list(results(client, jobs[:workers]))
        compiled, seconds, answers, spent = cached(), [], [], []
        with progress("fits", 2 * rounds * fits) as bar:
            for _ in range(rounds):
                for client in (one, two):
                    started, before = time.perf_counter(), cpu(client)
                    answers.append(sorted(results(client, jobs)))
                    seconds.append(time.perf_counter() - started)
                    spent.append(cpu(client) - before)
                    bar(len(seconds) * fits)
        again = cached() - compiled
        killed, runs = with_a_worker_killed(two, jobs, out / RUNS)
        queue = queued(two, bag, QUICK_QUEUED if quick else QUEUED)
    ratios = [alone / both for alone, both in zip(seconds[::2], seconds[1::2], strict=True)]
    differing = sum(each != answers[0] for each in answers)
    rows = [
        at_least(
            f"{fits} fits: time with one worker over time with two, median of {rounds}",
            statistics.median(ratios),
            "1",
            FASTER,
            one_worker_s=statistics.median(seconds[::2]),
            two_workers_s=statistics.median(seconds[1::2]),
            one_worker_cpu_s=statistics.median(spent[::2]),
            two_workers_cpu_s=statistics.median(spent[1::2]),
        ),
        at_most(
            "runs whose results differ in a byte, by number of workers",
            differing,
            "1",
            0,
        ),
        at_most("kernels compiled again by workers", again, "1", 0),
        at_most("results that differ after a worker was killed", killed != answers[0], "1", 0),
        at_most("pieces done again because a worker was killed", runs - fits, "1", 1),
        *queue,
    ]
    return Measured(rows, {"seconds": seconds, "cpu_seconds": spent, "ratios": ratios})


def recorded(seed: int, out: Path) -> Path:
    """Simulate the push that all fit, and return its bag."""
    bag = out / f"push_{seed}"
    shutil.rmtree(bag, ignore_errors=True)
    made = simulate_push(load_scene(SCENE), load_plan(PLAN), seed, bag)
    if made.phase != "done":
        raise BringupError(f"seed {seed}: expected the push {PLAN} to be done, it failed: {made.status}")
    return bag.absolute()


def fitted(bag: Path, seed: int, runs: Path) -> str:
    """Fit a recording, note that it was done, and return a checksum of all draws; runs in a worker."""
    with runs.open("a") as file:
        file.write(f"{seed}\n")
    fit = fit_recording(read_recording(bag), FitOptions(seed=seed))
    seen = hashlib.sha256()
    for name, found in fit.objects.items():
        seen.update(name.encode() + found.posterior.flat.tobytes())
    return f"{seed} {seen.hexdigest()}"


def results(client: Client, jobs: list[tuple[Any, ...]]) -> Iterator[str]:
    """Yield what fits return, as they end."""
    with closing(run_pieces(client, fitted, jobs)) as ended:
        for each in ended:
            if isinstance(each, Failed):
                raise each.error
            yield each.result


def with_a_worker_killed(client: Client, jobs: list[tuple[Any, ...]], runs: Path) -> tuple[list[str], int]:
    """Fit all, and kill a worker at its fit when the first is done; return results and how many fits were begun."""
    runs.unlink()
    processes = process_ids(client)
    found: list[str] = []
    for answer in results(client, jobs):
        if not found:
            busy = next(worker for worker, pieces in client.processing().items() if pieces)
            os.kill(processes[busy], signal.SIGKILL)
        found.append(answer)
    return sorted(found), len(runs.read_text().splitlines())


def samples(bag: Path, number: int) -> int:
    """Read a recording and return how many wrenches it has; runs in a worker."""
    return sum(len(each.time) for each in read_recording(bag).wrenches.values())


def queued(client: Client, bag: Path, count: int) -> list[Row]:
    """Have a recording read many times over as if it were many; look at this process's memory meanwhile."""
    taken, done, ahead = 0, 0, 0

    def jobs() -> Iterator[tuple[Path, int]]:
        nonlocal taken
        for number in range(count):
            taken += 1
            yield bag, number

    mine = psutil.Process()
    before, most = mine.memory_info().rss, 0
    with progress("queued recordings", count) as bar, closing(run_pieces(client, samples, jobs())) as ended:
        for each in ended:
            if isinstance(each, Failed):
                raise each.error
            ahead, done = max(ahead, taken - done), done + 1
            most = max(most, mine.memory_info().rss)
            bar(done)
    held = count * len(pickle.dumps(read_recording(bag))) / 1e6
    added = max(0, most - before) / 1e6
    return [
        at_most(f"memory that {count} queued recordings add here", added, "MB", MEMORY, all_held_MB=held),
        at_most("recordings sent at a time, two workers", ahead, "1", 2),
    ]


def cpu(client: Client) -> float:
    """Return the CPU time [s] that all workers have used."""
    return float(sum(client.run(time.process_time).values()))


def cached() -> int:
    """Return how many files the cache of compiled code has."""
    place = os.environ.get("NUMBA_CACHE_DIR")
    return sum(1 for _ in Path(place).rglob("*.nbc")) if place else 0
