"""Learn a body that is only ever touched by another: its wheel through contact (thesis 6.5.3, figure 46).

    fit = fit_contact(recording, "long_table")
    fit.wheel, fit.radius, fit.notes, fit.posterior.summary()

Three steps. While nothing is touched, the held body's mass, its friction on the floor and the sensor's bias are
learned. In touch, Newton's third law makes of the gripper's wrench one on the other body (`contact_wrench.py`), which
is then learned as if it were held: modes on the compiled kernel, importance sampling. Last, the pair's contact
friction: both bodies simulated together (`contact_pair.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import gaussian_kde

from pbrl_bag.types import BodyGeometry, Recording
from pbrl_model.contact.episodes import TOUCHING, Approach, Touch, approach, touches
from pbrl_model.contact.pair import PAIR_NAMES, PairLikelihood, learn_pair
from pbrl_model.contact.wrench import HeldBody
from pbrl_model.engines.contact_world import contact_scene
from pbrl_model.errors import ModelError
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.fitting.sampling import Sampled, sampled
from pbrl_model.fitting.starts import SearchPlan, find_modes
from pbrl_model.fitting.target import Target
from pbrl_model.parameters import ANGLES, BodyParameters
from pbrl_model.posterior import Posterior
from pbrl_model.prior_options import PriorOptions
from pbrl_model.priors import Prior, table2_prior
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import shooting_windows
from pbrl_model.symmetry import wrap
from pbrl_model.verdicts import note_on_left_out, notes_on

Array = NDArray[np.float64]

MODEL_CLASS = "wheel+ground"
HELD_WINDOW = 2.0
"""Length of windows [s] in which the held body is learned: the longer, the better the bias is known."""
KNOWN = 0.10
"""A wheel whose 95 % region reaches further [m] than this from its middle is not found."""
MASS_KNOWN = 0.15
"""A held body whose mass is known to no better than this share adds to what is not known of the force."""
NO_FORCE = 1e-9
"""A wrench [N] that never exceeds this was not measured."""
PAIR_KNOWN = 0.15
"""A coefficient of the pair with a larger standard deviation is not known; a uniform one has 0.29."""
LEAST_PUSH, LEAST_TURN = 0.03, math.radians(5.0)
"""A body that moved [m] and turned [rad] less than this was not pushed enough to learn from."""
LEAST_DELAY, DELAY_ROUNDS = 0.01, 3
"""A delay between poses and wrenches that is worth another look [s], and how many looks are taken."""
KDE_DRAWS = 1000
CHAINS = {"count": 4, "burn_in": 1000, "thin": 8}
"""Metropolis chains where importance weights collapse, as `fit` has them."""
SEARCH_WINDOWS, SEARCH_KEEP, SEARCH_ITERATIONS = (0.5, 1.0), (16, 6, 4), (6, 8, 15)
"""Lengths of the search's windows before the last [s]; modes kept and iterations of each stage."""


@dataclass(frozen=True)
class ContactOptions:
    """Settings of `fit_contact`.

    Attributes:
        window: length of a window [s].
        draws: from the posterior.
        search_draws: from the prior that the search starts with.
        left_out_force: most likely size of what the model leaves out in a window [N]: the sensor's bias that was not
            found, the held body's motion that was not smoothed right.
        priors: settings of table 2's priors.
        pair: whether to learn the pair's contact friction as well.
        seed: of every random draw.
    """

    window: float = 1.5
    draws: int = 2000
    search_draws: int = 600
    left_out_force: float = 1.0
    priors: PriorOptions = field(default_factory=PriorOptions)
    pair: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (("window", 0.2), ("draws", 100), ("search_draws", 10), ("left_out_force", 1e-3)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= least):
                raise ModelError(f"contact options: expected {name} of at least {least:g}, got {value!r}")
        if self.seed < 0:
            raise ModelError(f"contact options: expected a seed of at least zero, got {self.seed}")


