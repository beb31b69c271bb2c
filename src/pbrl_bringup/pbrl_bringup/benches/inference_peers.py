"""Other people's samplers on the wheel with two modes: a program of its own, run where they are installed.

`python -m pbrl_bringup.benches.inference_peers NAME SEED BUDGET RECORDING` prints one line of JSON. Each is used near
its defaults, with one thread, and given our compiled likelihood, many rows in a call where it can; but for the thesis's
own way, which is Metropolis over pymunk.
"""

from __future__ import annotations

import json
import logging
import math
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import dynesty
import emcee
import numpy as np
import pymc as pm
import pytensor.tensor as pt
import ultranest
from numpy.typing import NDArray
from pymunk import Vec2d
from pytensor.graph.basic import Apply
from pytensor.graph.op import Op
from ultranest.popstepsampler import PopulationSliceSampler, generate_mixture_random_direction

from pbrl_bringup.benches.inference_case import SD, TRUTH, second_share
from pbrl_model.arviz_import import az
from pbrl_model.inference.open_loop import OpenLoop, wheel_evidence
from pbrl_model.parameters import BodyParameters, expand
from pbrl_model.world import BodySpec, PhysicsWorld

Array = NDArray[np.float64]

FOOTPRINT = np.array([[-0.4, -0.25], [0.4, -0.25], [0.4, 0.25], [-0.4, 0.25]])
SWEEPS = 10  # Chipmunk's default; a hundred give the same log likelihood here


@dataclass(frozen=True)
class Outcome:
    """What a sampler did.

    Attributes:
        cpu: seconds of sampling, of this process.
        cpu_likelihood: of them in the likelihood.
        calls: likelihood rows.
        ess: effective samples, of the worst parameter.
        log_evidence: [nat]; NaN where the sampler gives none.
        log_evidence_sd: as it claims.
        second: share of the second mode.
        rhat: of the worst parameter; NaN for a single chain and where weights are used.
        note: what to know.
    """

    cpu: float
    cpu_likelihood: float
    calls: int
    ess: float
    log_evidence: float
    log_evidence_sd: float
    second: float
    rhat: float = math.nan
    note: str = ""


class Likelihood:
    """Our compiled likelihood, counted and timed."""

    def __init__(self, problem: OpenLoop) -> None:
        self.problem = problem
        self.low, self.high = problem.bounds
        self.calls, self.cpu = 0, 0.0
        self.evaluate(TRUTH[None])  # compiled before anything is timed
        self.evaluate(np.repeat(TRUTH[None], 64, axis=0))
        self.calls, self.cpu = 0, 0.0

    def evaluate(self, theta: Array) -> Array:
        """Return (P,) log likelihoods of (P, 7) within the prior's support."""
        started = time.process_time()
        values = self._values(np.asarray(theta, dtype=float))
        self.cpu += time.process_time() - started
        self.calls += len(theta)
        return values

    def _values(self, theta: Array) -> Array:
        return self.problem.log_likelihood(theta)

    def one(self, theta: Array) -> float:
        """Return the log likelihood of one row (7,)."""
        return float(self.evaluate(np.asarray(theta)[None])[0])

    def from_cube(self, cube: Array) -> Array:
        """Return theta of points of the unit cube: the prior is uniform."""
        return self.low + cube * (self.high - self.low)

    def posterior(self, theta: Array) -> Array:
        """Return (P,) log posterior densities, -inf outside the prior's support."""
        inside = np.all((theta >= self.low) & (theta <= self.high), axis=1)
        out = np.full(len(theta), -np.inf)
        if inside.any():
            out[inside] = self.evaluate(theta[inside])
        return out


class PymunkLikelihood(Likelihood):
    """The same likelihood through the pymunk world, as the thesis's engine does it: every step from Python."""

    def _values(self, theta: Array) -> Array:
        return np.array([self._value(row) for row in theta])

    def _value(self, theta: Array) -> float:
        problem = self.problem
        row = expand(theta[None, :-1], problem.names[:-1], problem.base)[0]
        parameters = BodyParameters.from_vector(row)
        parameters = replace(parameters, mu_x=problem.load * parameters.mu_x, mu_y=problem.load * parameters.mu_y)
        world = PhysicsWorld(problem.dt, SWEEPS)
        world.add_body(BodySpec("table", FOOTPRINT, parameters, np.zeros(3)))
        (body,) = world.space.bodies
        poses = np.empty((len(problem.poses) + 2, 3))
        for k, (fx, fy, tau) in enumerate([*problem.wrench.tolist(), (0.0, 0.0, 0.0)]):
            # The wrench turns with the heading that the body has once this step's pose has advanced.
            body.force = Vec2d(fx, fy).rotated(body.angle + body.angular_velocity * problem.dt)
            body.torque = tau
            world.step()
            poses[k + 1] = *body.position, body.angle
        squares = np.sum(((poses[2:] - problem.poses) / problem.noise) ** 2)
        count = problem.poses.size
        constant = -0.5 * count * math.log(2 * math.pi) - len(problem.poses) * np.sum(np.log(problem.noise))
        return float(constant - count * theta[-1] - 0.5 * squares * np.exp(-2 * theta[-1]))


