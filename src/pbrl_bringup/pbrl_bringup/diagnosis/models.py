"""The model of every object, repaired where something is named, written beside the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrl_mismatch.diagnose import Diagnosis
from pbrl_mismatch.repaired import saved_model
from pbrl_model.model_file import save_model

NOT_NAMED = "something is left out that has no name: this is the baseline, which does not have it either"


def write_models(diagnosis: Diagnosis, folder: Path, seed: int) -> dict[str, str]:
    """Write `model_NAME.json` of every object and return the files' names.

    Args:
        diagnosis: of the recording.
        folder: for the files.
        seed: of the draws that they keep.

    Raises:
        ModelError: a file cannot be written.
    """
    files = {}
    seeds = np.random.SeedSequence(seed).spawn(len(diagnosis.objects))
    for own, (name, found) in zip(seeds, diagnosis.objects.items(), strict=True):
        notes = [*found.notes[1:], *([NOT_NAMED] if found.unknown else [])]
        track = found.baseline.peak.objective.cuts.track
        files[name] = f"model_{name}.json"
        save_model(saved_model(np.random.default_rng(own), found.repaired, track, notes), folder / files[name])
    return files