@dataclass(frozen=True)
class ContactFit:
    """What was learned through contact.

    Attributes:
        held: the held body, learned while it touched nothing.
        posterior: of the pushed body.
        pair: (n, 2) draws of `contact_pair.PAIR_NAMES`; empty where they were not asked for.
        touches: when the two touched, with the forces on both.
        notes: what the data do not say, in sentences.
    """

    held: HeldBody
    posterior: Posterior
    pair: Array
    touches: tuple[Touch, ...]
    notes: tuple[str, ...]

    @property
    def wheels(self) -> Array:
        """Return the posterior's draws (n, 2) of the wheel's place in the pushed body's frame [m]."""
        return _wheels(self.posterior)

    @property
    def wheel(self) -> Array:
        """Return their mean (2,) [m]."""
        return self.wheels.mean(axis=0)

    @property
    def radius(self) -> float:
        """Return within what distance [m] of their mean 95 % of them lie."""
        return _radius(self.wheels)

    @property
    def found(self) -> bool:
        """Tell whether the data say where the wheel is."""
        return self.radius <= KNOWN

    def level(self, place: ArrayLike) -> float:
        """Return the share of the posterior that is denser than it is at a place (2,) [m]: below 0.95, it is inside.

        The density is a kernel estimate on the draws.
        """
        draws = self.wheels[:KDE_DRAWS].T
        density = gaussian_kde(draws)
        return float(np.mean(density(draws) > density(np.asarray(place, dtype=float))))

    def to_report(self) -> dict[str, Any]:
        """Return the pushed body's part of a report, in the form of `fit`; contact's coefficients are the pair's."""
        evidence = self.posterior.log_evidence
        pair = {
            name: {"mean": float(column.mean()), "sd": float(column.std()), "unit": "1"}
            for name, column in zip(PAIR_NAMES, self.pair.T, strict=True)
            if column.size
        }
        return {
            "parameters": self.posterior.summary() | pair,
            "log_evidence": evidence if math.isfinite(evidence) else None,
            "notes": list(self.notes),
        }


def fit_contact(recording: Recording, pushed: str, options: ContactOptions | None = None) -> ContactFit:
    """Learn a body from how it moved when the held one was pushed into it.

    Args:
        recording: poses of both, the gripper's wrench, both footprints.
        pushed: name of the body that nothing touched but the held one.
        options: None: the defaults.

    Raises:
        ModelError: a stream is missing, nothing was held, or the two never touched.
        BagError: an episode is malformed.
    """
    chosen = options or ContactOptions()
    rng = np.random.default_rng(chosen.seed)
    found, held = _learn_held(rng, recording, pushed, chosen)
    if not found.spans:
        raise ModelError(
            f"contact: expected {found.held} to touch {pushed}, it came no nearer than {found.nearest:.3f} m "
            f"(below {TOUCHING} m counts); push on, or check the footprints"
        )
    pairs = touches(recording, found, held)
    if max(float(np.abs(pair.held.wrench).max()) for pair in pairs) < NO_FORCE:
        raise ModelError(f"{found.held}: expected a force while it was held, got zero throughout; was the sensor on?")
    posterior, notes = _learn_pushed(rng, recording.bodies[pushed], found, pairs, chosen)
    if held.mass_sd > MASS_KNOWN * held.parameters.mass:
        notes += (f"how heavy {found.held} is was not seen before it touched; shake it first, or forces are less sure",)
    pair = np.empty((0, len(PAIR_NAMES)))
    if chosen.pair:
        scene = contact_scene([recording.bodies[name].footprint for name in (found.held, pushed)])
        pair = learn_pair(rng, PairLikelihood(scene, held, pairs, chosen.window), posterior.rows())
        notes += _doubts_of_pair(pair)
    return ContactFit(held, posterior, pair, pairs, notes)


def _learn_held(
    rng: np.random.Generator, recording: Recording, pushed: str, options: ContactOptions
) -> tuple[Approach, HeldBody]:
    """Learn the held body while nothing is touched; where poses prove late, put the wrenches onto their clock."""
    delay = 0.0
    for _ in range(DELAY_ROUNDS):
        found = approach(recording, pushed, delay)
        held, late, deviation = learn_held(rng, recording.bodies[found.held], found, options)
        if abs(late - delay) < max(LEAST_DELAY, deviation):
            break
        delay = late
    return found, held


