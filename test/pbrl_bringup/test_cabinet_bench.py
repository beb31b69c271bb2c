"""The hinge of a real cabinet, learned from a real robot's pull."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrl_bag import read_recording
from pbrl_bringup.benches.cabinet import RADIUS, RECORDING, SLACK, data_file, path_deviation
from pbrl_bringup.paths import config_file
from pbrl_model import FitOptions, fit_recording


def test_the_real_door_turns_about_its_hinge() -> None:
    recording = read_recording(data_file(RECORDING), config_file("mappings", "pr2_cabinet"))
    fit = fit_recording(
        recording, FitOptions(model_class="hinge", seed=3, search_draws=100, draws=50, holdout_share=0.0)
    )
    found = fit.objects["door"]
    assert abs(found.posterior.column("hinge_radius").mean() - RADIUS) < SLACK
    recorded = np.vstack([motion.pose[:, :2] for motion in found.motions])
    assert path_deviation(found, recorded).max() < 0.01


def test_recordings_come_with_the_workspace() -> None:
    assert Path(data_file("pr2_cabinet/lab_cabinet.csv")).stat().st_size > 1000
