"""Trials of calibration: drawn as the fit's prior has it, the same for the same seed, ranked without bias."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.fitting.calibration import RANKED, TABLE, empty_windows, options_for, run_trial, with_poses
from pbrl_model.fitting.fit import target_of
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.geometry import mass_properties
from pbrl_model.inference.sbc import Ranks, judge


def test_the_free_class_is_calibrated() -> None:
    trials = [run_trial("free", seed) for seed in range(24)]
    ranks = Ranks(trials[0].names, np.stack([trial.rank for trial in trials]), RANKED)
    judged = judge(ranks, np.random.default_rng(0))
    assert min(found.p for found in judged.values()) > 0.01
    assert all(trial.converged for trial in trials)


@pytest.mark.parametrize("model_class", ["wheel", "hinge"])
def test_same_seed_same_trial(model_class: str) -> None:
    first, second = (run_trial(model_class, 7) for _ in range(2))
    assert first.rank.tobytes() == second.rank.tobytes() and first.mean.tobytes() == second.mean.tobytes()


def test_poses_are_drawn_with_the_noise_and_starts_that_the_fit_assumes() -> None:
    rng = np.random.default_rng(1)
    target = target_of(
        TABLE, WindowedLikelihood(mass_properties(TABLE.footprint), empty_windows(rng, "free")), options_for("free")
    )
    position = np.array([25.0, 0.0, np.log(2.0), np.log(3.0)])
    likelihood, rows = target.likelihood, target.rows(position[None])
    poses = np.stack([with_poses(rng, target, position).pose for _ in range(300)])
    linear = likelihood.linearise(rows, likelihood.at_rest(1)).sensitivities[0, 0, :3]
    expected = 4.0 * np.eye(3) + linear @ np.diag([1.0] * 6 + [9.0] * 3) @ linear.T
    seen = likelihood.windows.seen[0, 0]
    found = np.cov((poses[:, 0, 0] / likelihood.windows.noise[0]).T)
    np.testing.assert_allclose(np.diag(found)[seen], np.diag(expected)[seen], rtol=0.4)


def test_an_unknown_class_is_refused() -> None:
    with pytest.raises(ModelError, match="wheels"):
        run_trial("wheels", 0)