def learn_held(
    rng: np.random.Generator, geometry: BodyGeometry, found: Approach, options: ContactOptions
) -> tuple[HeldBody, float, float]:
    """Learn mass, friction on the floor and the sensor's bias from motion in which nothing is touched.

    Returns:
        The held body, by how much poses come after wrenches [s], and the standard deviation of that.

    Raises:
        ModelError: there is no such motion.
    """
    if not found.free:
        raise ModelError(
            f"contact: expected {found.held} to move free of {found.pushed} for a while, to learn what it weighs, "
            "got none; start recording earlier"
        )
    whole = table2_prior(geometry, MODEL_CLASS, options.priors)
    prior = Prior({name: whole.parts[name] for name in ("mass", "mu_ground")})
    target = _target(prior, WindowedLikelihood(found.held_body, shooting_windows(found.free, HELD_WINDOW)), options)
    plan = SearchPlan(max(options.search_draws // 4, 10), (4, 2), (0.5,), (6, 15))
    best = find_modes(rng, target, found.free, plan).take(np.array([0]))
    left_out = best.point.linear.nuisance[0, :, 6:].mean(axis=0)
    bias = left_out * np.array([1.0, 1.0, target.likelihood.lever])
    parameters = BodyParameters.from_vector(target.rows(best.point.position)[0])
    column = target.simulated - 1
    deviation = math.sqrt(float(best.covariance[0, column, column]))
    mass_sd = math.sqrt(float(best.covariance[0, 0, 0]))
    held = HeldBody(parameters, found.held_body, bias, mass_sd)
    return held, float(target.delay(best.point.position)[0]), deviation


def _target(prior: Prior, likelihood: WindowedLikelihood, options: ContactOptions) -> Target:
    base = BodyParameters(mass=1.0)  # everything that matters is learned
    return Target(prior.names, prior, likelihood, base, left_out_force=options.left_out_force)


def _learn_pushed(
    rng: np.random.Generator, geometry: BodyGeometry, found: Approach, pairs: Sequence[Touch], options: ContactOptions
) -> tuple[Posterior, tuple[str, ...]]:
    motions = tuple(pair.pushed for pair in pairs)
    prior = table2_prior(geometry, MODEL_CLASS, options.priors)
    windows = shooting_windows(motions, options.window)
    target = _target(prior, WindowedLikelihood(found.pushed_body, windows), options)
    lengths = tuple(length for length in SEARCH_WINDOWS if length < options.window)
    stages = len(lengths) + 1
    plan = SearchPlan(options.search_draws, SEARCH_KEEP[-stages:], lengths, SEARCH_ITERATIONS[-stages:])
    draws = sampled(rng, target, find_modes(rng, target, motions, plan), draws=options.draws, **CHAINS)
    posterior = _posterior(found.pushed, target, draws)
    noise = np.exp(draws.position[..., target.simulated :])
    notes = notes_on(posterior, prior, motions, rng) + draws.notes + note_on_left_out(noise, options.left_out_force)
    return posterior, notes + _doubts(posterior, motions)


def _posterior(name: str, target: Target, found: Sampled) -> Posterior:
    draws = found.position[..., : len(target.names)].copy()
    for angle in ANGLES & set(target.names):
        column = target.names.index(angle)
        draws[..., column] = wrap(draws[..., column], 2.0 * math.pi)
    return Posterior(
        name,
        MODEL_CLASS,
        target.names,
        draws,
        target.base,
        log_evidence=found.log_evidence,
        log_evidence_sd=found.log_evidence_sd,
        ess=found.ess,
    )


def _doubts(posterior: Posterior, motions: Sequence[Motion]) -> tuple[str, ...]:
    """Say where the wheel may still be anywhere, and why that may be."""
    radius = _radius(_wheels(posterior))
    if radius <= KNOWN:
        return ()
    moved = max(float(np.hypot(*np.ptp(motion.state[:, :2], axis=0))) for motion in motions)
    turned = max(float(np.ptp(motion.state[:, 2])) for motion in motions)
    why = "push it elsewhere"
    if moved < LEAST_PUSH and turned < LEAST_TURN:
        why = f"it moved {moved:.3f} m and turned {math.degrees(turned):.1f} degrees only; push further"
    elif turned < LEAST_TURN:
        why = "it slid without turning; push it off its middle"
    return (f"the push does not say where the wheel is: 95 % lie within {radius:.2f} m; {why}",)


def _doubts_of_pair(pair: Array) -> tuple[str, ...]:
    vague = [name for name, sd in zip(PAIR_NAMES, pair.std(axis=0), strict=True) if sd > PAIR_KNOWN]
    return (f"the data do not say {' and '.join(vague)} of the contact",) if vague else ()


def _wheels(posterior: Posterior) -> Array:
    return np.stack([posterior.column(name).ravel() for name in ("wheel_x", "wheel_y")], -1)


def _radius(wheels: Array) -> float:
    return float(np.quantile(np.hypot(*(wheels - wheels.mean(axis=0)).T), 0.95))