def weighted_ess(log_weights: Array) -> tuple[float, Array]:
    """Return Kish's effective sample size and the normalised weights."""
    weights = np.exp(log_weights - log_weights.max())
    weights = weights / weights.sum()
    return float(1.0 / np.sum(weights**2)), weights


def chains_of(draws: Array) -> tuple[float, float]:
    """Return bulk effective samples and R-hat of the worst parameter of chains (C, n, 7)."""
    ess = min(float(az().ess(draws[..., k])) for k in range(draws.shape[-1]))
    rhat = max(float(az().rhat(draws[..., k])) for k in range(draws.shape[-1])) if len(draws) > 1 else math.nan
    return ess, rhat


def run_ultranest(likelihood: Likelihood, rng: np.random.Generator, budget: float) -> Outcome:
    """Nested sampling with population slice steps, every call many rows."""
    np.random.seed(int(rng.integers(2**31)))  # noqa: NPY002 - it has no generator of its own
    names = list(likelihood.problem.names)
    started = time.process_time()
    sampler = ultranest.ReactiveNestedSampler(names, likelihood.evaluate, likelihood.from_cube, vectorized=True)
    sampler.stepsampler = PopulationSliceSampler(
        popsize=64, nsteps=4 * len(names), generate_direction=generate_mixture_random_direction
    )
    result = sampler.run(show_status=False, viz_callback=False)
    cpu = time.process_time() - started
    weighted = result["weighted_samples"]
    weights = np.asarray(weighted["weights"])
    share = second_share(np.asarray(weighted["points"]), weights)
    return Outcome(
        cpu, likelihood.cpu, likelihood.calls, float(result["ess"]), result["logz"], result["logzerr"], share
    )


def run_dynesty(likelihood: Likelihood, rng: np.random.Generator, budget: float) -> Outcome:
    """Nested sampling with random walks; it asks for one row at a time."""
    started = time.process_time()
    sampler = dynesty.NestedSampler(likelihood.one, likelihood.from_cube, 7, nlive=250, sample="rwalk", rstate=rng)
    sampler.run_nested(print_progress=False)
    cpu = time.process_time() - started
    result = sampler.results
    ess, weights = weighted_ess(np.asarray(result.logwt))
    share = second_share(np.asarray(result.samples), weights)
    return Outcome(cpu, likelihood.cpu, likelihood.calls, ess, result.logz[-1], result.logzerr[-1], share)


