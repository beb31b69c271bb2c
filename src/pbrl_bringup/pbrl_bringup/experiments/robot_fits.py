"""Thesis figure 30 and section 5.5.2: Krang pushes two tables and a cart, and each push is fitted three ways.

The recordings are of Bullet, with casters that swivel, drag and resist, none of which the model class has. The
learner is given the recording alone; the scene's concealed part is read to score what was found, and for nothing else.

An error is that of the last pose of a whole push, predicted open loop from the recorded forces: the root mean square
displacement of the outline's corners, which knows of place and heading, over the seeds.

    a  locked table, expected without learning     d  unlocked table, fitted
    b  locked table, one-step loss (26)            e  cart, expected without learning
    c  locked table, fitted                        f  cart with fixed wheels, fitted
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.robot_fits_figure import draw
from pbrl_bringup.experiments.robot_fits_trials import Case, Trial, record, run_trial
from pbrl_bringup.parallel import in_parallel
from pbrl_model.fitting.fit import FitOptions
from pbrl_model.fitting.options import LikelihoodName

SEEDS, QUICK_SEEDS = 5, 1
NEAR = 0.05  # [m] the wheel counts as found
FOUND = 0.9  # share of the seeds
FAILS = 3.0  # times another loss's final error
STEP: LikelihoodName = "one_step"
END: LikelihoodName = "integrated"
OURS: LikelihoodName = "windowed"
LOSSES = (STEP, END, OURS)
LOCKED = Case("locked table", "locked_caster", "turn_table", "turn_table_heldout")
UNLOCKED = Case("unlocked table", "free_table", "turn_table", "turn_table_heldout")
CART = Case("cart", "utility_cart", "push_cart", "push_cart_heldout")
CASES = (LOCKED, UNLOCKED, CART)
LEARNED_FROM, HELDOUT = 0, 1  # index of the two pushes of a trial


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Simulate, fit and predict every case for consecutive seeds, in parallel processes; draw the first seed."""
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    in_parallel(record, [(case, number, held, out) for case in CASES for number in seeds for held in (0, 1)], "pushes")
    longest_first = reversed(LOSSES)  # so that no core idles in the end
    fits = [
        (case, fit_options(number, loss, quick), out) for loss in longest_first for case in CASES for number in seeds
    ]
    done = in_parallel(run_trial, fits, "fits")
    drawn = {(trial.case, trial.loss): (trial, overlay) for trial, overlay in done if trial.seed == seed}
    draw(drawn, out)
    trials = [trial for trial, _ in done]
    return Measured(rows_of(trials), {"trials": [asdict(trial) for trial in trials]})


def fit_options(seed: int, loss: LikelihoodName, quick: bool) -> FitOptions:
    """Return the options of a fit, given all of the recording; quick ones have short chains and no evidence."""
    chains = {"sampler": "metropolis", "draws": 200, "burn_in": 400} if quick else {}
    return FitOptions(seed=seed, likelihood=loss, holdout_share=0.0, **chains)


def rows_of(trials: Sequence[Trial]) -> list[Row]:
    """Return the rows over all seeds."""
    return [
        found_row(trials, LOCKED, "locked table: seeds whose wheel is within 5 cm of the locked caster"),
        found_row(trials, CART, "cart: seeds whose wheel is within 5 cm of the fixed wheels' axle"),
        fails_row(trials, LOCKED),
        *(heldout_row(trials, case) for case in CASES),
    ]


def found_row(trials: Sequence[Trial], case: Case, what: str) -> Row:
    """Return the row on the wheel, with what the thesis's loss finds beside it."""
    ours, thesis = (_of(trials, case, loss) for loss in (OURS, END))
    against: dict[str, float | str] = {
        "median_m": _median([trial.found.distance for trial in ours]),
        "worst_m": max(trial.found.distance for trial in ours),
        "integrated_within": float(sum(trial.found.distance <= NEAR for trial in thesis)),
        "integrated_median_m": _median([trial.found.distance for trial in thesis]),
        "thesis": "figure 30c, f: a wheel near the true one, distance not stated",
    }
    if math.isfinite(ours[0].found.turn):
        against["median_turn_rad"] = _median([trial.found.turn for trial in ours])
        against["integrated_median_turn_rad"] = _median([trial.found.turn for trial in thesis])
    else:
        against["median_to_contact_m"] = _median([trial.found.contact for trial in ours])
    count = sum(trial.found.distance <= NEAR for trial in ours)
    return at_least(f"{what}, of {len(ours)}", count, "1", math.ceil(FOUND * len(ours)), **against)


def fails_row(trials: Sequence[Trial], case: Case) -> Row:
    """Return the row on the one-step loss: its final error on the recording that it learned from, over the others'."""
    step, end, ours = (_rms(_corners(trials, case, loss, LEARNED_FROM)) for loss in LOSSES)
    return at_least(
        f"{case.name}: final error on the push learned from, one-step over the worse of integrated and windowed",
        step / max(end, ours),
        "1",
        FAILS,
        **_errors(trials, case, LEARNED_FROM),
        thesis="figure 30b: large error in final position",
    )


def heldout_row(trials: Sequence[Trial], case: Case) -> Row:
    """Return the row on the held-out push: final error of our loss over the better of the thesis's two."""
    step, end, ours = (_rms(_corners(trials, case, loss, HELDOUT)) for loss in LOSSES)
    return at_most(
        f"{case.name}: final error on a held-out push, windowed over the better of one-step and integrated",
        ours / min(step, end),
        "1",
        1.0,
        **_errors(trials, case, HELDOUT),
    )


def _errors(trials: Sequence[Trial], case: Case, push: int) -> dict[str, float]:
    """Return root mean square and median of the corners' final errors [m] by loss, and of the unlearned model's."""
    errors: dict[str, list[float]] = {loss: _corners(trials, case, loss, push) for loss in LOSSES}
    errors["unlearned"] = [trial.expected[push].corners for trial in _of(trials, case, OURS)]
    squares = {f"{name}_m": _rms(values) for name, values in errors.items()}
    return squares | {f"{name}_median_m": _median(values) for name, values in errors.items()}


def _of(trials: Sequence[Trial], case: Case, loss: str) -> list[Trial]:
    return [trial for trial in trials if (trial.case, trial.loss) == (case.name, loss)]


def _corners(trials: Sequence[Trial], case: Case, loss: str, push: int) -> list[float]:
    return [trial.learned[push].corners for trial in _of(trials, case, loss)]


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _median(values: Sequence[float]) -> float:
    return float(np.median(values))
