"""Puts models, diagnosis and plans over what a recording shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pbrl_bringup.view.diagnosed import Diagnosed, Found, Lacking, regions_of, sentences
from pbrl_bringup.view.extras import Extras
from pbrl_bringup.view.shown import Shown
from pbrl_bringup.view.tracks import BandTrack


def decorated(
    shown: Shown,
    extras: Extras,
    models: Mapping[str, Mapping[str, Any]] | None = None,
    diagnosed: Diagnosed | None = None,
) -> Shown:
    """Return what is shown with everything that is known beside it.

    Args:
        shown: of a recording.
        extras: what the graph said; files that are given go before it.
        models: learned models by object, in the form of `told_model`.
        diagnosed: what a diagnosis found.
    """
    names = [each["name"] for each in shown.still["objects"]]
    known: dict[str, Any] = {**extras.models, **(models or {})}
    found: dict[str, Found] = {**extras.found, **(diagnosed.report if diagnosed else {})}
    lacking = {name: each for name, each in (diagnosed.residuals if diagnosed else {}).items() if name in names}
    strangers = sorted((set(known) | set(found)) - set(names))
    notes = [f"{name!r} is in a model or report, and not in this recording" for name in strangers]
    still = {
        **shown.still,
        "notes": [*shown.still["notes"], *extras.notes, *notes],
        "objects": [{**each, "model": known.get(each["name"])} for each in shown.still["objects"]],
        "plans": extras.plans_since(shown.origin),
        "regions": regions_of(found, names, shown.origin),
        "residuals": [
            _residual(names.index(name), each, found.get(name), shown.origin) for name, each in lacking.items()
        ],
        "told": sentences(found),
    }
    tracks = [BandTrack(np.array(each.time) - shown.origin, np.array(each.wrench)) for each in lacking.values()]
    return replace(shown, still=still, residuals=tracks)


def _residual(number: int, lacking: Lacking, found: Found | None, origin: float) -> dict[str, Any]:
    force = np.hypot(*np.array(lacking.wrench).reshape(-1, 3)[:, :2].T)
    when = [[start - origin, end - origin] for start, end in (found.acting if found else ())]
    return {"object": number, "largest": float(force.max(initial=0.0)), "when": when}
