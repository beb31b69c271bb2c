"""Runs that are kept as soon as they have ended, so that an experiment of hours goes on where it was stopped."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_json
from pbrl_bringup.namo_run import NamoOutcome

OUTCOME = TypeAdapter(NamoOutcome)


def kept_run(path: Path, told: Mapping[str, Any], run: Callable[[], NamoOutcome]) -> NamoOutcome:
    """Return a run that was kept, or make it and keep it.

    Args:
        path: of the file.
        told: what the run is of, numbers and words; one that was kept of something else is refused.
        run: makes it.

    Raises:
        BringupError: the file is of another run, or none.
    """
    if not path.exists():
        outcome = run()
        path.parent.mkdir(parents=True, exist_ok=True)
        write_json(path, {"told": dict(told), "outcome": asdict(outcome)})
        return outcome
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        outcome = OUTCOME.validate_python(found["outcome"])
    except (OSError, ValueError, KeyError, TypeError, ValidationError) as error:
        raise BringupError(f"{path}: expected a run that was kept, got something else; remove it") from error
    if found.get("told") != dict(told):
        raise BringupError(
            f"{path}: expected a run of {dict(told)}, got one of {found.get('told')}; remove the folder, or choose "
            f"another one with --out"
        )
    return outcome
