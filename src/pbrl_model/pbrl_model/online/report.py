"""What is told of a posterior that is learned online: draws with names, and notes on what they must not be asked."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.fitting.target import NOISE_NAMES
from pbrl_model.online.cloud import Tracked
from pbrl_model.parameters import ANGLES, free_columns
from pbrl_model.posterior import Posterior
from pbrl_model.sensing.motion import Motion
from pbrl_model.symmetry import wrap
from pbrl_model.verdicts import note_on_delay, note_on_left_out, notes_on

Array = NDArray[np.float64]

STUCK = 0.02
"""Share of the proposals taken below which the particles no longer follow what they should."""


def posterior_of(
    rng: np.random.Generator, name: str, model_class: str, tracked: Tracked, motions: tuple[Motion, ...]
) -> Posterior:
    """Return a cloud as a posterior.

    Args:
        rng: draws from the prior that notes compare with.
        name: of the object.
        model_class: that was learned.
        tracked: the cloud.
        motions: that it was learned from.
    """
    target, position = tracked.target, tracked.positions()
    columns = {known: position[:, k] for k, known in enumerate(target.names)}
    columns |= {known: wrap(column, 2 * math.pi) for known, column in columns.items() if known in ANGLES}
    columns |= {copy: columns[source] for copy, source in target.ties.items()}
    names = free_columns(model_class)
    draws = np.stack([columns[known] for known in names], -1)[None]
    stuck = note_on_stuck(tracked)
    evidence = math.nan if stuck else tracked.cloud.log_evidence
    posterior = Posterior(name, model_class, names, draws, target.base, log_evidence=evidence, ess=tracked.cloud.ess)
    noise = {kind: position[:, len(target.names) + k] for k, kind in enumerate(NOISE_NAMES)}
    left_out = np.exp(np.stack([noise["log_sigma"], noise["log_drag"]], -1))
    notes = notes_on(posterior, target.prior, motions, rng) + note_on_left_out(left_out, target.left_out_force)
    return replace(posterior, notes=notes + note_on_delay(noise["delay"]) + stuck)


def note_on_stuck(tracked: Tracked) -> tuple[str, ...]:
    """Return a sentence where the particles could not follow what the last windows made of the posterior."""
    moved = [step.acceptance for step in tracked.steps if step.resampled]
    if not moved or min(moved) >= STUCK:
        return ()
    return (
        f"the particles took {100 * min(moved):.1f} % of their steps only: other explanations may remain; "
        "learn at once from what was heard (/learn)",
    )
