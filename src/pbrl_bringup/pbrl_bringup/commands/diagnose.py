"""`./pbrl diagnose BAG`: where a recording and the model part, what was left out, and whether the repair predicts."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from pbrl_bag import read_recording
from pbrl_bringup.diagnosis.doors import run_doors
from pbrl_bringup.diagnosis.models import write_models
from pbrl_bringup.diagnosis.page import write_diagnosis
from pbrl_bringup.diagnosis.residuals import RESIDUALS, residuals_to_json
from pbrl_bringup.files import result_folder, write_json
from pbrl_bringup.terminal import output, say, styled, table
from pbrl_mismatch.diagnose import Diagnosis, ObjectDiagnosis, diagnose
from pbrl_mismatch.effects.own_file import load_effects
from pbrl_mismatch.joint.diagnosis import is_for_doors
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.told_baseline import is_model_file

SHOWN = 5


def command(
    bag: Path,
    mapping: Path | None,
    out: Path,
    baseline: list[str],
    without: list[str],
    effects: Sequence[Path],
    known: Mapping[str, float | None],
    seed: int,
    workers: int,
) -> int:
    """Diagnose every object of a recording.

    Args:
        bag: recording.
        mapping: of its topics; None: ours.
        out: folder for the results.
        baseline: kinds of body, and models' files.
        without: effects that the library does without.
        effects: Python files that add effects to it.
        known: how well things are known, by option; None: the default.
        seed: of every draw.
        workers: threads.

    Raises:
        BagError: the recording cannot be read or is malformed.
        ModelError: its motion cannot be learned from.
        MismatchError: an option does not fit.
        BringupError: the results cannot be written.
    """
    for path in effects:
        say(f"pbrl: {path} adds {', '.join(load_effects(path))}")
    kinds = tuple(each for each in baseline if not is_model_file(each))
    asked: dict[str, Any] = {"baseline": kinds} if kinds else {}
    asked["models"] = tuple(Path(each) for each in baseline if is_model_file(each))
    asked |= {name: value for name, value in known.items() if value is not None}
    options = DiagnoseOptions(without=tuple(without), seed=seed, workers=workers, **asked)
    recording = read_recording(bag, mapping)
    for note in recording.notes:
        say(f"pbrl: {note}")
    asked_for = "./pbrl " + shlex.join(sys.argv[1:])
    if is_for_doors(recording, tuple(baseline) or None):
        return run_doors(recording, options, out, asked_for)
    with result_folder(out) as folder:
        with Console(stderr=True).status(f"diagnosing (baseline {', '.join(options.baseline)}, seed {seed})"):
            found = diagnose(recording, options)
        write_json(folder / "report.json", found.to_report())
        residuals = {name: each.residual for name, each in found.objects.items()}
        write_json(folder / RESIDUALS, residuals_to_json(residuals))
        models = write_models(found, folder, seed)
        write_diagnosis(found, recording, asked_for, folder / "report.html", options=options, models=models)
    print_diagnosis(found)
    output().print(styled(str(out / "report.html"), "bold"))
    return 0


def print_diagnosis(diagnosis: Diagnosis) -> None:
    """Print the verdict on every object, the likeliest hypotheses, and what must not be read into them."""
    for name, found in diagnosis.objects.items():
        for note in found.notes:
            output().print(note)
        if found.hypotheses:
            title = f"{name}: hypotheses, {diagnosis.seconds:.1f} s"
            output().print(table(title, ("what was left out", "probability"), _rows(found), right=(1,)))
        errors = found.report["heldout"]["rmse_position_m"]
        if errors["baseline"] is not None:
            output().print(
                f"held out: position off by {1000 * errors['baseline']:.1f} mm before, "
                f"{1000 * errors['repaired']:.1f} mm after the repair; noise {1000 * errors['noise_floor']:.1f} mm"
            )


def _rows(found: ObjectDiagnosis) -> list[tuple[str, str]]:
    return [(" + ".join(each.effects) or "nothing", f"{each.probability:.3f}") for each in found.hypotheses[:SHOWN]]