def run_emcee(likelihood: Likelihood, rng: np.random.Generator, budget: float) -> Outcome:
    """Move an ensemble of walkers by differential evolution, started from the prior."""
    walkers, steps = 64, 6000
    start = likelihood.from_cube(rng.random((walkers, 7)))
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    sampler = emcee.EnsembleSampler(walkers, 7, likelihood.posterior, moves=moves, vectorize=True)
    sampler.random_state = np.random.RandomState(int(rng.integers(2**31))).get_state()
    started = time.process_time()
    sampler.run_mcmc(start, steps)
    cpu = time.process_time() - started
    draws = sampler.get_chain(discard=steps // 2).transpose(1, 0, 2)
    ess, rhat = chains_of(draws)
    return Outcome(
        cpu, likelihood.cpu, likelihood.calls, ess, math.nan, math.nan, second_share(draws.reshape(-1, 7)), rhat
    )


def run_pymc_smc(likelihood: Likelihood, rng: np.random.Generator, budget: float) -> Outcome:
    """Tempered sequential Monte Carlo from the prior; it asks for one row at a time."""
    with model_of(likelihood):
        started = time.process_time()
        trace = pm.sample_smc(draws=1000, chains=1, cores=1, random_seed=int(rng.integers(2**31)), progressbar=False)
    cpu = time.process_time() - started
    draws = np.stack([trace.posterior[name].values for name in likelihood.problem.names], -1)
    # One list of all stages for the chain; what counts is its last finite value.
    stages = np.hstack([np.ravel(each) for each in trace.sample_stats["log_marginal_likelihood"].values.ravel()])
    evidence = stages.astype(float)
    ess, rhat = chains_of(draws)
    return Outcome(
        cpu,
        likelihood.cpu,
        likelihood.calls,
        ess,
        float(evidence[np.isfinite(evidence)][-1]),
        math.nan,
        second_share(draws.reshape(-1, 7)),
        rhat,
    )


def run_metropolis(likelihood: Likelihood, rng: np.random.Generator, budget: float) -> Outcome:
    """PyMC's Metropolis, one parameter after another, with pymunk's time for every call: the thesis's way.

    It is started at the truth with steps of the posterior's width, for from the prior it would not arrive. It mixes so
    slowly that some minutes of it through pymunk have one effective sample or two. So the chain is run on the compiled
    likelihood, which gives the same numbers, for more draws; the time of a call is measured on pymunk, and nothing but
    these calls is counted. Even so its effective samples are too few to be told well: there are fewer, if anything.
    """
    through_pymunk = PymunkLikelihood(likelihood.problem)
    around = TRUTH + SD * rng.standard_normal((40, 7))
    difference = float(np.abs(through_pymunk.evaluate(around) - likelihood.evaluate(around)).max())
    each = through_pymunk.cpu / through_pymunk.calls
    draws = int(60 * budget)
    with model_of(likelihood) as model:
        # PyMC moves in the logit of the prior's range; a posterior's width there is this many times as wide.
        cube = (TRUTH - likelihood.low) / (likelihood.high - likelihood.low)
        widths = SD / (likelihood.high - likelihood.low) / (cube * (1.0 - cube))
        steps = [
            pm.Metropolis([model[name]], S=np.array([width]))
            for name, width in zip(likelihood.problem.names, widths, strict=True)
        ]
        likelihood.calls, likelihood.cpu = 0, 0.0
        trace = pm.sample(
            draws,
            tune=draws // 10,
            step=steps,
            chains=1,
            cores=1,
            initvals=dict(zip(likelihood.problem.names, TRUTH.tolist(), strict=True)),
            random_seed=int(rng.integers(2**31)),
            progressbar=False,
            compute_convergence_checks=False,
        )
    found = np.stack([trace.posterior[name].values for name in likelihood.problem.names], -1)
    ess, rhat = chains_of(found)
    cpu = each * likelihood.calls * draws / (draws + draws // 10)  # tuning is not counted
    note = (
        f"{draws} draws from a start at the truth on the compiled likelihood; cpu = calls x {1e3 * each:.2f} ms of "
        f"pymunk, whose log likelihoods differ from ours by {difference:.1e} at most"
    )
    return Outcome(cpu, cpu, likelihood.calls, ess, math.nan, math.nan, second_share(found.reshape(-1, 7)), rhat, note)


class _LogLikelihood(Op):
    """The likelihood as PyTensor sees it: a vector in, a number out."""

    def __init__(self, likelihood: Likelihood) -> None:
        self.likelihood = likelihood

    def make_node(self, theta: object) -> Apply:
        """Return the node of the graph."""
        return Apply(self, [pt.as_tensor_variable(theta)], [pt.dscalar()])

    def perform(self, node: Apply, inputs: list[Array], outputs: list[list[Array]]) -> None:
        """Evaluate."""
        outputs[0][0] = np.asarray(self.likelihood.one(inputs[0]))


def model_of(likelihood: Likelihood) -> pm.Model:
    """Return the PyMC model: uniform priors and the likelihood."""
    with pm.Model() as model:
        ends = zip(likelihood.problem.names, likelihood.low, likelihood.high, strict=True)
        theta = pt.stack([pm.Uniform(name, low, high) for name, low, high in ends])
        pm.Potential("likelihood", _LogLikelihood(likelihood)(theta))
    return model


SAMPLERS: dict[str, Callable[[Likelihood, np.random.Generator, float], Outcome]] = {
    "ultranest": run_ultranest,
    "dynesty": run_dynesty,
    "emcee": run_emcee,
    "pymc-smc": run_pymc_smc,
    "pymc-metropolis-pymunk": run_metropolis,
}


def main(name: str, seed: str, budget: str, recording: str) -> None:
    """Run one sampler and print what it did."""
    warnings.simplefilter("ignore")
    for noisy in ("pymc", "ultranest", "pytensor"):
        logging.getLogger(noisy).setLevel(logging.ERROR)
    likelihood = Likelihood(wheel_evidence(Path(recording), parallel=False))
    outcome = SAMPLERS[name](likelihood, np.random.default_rng(int(seed)), float(budget))
    print(json.dumps(asdict(outcome)))


if __name__ == "__main__":
    main(*sys.argv[1:])
