"""Runs that are kept as soon as they have ended, so that an experiment of hours goes on where it was stopped."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_json

Outcome = TypeVar("Outcome")


def kept_run(kind: type[Outcome], path: Path, told: Mapping[str, Any], run: Callable[[], Outcome]) -> Outcome:
    """Return a run that was kept, or make it and keep it.

    Args:
        kind: dataclass of what becomes of a run.
        path: of the file.
        told: what the run is of, numbers and words; one that was kept of something else is refused.
        run: makes it.

    Raises:
        BringupError: the file is of another run, or none.
    """
    outcome = read_run(kind, path, told)
    if outcome is None:
        outcome = run()
        keep_run(path, told, outcome)
    return outcome


def read_run(kind: type[Outcome], path: Path, told: Mapping[str, Any]) -> Outcome | None:
    """Return a run that was kept; None: there is none yet.

    Args:
        kind: dataclass of what becomes of a run.
        path: of the file.
        told: what the run is of, numbers and words; one that was kept of something else is refused.

    Raises:
        BringupError: the file is of another run, or none.
    """
    if not path.exists():
        return None
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        outcome = TypeAdapter(kind).validate_python(found["outcome"])
    except (OSError, ValueError, KeyError, TypeError, ValidationError) as error:
        raise BringupError(f"{path}: expected a run that was kept, got something else; remove it") from error
    if found.get("told") != dict(told):
        raise BringupError(
            f"{path}: expected a run of {dict(told)}, got one of {found.get('told')}; remove the folder, or choose "
            f"another one with --out"
        )
    return outcome


def keep_run(path: Path, told: Mapping[str, Any], outcome: Any) -> None:
    """Write a run's file.

    Args:
        path: of the file.
        told: what the run is of.
        outcome: what became of it, a dataclass.

    Raises:
        BringupError: it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, {"told": dict(told), "outcome": asdict(outcome)})
