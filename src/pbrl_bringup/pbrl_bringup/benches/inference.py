"""Posterior and evidence of one wheel with two modes: ours, and other people's samplers on the same data in one run.

Times are CPU seconds of one thread each, compilation left out. The samplers are fetched into a virtual environment of
their own on first use (`requirements/bench.txt`); the product does not depend on them.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import sysconfig
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bringup.benches.cabinet import data_file
from pbrl_bringup.benches.inference_case import LOG_EVIDENCE, second_share
from pbrl_bringup.benches.rows import Measured, Row, at_least
from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import THREADS, in_parallel
from pbrl_bringup.paths import workspace
from pbrl_bringup.terminal import output, progress, say, table
from pbrl_model.inference.infer import InferenceOptions, infer
from pbrl_model.inference.open_loop import wheel_evidence

SEEDS, QUICK_SEEDS = 20, 3
SLACK = 0.1  # [nat]
SHARES = (0.45, 0.55)
FULL = ("ultranest", "dynesty", "emcee", "pymc-smc", "pymc-metropolis-pymunk")
QUICK = ("pymc-metropolis-pymunk",)
BUDGET, QUICK_BUDGET = 60.0, 10.0  # [s] of Metropolis, which has no end of its own


@dataclass(frozen=True)
class Ours:
    """One seed of ours.

    Attributes:
        seed: of every random draw.
        cpu: seconds.
        calls: likelihood rows.
        ess: effective samples.
        log_evidence: [nat].
        log_evidence_sd: as claimed [nat].
        pareto_k: of the weights.
        second: share of the second mode.
        converged: as it says itself.
    """

    seed: int
    cpu: float
    calls: int
    ess: float
    log_evidence: float
    log_evidence_sd: float
    pareto_k: float
    second: float
    converged: bool

    @property
    def right(self) -> bool:
        """Tell whether the evidence is near the known one and both modes have their shares, and it says so."""
        near = abs(self.log_evidence - LOG_EVIDENCE) <= SLACK
        return self.converged and near and SHARES[0] <= self.second <= SHARES[1]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Run ours for consecutive seeds and every peer once, and compare."""
    folder = data_file("wheel_evidence/recording.npz").parent
    python = peers_python()
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    ours = in_parallel(run_ours, [(number, folder) for number in seeds], "seeds")
    names = QUICK if quick else FULL
    peers = run_peers(python, names, seed, QUICK_BUDGET if quick else BUDGET, folder)
    output().print(table("routes", COLUMNS, route_rows(ours, peers), right=tuple(range(1, len(COLUMNS)))))
    rows = [evidence_row(ours)]
    if "ultranest" in peers:
        rows.append(ultranest_row(ours, peers["ultranest"]))
    rows.append(metropolis_row(ours, peers["pymc-metropolis-pymunk"]))
    return Measured(rows, {"ours": [asdict(each) for each in ours], "peers": peers})


def run_ours(seed: int, folder: Path) -> Ours:
    """Infer once, the clock started when everything is compiled."""
    problem = wheel_evidence(folder, parallel=False)
    infer(np.random.default_rng(0), problem, InferenceOptions.modest())
    started = time.process_time()
    found = infer(np.random.default_rng(seed), problem)
    cpu = time.process_time() - started
    weights = np.exp(found.log_weights - found.log_weights.max())
    return Ours(
        seed,
        cpu,
        found.calls,
        found.ess,
        found.log_evidence,
        found.log_evidence_sd,
        found.pareto_k,
        second_share(found.samples, weights),
        found.converged,
    )


def evidence_row(ours: Sequence[Ours]) -> Row:
    """Return the row of seeds whose evidence and shares are right."""
    errors = [each.log_evidence - LOG_EVIDENCE for each in ours]
    return at_least(
        f"wheel_evidence: seeds with log evidence within {SLACK} of {LOG_EVIDENCE:.2f} and each mode's share in "
        f"{SHARES[0]}-{SHARES[1]}, of {len(ours)}",
        sum(each.right for each in ours),
        "1",
        len(ours),
        mean_log_evidence=float(np.mean([each.log_evidence for each in ours])),
        sd_over_seeds=float(np.std([each.log_evidence for each in ours])),
        sd_claimed=float(np.median([each.log_evidence_sd for each in ours])),
        worst_error=float(max(errors, key=abs)),
        least_share=min(min(each.second, 1 - each.second) for each in ours),
        worst_pareto_k=max(each.pareto_k for each in ours),
        cpu_s=median_cpu(ours),
    )


def ultranest_row(ours: Sequence[Ours], peer: dict[str, Any]) -> Row:
    """Return the row of UltraNest's CPU time over ours, both on the same compiled likelihood."""
    return at_least(
        "CPU time to a posterior with evidence: UltraNest on the same compiled likelihood over ours",
        peer["cpu"] / median_cpu(ours),
        "1",
        50.0,
        ultranest_cpu_s=peer["cpu"],
        ultranest_in_likelihood_s=peer["cpu_likelihood"],
        ultranest_calls=peer["calls"],
        ultranest_log_evidence=peer["log_evidence"],
        ultranest_second_mode=peer["second"],
        ours_cpu_s=median_cpu(ours),
        ours_slowest_cpu_s=max(each.cpu for each in ours),
        ours_calls=float(np.median([each.calls for each in ours])),
    )


