"""`./pbrl diagnose BAG...`: where recording and model part, what was left out, and whether the repair predicts."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.console import Console

from pbrl_bag import Recording, read_recording
from pbrl_bringup.diagnosis.doors import check_for_doors, run_doors, write_doors
from pbrl_bringup.diagnosis.models import write_models
from pbrl_bringup.diagnosis.page import write_diagnosis
from pbrl_bringup.diagnosis.residuals import PAGE, REPORT, RESIDUALS, RESULTS, residuals_to_json
from pbrl_bringup.files import remove_files, result_folder, write_json
from pbrl_bringup.scale.address import LOCAL
from pbrl_bringup.scale.command_line import command_of
from pbrl_bringup.scale.recordings import choose_recordings
from pbrl_bringup.terminal import output, say, styled, table
from pbrl_mismatch.diagnose import Diagnosis, ObjectDiagnosis, diagnose
from pbrl_mismatch.effects.own import forget_effect, own_effects
from pbrl_mismatch.effects.own_file import load_effects
from pbrl_mismatch.joint.diagnosis import diagnose_doors, is_for_doors
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.told_baseline import is_model_file

SHOWN = 5
THREADS = 2
"""Threads of one diagnosis, where nothing else is said; of many recordings each has one."""
COLUMNS = {
    "object": "object",
    "left_out": "what was left out",
    "probability": "probability",
    "heldout_baseline": "held out before",
    "heldout_repaired": "after",
}
"""Columns of a summary of many that the terminal shows."""


@dataclass(frozen=True)
class Asked:
    """What is diagnosed, of every recording alike.

    Attributes:
        mapping: of topics; None: ours.
        baseline: as on the command line.
        effects: Python files that add effects.
        options: settings.
        typed: options on the command line, by name.
    """

    mapping: Path | None
    baseline: tuple[str, ...]
    effects: tuple[Path, ...]
    options: DiagnoseOptions
    typed: Mapping[str, Any]


def command(
    bags: Sequence[Path],
    listed: Path | None,
    mapping: Path | None,
    out: Path,
    baseline: list[str],
    without: list[str],
    effects: Sequence[Path],
    settings: Mapping[str, float | None],
    seed: int,
    workers: int | None,
    scheduler: str | None,
) -> int:
    """Diagnose every object of a recording, or of many.

    Args:
        bags: recordings, folders of them, patterns.
        listed: file with a recording on each line; None: no such file.
        mapping: of their topics; None: ours.
        out: folder for the results.
        baseline: kinds of body, and models' files.
        without: effects that the library does without.
        effects: Python files that add effects to it.
        settings: by option, how well things are known and how many are sought; None: the default.
        seed: of every draw.
        workers: threads of a diagnosis; None: two, or one where there are many recordings.
        scheduler: where many recordings are diagnosed; None: on this machine.

    Raises:
        BagError: the recording cannot be read or is malformed.
        ModelError: its motion cannot be learned from.
        MismatchError: an option does not fit.
        BringupError: the results cannot be written, there is no such scheduler, or some of many recordings failed.
    """
    chosen = choose_recordings(bags, listed)
    many = chosen.several or scheduler is not None
    for path in effects:
        say(f"pbrl: {path} adds {', '.join(load_effects(path))}")
    if many:  # workers elsewhere have another working directory
        baseline = [str(Path(each).absolute()) if is_model_file(each) else each for each in baseline]
    kinds = tuple(each for each in baseline if not is_model_file(each))
    told: dict[str, Any] = {"baseline": kinds} if kinds else {}
    told["models"] = tuple(Path(each) for each in baseline if is_model_file(each))
    told |= {name: value for name, value in settings.items() if value is not None}
    threads = (1 if many else THREADS) if workers is None else workers
    options = DiagnoseOptions(without=tuple(without), seed=seed, workers=threads, **told)
    if many:
        mapping, files = None if mapping is None else mapping.absolute(), tuple(each.absolute() for each in effects)
        typed = {"map": mapping, "baseline": baseline, "without": without, "effects": files, **settings, "seed": seed}
        asked = Asked(mapping, tuple(baseline), files, options, typed)
        run_many = import_module("pbrl_bringup.scale.many").run_many  # Dask is slow to load
        return int(run_many(diagnose_one, chosen.bags, asked, out, scheduler or LOCAL, COLUMNS, "diagnosing"))
    recording = read_recording(chosen.bags[0], mapping)
    for note in recording.notes:
        say(f"pbrl: {note}")
    asked_for = "./pbrl " + shlex.join(sys.argv[1:])
    if is_for_doors(recording, tuple(baseline) or None):
        check_for_doors({"effects": effects, **settings})
        return run_doors(recording, options, out, asked_for)
    with result_folder(out) as folder:
        with Console(stderr=True).status(f"diagnosing (baseline {', '.join(options.baseline)}, seed {seed})"):
            found = diagnose(recording, options)
        write_found(found, recording, folder, asked_for, options)
    print_diagnosis(found)
    output().print(styled(str(out / PAGE), "bold"))
    return 0


def diagnose_one(bag: Path, folder: Path, asked: Asked) -> list[dict[str, Any]]:
    """Diagnose one of many recordings, write what `diagnose` writes, and return a row for each object.

    Args:
        bag: recording.
        folder: for its results; it exists.
        asked: what is diagnosed.

    Raises:
        BagError, ModelError, MismatchError, BringupError: as `command`.
    """
    only_effects(tuple((path, path.read_bytes()) for path in asked.effects))
    recording = read_recording(bag, asked.mapping)
    line = command_of("diagnose", bag, folder, **asked.typed)
    if is_for_doors(recording, asked.baseline or None):
        check_for_doors(asked.typed)
        doors = diagnose_doors(recording, asked.options)
        write_doors(doors, folder, line)
        return [row_of(name, found.report) for name, found in doors.objects.items()]
    found = diagnose(recording, asked.options)
    write_found(found, recording, folder, line, asked.options)
    return [row_of(name, each.report) for name, each in found.objects.items()]


_present: tuple[tuple[Path, bytes], ...] | None = ()
"""Files whose effects this worker's library has; None: it may have any."""


