"""What a report says beside its figures, as headings with sentences: drawn where the report has it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

Told = list[tuple[str, list[str]]]

SHOWN = 24
"""Lines of a list; all else is in the report."""
NOWHERE = 0.005
"""An effect that shows in fewer of the ways it may be than this share shows nowhere."""

WORSE = 1.1
"""By so much a repair's forecast is further off than the baseline's where a reader is told to mind it."""


def told_of_object(report: Mapping[str, Any]) -> Told:
    """Return what is told of one object.

    Args:
        report: its part of `report.json`; keys may be missing.
    """
    found: Told = []
    if report.get("localisation"):
        found.append(("Where the model falls short, whatever the reason", sentences(report["localisation"])))
    if report.get("unknown_description"):
        found.append(("What the unknown is like", sentences(report["unknown_description"])))
    if report.get("not_shown"):
        found.append(("What this recording could not have shown", sentences(report["not_shown"])))
    return found


def told_of_all(report: Mapping[str, Any]) -> Told:
    """Return what is told of the recording as a whole.

    Args:
        report: `report.json`; keys may be missing.
    """
    found: Told = []
    if report.get("refused"):
        found.append(("What could not be diagnosed", sentences(list(report["refused"].values()))))
    if report.get("next_experiment"):
        found.append(("The next push to make", [experiment(report["next_experiment"])]))
    if report.get("not_shown"):
        found.append(("What this recording could not have shown", sentences(report["not_shown"])))
    return found


def acting_times(report: Mapping[str, Any]) -> list[tuple[float, float]]:
    """Return when what is named on an object acts, or when what has no name is surely there [s].

    Args:
        report: as of `told_of_object`.
    """
    entries = [*report.get("effects", []), report.get("unknown_description") or {}]
    return [(start, end) for entry in entries for start, end in entry.get("when") or []]


def acting_legend(report: Mapping[str, Any]) -> str:
    """Say what those times are; nothing where there are none.

    Args:
        report: as of `told_of_object`.
    """
    if not acting_times(report):
        return ""
    return "something is surely left out" if report.get("unknown") else "what is named acts"


def forecast_caution(report: Mapping[str, Any]) -> str:
    """Say that the repair forecasts clearly worse than the baseline, where it does; nothing where it does not.

    Args:
        report: as of `told_of_object`.
    """
    told = (report.get("heldout") or {}).get("rmse_position_m") or {}
    before, after = told.get("baseline"), told.get("repaired")
    if not before or not after or after < WORSE * before:
        return ""
    return (
        f"the repaired model is {after / before:.1f} times as far off here as the one before. Its name rests on how "
        "likely it makes the poses, and on windows that were left out with their starts fitted, as they are in no "
        "forecast. A planner may do better with the model before."
    )


def experiment(entry: Mapping[str, Any]) -> str:
    """Say a proposed push in a sentence."""
    x, y = entry["contact_point"]
    towards = entry["direction"]
    if isinstance(towards, list | tuple):
        towards = math.atan2(towards[1], towards[0])
    bits = (
        f"; it is expected to tell {entry['expected_bits']:.2g} bits" if entry.get("expected_bits") is not None else ""
    )
    way = f"towards {math.degrees(towards):.0f}°" if isinstance(towards, int | float) else f"{towards}"
    return (
        f"Hold the {entry['object']} at ({x:.2f}, {y:.2f}) m of its own frame and push {way} with "
        f"{entry['speed']:.2g} m/s for {entry['duration']:.2g} s{bits}."
    )


def sentences(value: Any) -> list[str]:
    """Return text, a list or a mapping as lines a person can read; one that has its own sentences is taken at them."""
    if isinstance(value, str):
        return [value]
    if isinstance(value, Mapping):
        if "sentences" in value:
            return [*map(str, value["sentences"]), *(f"Mind: {note}" for note in value.get("notes", []))]
        return (
            [_hidden(value)] if "effect" in value else [f"{_words(key)}: {_said(each)}" for key, each in value.items()]
        )
    if isinstance(value, list | tuple):
        lines = [line for each in value for line in sentences(each)]
        more = len(lines) - SHOWN
        return lines if more <= 1 else [*lines[:SHOWN], f"and {more} more, see report.json"]
    return [_said(value)]


def _hidden(entry: Mapping[str, Any]) -> str:
    """Say what of an effect a recording could not have shown, and which motion would."""
    name, motion = entry["effect"], entry.get("motion", "")
    if entry.get("smallest") is not None:
        unit = entry.get("unit", "1")
        size = f"{_said(float(entry['smallest']))}{'' if unit == '1' else f' {unit}'}"
        return f"{name}: weaker than about {size} it would not have shown. {motion}".rstrip()
    chance = float(entry.get("chance") or 0.0)
    seen = "nowhere" if chance < NOWHERE else f"only in {100 * chance:.0f} % of the ways it may be"
    return f"{name}: {seen} would it have shown, however strong. {motion}".rstrip()


def _words(key: str) -> str:
    return key.replace("_", " ")


def _said(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{_words(key)} {_said(each)}" for key, each in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_said, value))
    return str(value)
