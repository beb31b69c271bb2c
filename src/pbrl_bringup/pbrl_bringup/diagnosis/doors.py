"""The diagnosis of doors on the command line: report, page, verdict in the terminal."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.figure import Figure
from rich.console import Console

from pbrl_bag.types import Recording
from pbrl_bringup.diagnosis.door_figures import force_against_angle, from_above, held_out, odds
from pbrl_bringup.diagnosis.residuals import PAGE, REPORT, RESULTS
from pbrl_bringup.diagnosis.told import Told, told_of_object
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import remove_files, result_folder, write_json, write_text
from pbrl_bringup.report_page import TEMPLATES, number, rounded
from pbrl_bringup.terminal import output, styled, table
from pbrl_mismatch.joint.diagnosis import DoorDiagnosis, DoorsDiagnosis, diagnose_doors
from pbrl_mismatch.options import DiagnoseOptions

SHOWN = 5
NOT_OF_DOORS = ("effects", "mass_spread", "grasp_spread", "outline_spread", "most_together")
"""Options of `diagnose` that say nothing of a force along a path: no mass, no outline, laws and sets of its own."""


@dataclass(frozen=True)
class Part:
    """One door on the page: its name, what was found, figures as SVG elements, headings with sentences."""

    name: str
    found: DoorDiagnosis
    figures: Mapping[str, Markup]
    told: Told


def check_for_doors(typed: Mapping[str, Any]) -> None:
    """Refuse options that a door's diagnosis would pass over.

    Args:
        typed: options on the command line, by name.

    Raises:
        BringupError: one of them was given.
    """
    given = [f"--{name.replace('_', '-')}" for name in NOT_OF_DOORS if typed.get(name) not in (None, (), [])]
    if given:
        raise BringupError(
            f"diagnose: expected no {' and no '.join(given)} of a recording of nothing but a path and a force: that is "
            "diagnosed by the force along the path; leave it out"
        )


def run_doors(recording: Recording, options: DiagnoseOptions, out: Path, asked_for: str) -> int:
    """Diagnose the doors of a recording, write `report.json` and `report.html`, print the verdict.

    Args:
        recording: of nothing but paths and forces.
        options: settings.
        out: folder for the results.
        asked_for: command that is shown on the page.

    Raises:
        MismatchError: an object was not held or not turned far enough.
        ModelError: a stream is missing or broken.
        BringupError: the results cannot be written.
    """
    with result_folder(out) as folder:
        with Console(stderr=True).status(f"diagnosing (baseline hinge, force along the path, seed {options.seed})"):
            found = diagnose_doors(recording, options)
        write_doors(found, folder, asked_for)
    print_doors(found)
    output().print(styled(str(out / PAGE), "bold"))
    return 0


def write_doors(found: DoorsDiagnosis, folder: Path, asked_for: str) -> None:
    """Write the page and, when that is there, the report."""
    remove_files(folder, RESULTS)
    write_text(folder / PAGE, render_doors(found, asked_for))
    write_json(folder / REPORT, found.to_report())


def render_doors(diagnosis: DoorsDiagnosis, command: str) -> str:
    """Return the text of the page; it refers to nothing outside itself."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    drawn = {"force": force_against_angle, "above": from_above, "odds": odds, "held_out": held_out}
    parts = [
        Part(name, found, {key: _svg(draw(found)) for key, draw in drawn.items()}, told_of_object(found.report))
        for name, found in diagnosis.objects.items()
    ]
    template = environment.get_template("doors.html.j2")
    return template.render(parts=parts, diagnosis=diagnosis, command=command, number=number, rounded=rounded)


def print_doors(diagnosis: DoorsDiagnosis) -> None:
    """Print the verdict on every door, the likeliest hypotheses, and what must not be read into them."""
    for name, found in diagnosis.objects.items():
        for note in found.notes:
            output().print(note)
        rows = [(" + ".join(each.effects) or "nothing", f"{each.probability:.3f}") for each in found.hypotheses[:SHOWN]]
        title = f"{name}: hypotheses, {diagnosis.seconds:.1f} s"
        output().print(table(title, ("what was left out", "probability"), rows, right=(1,)))


def _svg(figure: Figure) -> Markup:
    """Return a figure as an SVG element; the same figure gives the same text."""
    buffer = io.StringIO()
    with rc_context({"svg.hashsalt": "door"}):  # otherwise the names of clipping paths are drawn anew each time
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return Markup(text[text.index("<svg") :])