def only_effects(files: tuple[tuple[Path, bytes], ...]) -> None:
    """Have these files' effects in the library and no others of one's own; a worker outlives a command.

    Args:
        files: path and content of each.

    Raises:
        MismatchError: a file cannot be run, or adds none.
    """
    global _present
    if files == _present:
        return
    _present = None
    for name in own_effects():
        forget_effect(name)
    for path, _ in files:
        load_effects(path)
    _present = files


def row_of(name: str, report: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object's line of a summary: what was left out, how sure, and held-out errors, in the report's unit."""
    named, heldout = report["effects"], report["heldout"]
    measure = "rmse_force_N" if "rmse_force_N" in heldout else "rmse_position_m"  # doors are known by their force
    return {
        "object": name,
        "mismatch": report["mismatch"],
        "p_value": report["p_value"],
        "left_out": " + ".join(each["effect"] for each in named) or ("unknown" if report["unknown"] else "nothing"),
        "probability": min((each["probability"] for each in named), default=None),
        "heldout": measure,
        **{f"heldout_{which}": heldout[measure][which] for which in ("baseline", "repaired", "noise_floor")},
    }


def write_found(found: Diagnosis, recording: Recording, folder: Path, asked_for: str, options: DiagnoseOptions) -> None:
    """Write what force the model lacks, the models, the page and, when all of it is there, the report."""
    remove_files(folder, RESULTS)
    residuals = {name: each.residual for name, each in found.objects.items()}
    write_json(folder / RESIDUALS, residuals_to_json(residuals))
    models = write_models(found, folder, options.seed)
    write_diagnosis(found, recording, asked_for, folder / PAGE, options=options, models=models)
    write_json(folder / REPORT, found.to_report())


def print_diagnosis(diagnosis: Diagnosis) -> None:
    """Print the verdict on every object, the likeliest hypotheses, and what must not be read into them."""
    for why in diagnosis.refused.values():
        output().print(f"not diagnosed: {why}")
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
