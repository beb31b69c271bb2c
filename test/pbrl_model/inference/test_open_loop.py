"""The recording with a known posterior: likelihood, evidence, both modes, and the same bytes on one core and on two."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.distributions import Uniform
from pbrl_model.errors import ModelError
from pbrl_model.inference.infer import InferenceOptions, infer
from pbrl_model.inference.open_loop import OpenLoop, wheel_evidence
from pbrl_model.priors import Prior

Array = NDArray[np.float64]

DATA = Path(__file__).parents[2] / "data/wheel_evidence"
TRUTH = np.array([18.0, 0.22, -0.08, 0.40, 0.04, 0.45, 0.0])
EVIDENCE = 6307.80
MEAN = np.array([17.9990, 0.22013, -0.08014, 0.40007, 0.04003, 0.44984, 0.0177])
SD = np.array([0.0027, 0.000058, 0.000085, 0.00028, 0.000082, 0.00033, 0.0177])


@pytest.fixture(scope="module")
def problem() -> OpenLoop:
    return wheel_evidence(DATA)


def swept(sweeps: int) -> Array:
    """Return the poses (500, 3) at the truth, step by step as the data's README says, with Gauss-Seidel sweeps."""
    wrench = np.load(DATA / "recording.npz")["wrench"]
    mass, wheel_x, wheel_y, phi, mu_x, mu_y, _ = TRUTH
    inertia, dt = mass * (0.8**2 + 0.5**2) / 12, 0.01
    limits = np.array([mu_x, mu_y]) * 0.5 * mass * 9.81 * dt
    pose, velocity, out = np.zeros(3), np.zeros(3), []
    inverse = np.array([1 / mass, 1 / mass, 1 / inertia])
    for fx, fy, tau in wrench:
        c, s = math.cos(pose[2]), math.sin(pose[2])
        velocity += np.array([c * fx - s * fy, s * fx + c * fy, tau - 0.40 * fy]) * inverse * dt
        arm = np.array([c * wheel_x - s * wheel_y, s * wheel_x + c * wheel_y])
        angle = pose[2] + phi
        along, across = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        rows = np.array([[*axis, arm[0] * axis[1] - arm[1] * axis[0]] for axis in (along, across)])
        impulse = np.zeros(2)
        for _ in range(sweeps):
            for k, row in enumerate(rows):
                wanted = impulse[k] - row @ velocity / (row @ (row * inverse))
                clamped = min(max(wanted, -limits[k]), limits[k])
                velocity += row * inverse * (clamped - impulse[k])
                impulse[k] = clamped
        pose = pose + velocity * dt
        out.append(pose)
    return np.array(out)


def log_likelihood(problem: OpenLoop, poses: Array) -> float:
    squares = np.sum(((poses - problem.poses) / problem.noise) ** 2)
    return float(-0.5 * squares - 750 * math.log(2 * math.pi) - 500 * np.sum(np.log(problem.noise)))


def test_log_likelihood_at_the_truth(problem: OpenLoop) -> None:
    """The data's own 6362.309 is after four sweeps; the kernel is what sweeps converge to, 0.04 nat above."""
    assert log_likelihood(problem, swept(4)) == pytest.approx(6362.309, abs=1e-3)
    converged = log_likelihood(problem, swept(60))
    assert problem.log_likelihood(TRUTH[None])[0] == pytest.approx(converged, abs=1e-6)
    assert converged == pytest.approx(6362.309, abs=0.05)


def test_residuals_and_likelihood_are_of_one_mould(problem: OpenLoop) -> None:
    theta = problem.sample_prior(np.random.default_rng(0), 700)
    residuals = problem.residuals(theta)
    scale = np.exp(theta[:, -1])
    constant = -750 * math.log(2 * math.pi) - 500 * np.sum(np.log(problem.noise))
    expected = -0.5 * np.sum(residuals**2, 1) / scale**2 - 1500 * theta[:, -1] + constant
    assert problem.log_likelihood(theta) == pytest.approx(expected, rel=1e-12)


def test_a_shorter_horizon_is_the_beginning_of_the_whole(problem: OpenLoop) -> None:
    theta = problem.sample_prior(np.random.default_rng(0), 5)
    assert problem.residuals(theta, 0.3) == pytest.approx(problem.residuals(theta)[:, :450], abs=1e-9)


def test_the_turned_wheel_is_the_same_wheel(problem: OpenLoop) -> None:
    theta = problem.sample_prior(np.random.default_rng(1), 50)
    images = problem.images(theta)
    assert images.shape == (2, 50, 7)
    assert np.all((images >= problem.bounds[0]) & (images <= problem.bounds[1]))
    residuals = problem.residuals(theta)
    assert problem.residuals(images[1]) == pytest.approx(residuals, abs=1e-6 * np.abs(residuals).max())


@pytest.mark.parametrize("seed", [0, 1])
def test_known_evidence_and_both_modes(problem: OpenLoop, seed: int) -> None:
    found = infer(np.random.default_rng(seed), problem)
    assert found.converged, found.notes
    assert found.log_evidence == pytest.approx(EVIDENCE, abs=0.1)
    assert found.log_evidence_sd < 0.04
    assert len(found.modes) == 2
    assert np.all((found.shares > 0.45) & (found.shares < 0.55))
    draws = found.draws[found.draws[:, 3] > 0.0]
    assert np.all(np.abs(draws.mean(0) - MEAN) < SD)
    assert draws.std(0) == pytest.approx(SD, rel=0.3)
    assert found.calls < 60_000


def test_same_bytes_on_one_core_and_on_all(problem: OpenLoop) -> None:
    one, all_cores = (infer(np.random.default_rng(3), replace(problem, parallel=flag)) for flag in (False, True))
    assert one.draws.tobytes() == all_cores.draws.tobytes()
    assert one.log_weights.tobytes() == all_cores.log_weights.tobytes()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"wrench": np.zeros((3, 2))}, "expected wrench as"),
        ({"poses": np.full((500, 3), np.nan)}, "expected poses as"),
        ({"noise": np.array([1.0, 0.0, 1.0])}, "noise above zero"),
        ({"load": -1.0}, "load"),
        ({"prior": Prior({"log_scale": Uniform(0.0, 1.0), "mass": Uniform(1.0, 2.0)})}, "last column"),
    ],
)
def test_recordings_that_cannot_be(problem: OpenLoop, change: dict[str, object], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        replace(problem, **change)  # type: ignore[arg-type]


def test_a_missing_recording_is_named(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="expected the recording"):
        wheel_evidence(tmp_path)


@pytest.mark.parametrize("seed", range(3))
def test_too_little_effort_is_not_passed_off_as_an_answer(problem: OpenLoop, seed: int) -> None:
    found = infer(np.random.default_rng(seed), problem, InferenceOptions.modest())
    assert not found.converged
    assert any("starts" in note for note in found.notes)
