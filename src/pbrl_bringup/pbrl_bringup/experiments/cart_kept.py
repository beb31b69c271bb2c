"""Legs that are kept as soon as they have ended, so that a drive of an hour goes on where it was stopped."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from pbrl_bringup.cart.outcome import CartOutcome
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_json

OUTCOME = TypeAdapter(CartOutcome)


def read_leg(path: Path, told: Mapping[str, Any]) -> CartOutcome | None:
    """Return a leg that was kept; None: there is none yet.

    Args:
        path: of the file.
        told: what the leg is of, numbers and words; one that was kept of something else is refused.

    Raises:
        BringupError: the file is of another leg, or none.
    """
    if not path.exists():
        return None
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        outcome = OUTCOME.validate_python(found["outcome"])
    except (OSError, ValueError, KeyError, TypeError, ValidationError) as error:
        raise BringupError(f"{path}: expected a leg that was kept, got something else; remove it") from error
    if found.get("told") != dict(told):
        raise BringupError(
            f"{path}: expected a leg of {dict(told)}, got one of {found.get('told')}; remove the folder, or choose "
            f"another one with --out"
        )
    return outcome


def keep_leg(path: Path, told: Mapping[str, Any], outcome: CartOutcome) -> None:
    """Write a leg's file.

    Raises:
        BringupError: it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, {"told": dict(told), "outcome": asdict(outcome)})
