"""A program that diagnoses bags and has never heard of what is concealed: `python -m pbrl_bringup.concealed.diagnoser`.

One line of JSON in, `{"bag", "out", "options", "rivals"}`, one line out, `{"seconds", "failed"}`. It is started before
its first bag and lives on, because loading a library and compiled code takes seconds; what it knows of a trial is that
line. It refuses to work in a process that has loaded a simulator or anything that draws, keeps or scores a truth.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from pbrl_bag import read_recording
from pbrl_bag.errors import BagError
from pbrl_bringup.diagnosis.models import write_models
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_json
from pbrl_bringup.rivals.claim import give
from pbrl_bringup.rivals.run import claims_of
from pbrl_mismatch.diagnose import Diagnosis, diagnose
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_model.errors import ModelError

CLAIMS, REPORT = "rivals.json", "report.json"
"""Files that are left in a job's folder, beside the models."""
SECRET, THIS = ("bullet_sim", "pbrl_bringup.concealed."), "pbrl_bringup.concealed.diagnoser"
"""Beginnings of the names of modules that could know the truth, and the one exception."""
EXPECTED = (BagError, ModelError, MismatchError, BringupError)


def loaded_secrets() -> list[str]:
    """Return the names of modules of this process that could know the truth."""
    return sorted(name for name in sys.modules if name.startswith(SECRET) and name != THIS)


def work(job: dict[str, Any]) -> dict[str, Any]:
    """Diagnose one bag; an error that a user would be shown is the answer.

    Args:
        job: `bag`, a folder; `out`, a folder for what is found; `options`, of a diagnosis; `rivals`, whether they are
            asked as well.

    Returns:
        `seconds` of CPU for reading, diagnosing and writing report and models; `failed`, a line or nothing.

    Raises:
        BringupError: this process could know the truth.
    """
    secrets = loaded_secrets()
    if secrets:
        raise BringupError(f"diagnoser: expected a process that cannot know the truth, got {', '.join(secrets[:3])}")
    out, started = Path(job["out"]), time.process_time()
    try:
        options = DiagnoseOptions(**{"workers": 1, **job["options"]})
        recording = read_recording(Path(job["bag"]))
        found = diagnose(recording, options)
    except EXPECTED as error:
        return {"seconds": time.process_time() - started, "failed": " ".join(str(error).split())}
    out.mkdir(parents=True, exist_ok=True)
    write_models(found, out, options.seed)
    spent = time.process_time() - started
    if job["rivals"]:
        write_json(out / CLAIMS, rivals_of(found, options))
    write_json(out / REPORT, found.to_report())
    return {"seconds": spent, "failed": ""}


def rivals_of(found: Diagnosis, options: DiagnoseOptions) -> list[dict[str, Any]]:
    """Return what the rivals claim of a recording's one object, given the baseline that the diagnosis fitted.

    Raises:
        BringupError: not exactly one object was held.
    """
    if len(found.objects) != 1:
        raise BringupError(f"rivals: expected one object that was held, got {', '.join(found.objects) or 'none'}")
    only = next(iter(found.objects.values()))
    return [asdict(claim) for claim in claims_of(give(only.baseline, options))]


def serve(jobs: TextIO, answers: TextIO) -> None:
    """Answer jobs line by line until there are none."""
    for line in jobs:
        answers.write(json.dumps(work(json.loads(line))) + "\n")
        answers.flush()


if __name__ == "__main__":
    answers, sys.stdout = sys.stdout, sys.stderr
    serve(sys.stdin, answers)
