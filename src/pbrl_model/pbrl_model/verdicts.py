"""What the data do not say: notes that keep a posterior from being read as more than it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbrl_model.diagnostics import convergence
from pbrl_model.parameters import ANGLES
from pbrl_model.posterior import Posterior
from pbrl_model.priors import Prior
from pbrl_model.sensing.motion import Motion
from pbrl_model.symmetry import canonical_wheel

Array = NDArray[np.float64]

LEARNED_SHARE = 0.6
"""A posterior wider than this share of its prior has learned nothing worth a number."""
DISAGREE = 1.1
"""Split R-hat above which chains tell different things."""
PRIOR_DRAWS = 2000
MISSING = 3.0
"""A left-out force this many times its most likely size is a thing that the model class does not have."""

UNEXPLAINED = 3.0
"""Poses that are off by this many times their noise are not explained."""
WORTH_SAYING = 0.02
"""A shorter delay between the streams [s] is not worth a sentence."""


def note_on_left_out(noise: Array, usual: float) -> tuple[str, ...]:
    """Return a sentence where the model had to leave out far more force than such models do; none otherwise.

    A caster that is dragged while the push presses the table on it is the usual case: its friction follows its load.

    Args:
        noise: (..., 2) draws of sigma and left-out force [N].
        usual: most likely left-out force [N].
    """
    force = float(np.median(noise[..., 1]))
    if force < MISSING * usual:
        return ()
    return (
        f"something that this model class does not have acts with about {force:.0f} N: the numbers are less sure than "
        "their spreads say",
    )


def note_on_noise(noise: Array) -> tuple[str, ...]:
    """Return a sentence where the poses are off by far more than their own noise: the model does not explain them.

    Args:
        noise: (..., 2) draws of sigma and left-out force [N].
    """
    sigma = float(np.median(noise[..., 0]))
    if sigma < UNEXPLAINED:
        return ()
    return (
        f"no parameters that the prior allows explain the motion: it is off by {sigma:.0f} times the poses' noise; "
        "look at the prior, the model class and the recording before using these numbers",
    )


def note_on_wrench(error: float) -> tuple[str, ...]:
    """Return a sentence where no sensor measured the wrenches; none otherwise.

    Args:
        error: how far off they are [N], see `pbrl_model.sensing.wrench_error`.
    """
    if error == 0.0:
        return ()
    return (f"the force is not a sensor's: it is off by {error:.2g} N for seconds, and what was learned is as vague",)


def note_on_delay(delay: Array) -> tuple[str, ...]:
    """Return a sentence where the poses are known to come late, or early; none otherwise.

    Args:
        delay: (...) draws of how late the poses come after the wrenches [s].
    """
    mean, sd = float(delay.mean()), float(delay.std())
    if abs(mean) < max(3.0 * sd, WORTH_SAYING):
        return ()
    order = "after" if mean > 0.0 else "before"
    return (f"the poses come {1e3 * abs(mean):.0f} ms {order} the wrenches, +- {1e3 * sd:.0f} ms: this is allowed for",)


def notes_on(
    posterior: Posterior, prior: Prior, motions: Sequence[Motion], rng: np.random.Generator
) -> tuple[str, ...]:
    """Return sentences on what this posterior must not be asked.

    Args:
        posterior: of one object.
        prior: over the same parameters, tied ones left out.
        motions: the episodes it was learned from.
        rng: draws from the prior to compare with.
    """
    notes = []
    moved = max(float(np.ptp(motion.state[:, :2], axis=0).max()) for motion in motions)
    turned = max(float(np.ptp(motion.state[:, 2])) for motion in motions)
    noise = max(float(motion.noise[:2].max()) for motion in motions)
    if moved < 3.0 * noise and turned < 0.02:
        notes.append(f"the data do not say how {posterior.object} moves: it moved less than {max(moved, 1e-3):.3f} m")
    draws = canonical_wheel(prior.sample(rng, PRIOR_DRAWS), prior.names)
    after = dict(zip(posterior.names, posterior.sd(), strict=True))
    vague = [
        name
        for name, before in zip(prior.names, draws.std(axis=0), strict=True)
        if name not in ANGLES and after[name] > LEARNED_SHARE * before
    ]
    if vague:
        notes.append(f"the data do not say {', '.join(vague)}: as wide after the fit as before")
    if len(posterior.draws) > 1:
        apart = [
            name
            for name, found in convergence(posterior).items()
            if name not in ANGLES and name not in vague and found.rhat > DISAGREE
        ]
        if apart:
            notes.append(f"the chains do not agree on {', '.join(apart)}: several explanations remain, or run longer")
    return tuple(notes)


def note_on_unheard(count: int) -> tuple[str, ...]:
    """Return what to know of holds, so many, that were under way when their force was first recorded."""
    if not count:
        return ()
    holds = "a hold was" if count == 1 else f"{count} holds were"
    return (f"{holds} under way when recording began, and left out: start recording a second before the grasp",)
