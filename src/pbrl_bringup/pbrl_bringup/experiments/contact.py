"""Section 6.5.3: find a table's locked wheel without touching the table, in random cases (figure 46 shows one).

The robot pushes a square table that it holds into a long one, learns, and pushes the other end too where the first push
did not say where the wheel is. That is decided by the posterior; the truth is used for scores alone.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.contact_cases import PUSHED, random_case
from pbrl_bringup.experiments.contact_figure import draw
from pbrl_bringup.parallel import in_parallel
from pbrl_model.contact.fit import ContactFit, ContactOptions, fit_contact
from pbrl_model.contact.pair import PAIR_NAMES

Array = NDArray[np.float64]

CASES, QUICK_CASES = 30, 4
NEAR = 0.05  # [m] the wheel counts as found
SHARE = 0.9
ENOUGH = 0.05  # [m] where 95 % of the posterior lies within so much, the robot does not push again
LEVEL = 0.95


@dataclass(frozen=True)
class Trial:
    """One case, learned.

    Attributes:
        seed: of the case and of the fit.
        pushes: how many it took.
        first_error: from the posterior mean of the wheel to the truth after the first push [m].
        first_radius: within what of that mean 95 % of the posterior lay then [m].
        first_inside: whether the truth lay in the 95 % region then.
        error: the same in the end [m].
        radius: the same in the end [m].
        inside: the same in the end.
        contact_friction: posterior mean and standard deviation, truth.
        seconds: processor time of the fits.
        notes: of the last fit.
    """

    seed: int
    pushes: int
    first_error: float
    first_radius: float
    first_inside: bool
    error: float
    radius: float
    inside: bool
    contact_friction: tuple[float, float, float]
    seconds: float
    notes: tuple[str, ...]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Learn consecutive seeds' cases in parallel processes; write `figure.png`."""
    seeds = range(seed, seed + (QUICK_CASES if quick else CASES))
    results = in_parallel(run_trial, [(number,) for number in seeds], "cases")
    trials = [trial for trial, _ in results]
    errors = [trial.first_error for trial in trials], [trial.error for trial in trials]
    draw(out / "figure.png", random_case(seed), trials[0].pushes, results[0][1], *errors, NEAR)
    return Measured(rows_of(trials), {"trials": [asdict(trial) for trial in trials]})


def run_trial(seed: int) -> tuple[Trial, Array]:
    """Simulate one case and learn it; return scores and the wheel's draws (n, 2)."""
    case = random_case(seed)
    started = time.process_time()
    options = ContactOptions(seed=seed)
    first = fit_contact(case.recordings[0], PUSHED, options)
    again = first.radius > ENOUGH
    last = fit_contact(case.recordings[1], PUSHED, options) if again else first
    seconds = time.process_time() - started
    truth = case.truth
    drawn = last.pair[:, PAIR_NAMES.index("contact_friction")]
    friction = float(drawn.mean()), float(drawn.std()), truth.contact_friction
    scores = (*_scores(first, truth.wheel), *_scores(last, truth.wheel))
    return Trial(seed, 1 + int(again), *scores, friction, seconds, last.notes), last.wheels


def rows_of(trials: list[Trial]) -> list[Row]:
    """Return the acceptance rows over all cases."""
    near = [trial.error <= NEAR for trial in trials]
    first_near = [trial.first_error <= NEAR for trial in trials]
    sure = [trial for trial in trials if trial.first_radius <= ENOUGH]
    return [
        at_least(
            f"cases whose wheel is within 5 cm, share of {len(trials)}",
            float(np.mean(near)),
            "1",
            SHARE,
            thesis="one case (figure 46); accuracy not established",
            after_one_push=float(np.mean(first_near)),
            after_one_push_where_it_seemed_enough=_share([trial.first_error <= NEAR for trial in sure]),
            share_pushed_again=1.0 - len(sure) / len(trials),
            truth_inside_95_percent_region=float(np.mean([trial.inside for trial in trials])),
            truth_inside_95_percent_region_after_one_push=float(np.mean([trial.first_inside for trial in trials])),
        ),
        at_most(
            "distance of the wheel from the truth, median",
            float(np.median([trial.error for trial in trials])),
            "m",
            NEAR,
            thesis="not given",
            after_one_push_m=float(np.median([trial.first_error for trial in trials])),
            worst_m=max(trial.error for trial in trials),
            contact_friction_rms_error=_rms(
                [trial.contact_friction[0] - trial.contact_friction[2] for trial in trials]
            ),
            contact_friction_rms_sd=_rms([trial.contact_friction[1] for trial in trials]),
        ),
    ]


def _scores(fit: ContactFit, truth: Array) -> tuple[float, float, bool]:
    return float(np.hypot(*(fit.wheel - truth))), fit.radius, fit.level(truth) <= LEVEL


def _share(flags: list[bool]) -> float:
    return float(np.mean(flags)) if flags else float("nan")


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