def metropolis_row(ours: Sequence[Ours], peer: dict[str, Any]) -> Row:
    """Return the row of CPU time an effective sample, the thesis's way over ours."""
    theirs, own = peer["cpu"] / peer["ess"], float(np.median([each.cpu / each.ess for each in ours]))
    return at_least(
        "CPU time an effective sample: PyMC Metropolis over pymunk over ours",
        theirs / own,
        "1",
        300.0,
        metropolis_s=theirs,
        metropolis_effective_samples=peer["ess"],
        metropolis=peer["note"],
        ours_s=own,
        ours_effective_samples=float(np.median([each.ess for each in ours])),
    )


def median_cpu(ours: Sequence[Ours]) -> float:
    """Return the median CPU seconds over seeds."""
    return float(np.median([each.cpu for each in ours]))


COLUMNS = ("route", "CPU s", "of it likelihood", "calls", "effective", "log evidence", "second mode", "R-hat")


def route_rows(ours: Sequence[Ours], peers: dict[str, dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return what each route did, as text; ours is the seed of median time."""
    middle = sorted(ours, key=lambda each: each.cpu)[len(ours) // 2]
    rows = [_route(f"ours, median of {len(ours)} seeds", {**asdict(middle), "cpu_likelihood": None, "rhat": None})]
    return rows + [_route(name, peer) for name, peer in peers.items()]


def _route(name: str, did: dict[str, Any]) -> tuple[str, ...]:
    evidence = "–" if math.isnan(did["log_evidence"]) else f"{did['log_evidence']:.2f} ± {did['log_evidence_sd']:.2f}"
    return (
        name,
        f"{did['cpu']:.2f}",
        "–" if did["cpu_likelihood"] is None else f"{did['cpu_likelihood']:.1f}",
        f"{did['calls']}",
        f"{did['ess']:.0f}",
        evidence,
        f"{did['second']:.2f}",
        "–" if did["rhat"] is None or math.isnan(did["rhat"]) else f"{did['rhat']:.2f}",
    )


def run_peers(python: Path, names: Sequence[str], seed: int, budget: float, folder: Path) -> dict[str, dict[str, Any]]:
    """Run each peer in a process of its own, as many at once as there are cores; return what they did, by name."""
    with progress("other samplers", len(names)) as bar, ThreadPoolExecutor(os.cpu_count()) as pool:
        done = 0

        def run(name: str) -> dict[str, Any]:
            nonlocal done
            found = run_peer(python, name, seed, budget, folder)
            done += 1
            bar(done)
            return found

        return dict(zip(names, pool.map(run, names), strict=True))


def run_peer(python: Path, name: str, seed: int, budget: float, folder: Path) -> dict[str, Any]:
    """Run one peer.

    Raises:
        BringupError: it failed.
    """
    program = "pbrl_bringup.benches.inference_peers"
    command = [str(python), "-m", program, name, str(seed), str(budget), str(folder)]
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    result = subprocess.run(command, capture_output=True, text=True, env=environment)
    if result.returncode:
        said = (result.stderr.strip().splitlines() or ["nothing"])[-1]
        raise BringupError(f"bench inference: {name} failed and said: {said}")
    return dict(json.loads(result.stdout.strip().splitlines()[-1]))


def peers_python() -> Path:
    """Return the Python of the environment with the other samplers; make it first where it is not there.

    It sees this environment's packages behind its own, so that only what the product does not have is fetched.

    Raises:
        BringupError: it cannot be made.
    """
    base = Path(os.environ.get("VIRTUAL_ENV", "out/bench")).resolve() / "cache/inference_peers"
    requirements = workspace() / "requirements/bench.txt"
    python, made_from = base / "bin/python", base / "made_from.txt"
    wanted = requirements.read_text(encoding="utf-8")
    if made_from.is_file() and made_from.read_text(encoding="utf-8") == wanted:
        return python
    say("pbrl: fetching PyMC, UltraNest, dynesty and emcee for this bench alone; once, about two minutes")
    _run([sys.executable, "-m", "venv", "--clear", str(base)])
    packages = next((base / "lib").glob("python3.*")) / "site-packages"
    (packages / "product.pth").write_text(sysconfig.get_paths()["purelib"] + "\n", encoding="utf-8")
    _run([str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r", str(requirements)])
    made_from.write_text(wanted, encoding="utf-8")
    return python


def _run(command: list[str]) -> None:
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode:
        said = next((line for line in result.stderr.splitlines() if line.startswith("ERROR")), "nothing")
        raise BringupError(f"bench inference: could not make the samplers' environment: {said}; is the network there?")
