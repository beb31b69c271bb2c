"""`report.html` of a diagnosis: one file that opens anywhere."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pbrl_bag.types import Recording
from pbrl_bringup.diagnosis.figures import floor, held_out, odds, over_time
from pbrl_bringup.diagnosis.replay import Replay, replay_of
from pbrl_bringup.diagnosis.told import Told, acting_legend, forecast_caution, told_of_all, told_of_object
from pbrl_bringup.files import write_text
from pbrl_bringup.report_page import TEMPLATES, number, rounded
from pbrl_mismatch.diagnose import Diagnosis, ObjectDiagnosis
from pbrl_mismatch.options import DiagnoseOptions


@dataclass(frozen=True)
class Part:
    """One object on the page.

    Attributes:
        name: of it.
        found: what was found on it.
        replay: data of the replay as JSON.
        repaired: whether there is a repaired model beside the baseline.
        places: whether what is named has a place.
        moments: what the moments are that are shaded, or nothing.
        unbelieved: whether stretches are left out because they are not to be believed.
        stretch: length of what is simulated at a time [s].
        floor: figure, an SVG element, and so are the next three.
        over_time: see `figures`.
        odds: see `figures`.
        held_out: see `figures`; nothing where nothing was held out.
        caution: what to mind where the repair forecasts worse, or nothing.
        told: headings with sentences.
        model_file: name of the saved model, or nothing.
    """

    name: str
    found: ObjectDiagnosis
    replay: Markup
    repaired: bool
    places: bool
    moments: str
    unbelieved: bool
    stretch: float
    floor: Markup
    over_time: Markup
    odds: Markup
    held_out: Markup
    caution: str
    told: Told
    model_file: str


def render_diagnosis(
    diagnosis: Diagnosis,
    recording: Recording,
    command: str,
    *,
    options: DiagnoseOptions | None = None,
    models: Mapping[str, str] | None = None,
) -> str:
    """Return the text of the page; it refers to nothing outside itself.

    Args:
        diagnosis: of the recording.
        recording: for the outlines of its bodies and the room.
        command: that made it, to be shown.
        options: with which the diagnosis was made; None: the defaults.
        models: names of the saved models by object.
    """
    chosen, saved = options or DiagnoseOptions(), models or {}
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    parts = [
        _part(recording, name, found, replay_of(recording, found, chosen), saved.get(name, ""))
        for name, found in diagnosis.objects.items()
    ]
    template = environment.get_template("diagnosis.html.j2")
    return template.render(
        parts=parts,
        told=told_of_all(diagnosis.to_report()),
        diagnosis=diagnosis,
        command=command,
        number=number,
        rounded=rounded,
    )


def _part(recording: Recording, name: str, found: ObjectDiagnosis, replay: Replay, model: str) -> Part:
    ends = np.flatnonzero(np.diff(replay.stretch, append=-1))
    starts = np.concatenate([[0], ends[:-1] + 1])
    return Part(
        name,
        found,
        # "<" inside would end the script element where a name contains "</script>".
        Markup(json.dumps(replay.to_json(), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")),
        replay.after is not None,
        bool(replay.places),
        acting_legend(found.report),
        bool(replay.unbelieved),
        float(np.median(replay.time[ends] - replay.time[starts])),
        Markup(floor(recording.bodies[name], found)),
        Markup(over_time(found)),
        Markup(odds(found)),
        Markup(held_out(found) if replay.held_out else ""),
        forecast_caution(found.report),
        told_of_object(found.report),
        model,
    )


def write_diagnosis(
    diagnosis: Diagnosis,
    recording: Recording,
    command: str,
    path: Path,
    *,
    options: DiagnoseOptions | None = None,
    models: Mapping[str, str] | None = None,
) -> None:
    """Write the page, whole or not at all; see `render_diagnosis`."""
    write_text(path, render_diagnosis(diagnosis, recording, command, options=options, models=models))
