"""`report.html`: one self-contained file made from a `Report`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pbrl_bringup.files import write_text
from pbrl_bringup.report_data import ObjectReport, Report
from pbrl_bringup.verdict import spoken

TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Tile:
    """One big number: what it is, the number with its unit, and a line that explains it."""

    what: str
    value: str
    note: str


def render_page(report: Report) -> str:
    """Return the text of `report.html`; it refers to nothing outside itself."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    # "<" inside the blob would end the script element where a name contains "</script>".
    blob = Markup(report.model_dump_json().replace("<", "\\u003c"))
    template = environment.get_template("report.html.j2")
    helpers = (number, rounded, centimetres, degrees, tiles, spoken)
    return template.render(report=report, blob=blob, **{helper.__name__: helper for helper in helpers})


def write_page(report: Report, path: Path) -> None:
    """Write `report.html`, whole or not at all."""
    write_text(path, render_page(report))


def rounded(mean: float | None, sd: float | None) -> str:
    """Write a mean to the second significant digit of its standard deviation."""
    if mean is None or sd is None or sd <= 0:
        return number(mean)
    digits = max(0, 1 - math.floor(math.log10(sd)))
    return f"{mean:.{digits}f}".replace("-", "−")


def number(value: float | None) -> str:
    """Write a number with two significant digits, more before the point, and no needless exponent."""
    if value is None:
        return "–"
    if value == 0 or 1e-4 <= abs(value) < 1e5:
        digits = 1 if value == 0 else max(0, 1 - math.floor(math.log10(abs(value))))
        return f"{value:.{digits}f}".replace("-", "−")
    return f"{value:.2e}".replace("-", "−")


def centimetres(value: float | None) -> str:
    """Write a length [m] as a person says it."""
    if value is None:
        return "unknown"
    if value >= 1:
        return f"{value:.{0 if value >= 10 else 1}f}\N{NO-BREAK SPACE}m"
    return f"{100 * value:.{0 if value >= 0.1 else 1}f}\N{NO-BREAK SPACE}cm"


def degrees(value: float | None) -> str:
    """Write an angle [rad] in degrees."""
    return "unknown" if value is None else f"{math.degrees(value):.1f}°"


def tiles(part: ObjectReport) -> list[Tile]:
    """Return the big numbers of one object: error before and after, how sure, and truth if it was given."""
    found = []
    for episode in part.episodes[-2:]:
        length = (
            f"{episode.restart:g} seconds ahead"
            if episode.restart
            else f"over the whole push, {episode.time[-1]:.0f}\N{NO-BREAK SPACE}s"
        )
        note = "off where the prediction ends, before and after learning"
        found.append(Tile(f"Predicted {length}", _change(episode.end_before, episode.end_after), note))
    if part.wheel:
        note = "95 % of the draws lie this close to their mean"
        found.append(Tile("Place found, how sure", f"± {centimetres(part.wheel.radius95)}", note))
    if part.hinge:
        spread = next((p.sd for p in part.parameters if p.name == "hinge_radius"), None)
        radius = centimetres(part.hinge.mean[2])
        found.append(Tile("From the hinge to where it was held", radius, f"standard deviation {centimetres(spread)}"))
    if part.truth and part.truth.distance is not None:
        note = "the simulator was asked after the fit"
        found.append(Tile("From the caster that was really locked", centimetres(part.truth.distance), note))
    return found


def _change(before: float | None, after: float | None) -> str:
    return centimetres(after) if before is None else f"{centimetres(before)} → {centimetres(after)}"
