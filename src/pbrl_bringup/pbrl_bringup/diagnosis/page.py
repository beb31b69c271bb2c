"""`report.html` of a diagnosis: one file that opens anywhere."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pbrl_bag.types import Recording
from pbrl_bringup.diagnosis.figures import floor, held_out, odds, over_time
from pbrl_bringup.files import write_text
from pbrl_bringup.report_page import TEMPLATES, number, rounded
from pbrl_mismatch.diagnose import Diagnosis, ObjectDiagnosis


@dataclass(frozen=True)
class Part:
    """One object on the page; figures are SVG elements."""

    name: str
    found: ObjectDiagnosis
    floor: Markup
    over_time: Markup
    odds: Markup
    held_out: Markup


def render_diagnosis(diagnosis: Diagnosis, recording: Recording, command: str) -> str:
    """Return the text of the page; it refers to nothing outside itself.

    Args:
        diagnosis: of the recording.
        recording: for the outlines of its bodies.
        command: that made it, to be shown.
    """
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    parts = [
        Part(
            name,
            found,
            Markup(floor(recording.bodies[name], found)),
            Markup(over_time(found)),
            Markup(odds(found)),
            Markup(held_out(found)),
        )
        for name, found in diagnosis.objects.items()
    ]
    template = environment.get_template("diagnosis.html.j2")
    return template.render(parts=parts, diagnosis=diagnosis, command=command, number=number, rounded=rounded)


def write_diagnosis(diagnosis: Diagnosis, recording: Recording, command: str, path: Path) -> None:
    """Write the page, whole or not at all."""
    write_text(path, render_diagnosis(diagnosis, recording, command))
