"""A learned model in the form of the page's data: a line of numbers, and where its wheel or hinge may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.clouds import hinge_of, wheel_of

Array = NDArray[np.float64]

FARTHEST = 1e9
"""Places further away than this [m] are nobody's, and cannot be rounded: they are told and not drawn."""
DOTS = 150
"""Draws that are drawn of each object: a page of five objects still slides at thirty pictures a second."""


def told_model(
    kind: str, numbers: Sequence[tuple[str, float, float, str]], draws: Mapping[str, Array]
) -> dict[str, Any]:
    """Return the form of the page's data.

    Args:
        kind: class of the model.
        numbers: name, mean, standard deviation and unit of each parameter.
        draws: (n,) of each parameter.
    """
    listed = [f"{name} {m:.3g} ± {s:.2g}{'' if unit == '1' else ' ' + unit}" for name, m, s, unit in numbers]
    count = min((len(each) for each in draws.values()), default=0)
    shown = np.unique(np.linspace(0, max(count - 1, 0), DOTS).astype(np.intp))
    places = {name: each for name, each in draws.items() if count > 1 and (np.abs(each) < FARTHEST).all()}
    wheel = wheel_of(places, shown) if {"wheel_x", "wheel_y"} <= set(places) else None
    hinge = hinge_of(places, shown) if {"hinge_x", "hinge_y", "hinge_radius"} <= set(places) else None
    return {
        "told": f"{kind}: {', '.join(listed)}",
        "wheel": None if wheel is None else wheel.model_dump(),
        "hinge": None if hinge is None else hinge.model_dump(),
    }
