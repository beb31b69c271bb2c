"""How far off a diagnosis is in place, in time and in its parameters, against the sealed truth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import contains_xy
from shapely.geometry import LinearRing, Point, Polygon
from shapely.ops import nearest_points

from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.rivals.samples import Samples
from pbrl_mismatch.kernels.columns import COLUMN

Array = NDArray[np.float64]

PLACE_COLUMNS = {
    "second_wheel": ("wheel2_x", "wheel2_y"),
    "hidden_hinge": ("pivot_x", "pivot_y"),
    "tether": ("tether_x", "tether_y"),
}
"""Effects whose place is a point, and the parameters that say where."""
ROLLS_FREELY = 0.05
"""A second wheel rolls freely whose friction along is no more than such a share of that across."""
MOMENT_COLUMNS = {"payload_change": "payload_time"}
"""Effects that begin at a moment, and the parameter that says when."""
CONTACTS = ("unseen_body",)
"""Effects that begin when they are met."""
PERIODS = {
    **dict.fromkeys(("wheel_theta", "wheel2_theta", "patch_theta"), math.pi),
    **dict.fromkeys(("obstacle_angle", "unseen_angle"), 0.5 * math.pi),
}
"""What is the same after less than a whole turn [rad]: an axle or a rectangle after half, a square after a quarter."""


def place_error(effect: str, truth: Truth, entry: Mapping[str, Any], samples: Samples, outline: Array) -> float:
    """Return how far off one effect of a report is in place [m], NaN where it has none.

    A point is compared with a point. A wheel that rolls freely pushes along its axle alone, so no motion shows where
    on its axle it is: compared is how far it is off across the axle. Of a patch only that border is compared which feet
    crossed: the median distance from where they crossed the true border to the claimed one, and the other way round. Of
    an obstacle only the side that was met: the distance from its point nearest to the object, when they first touch, to
    the claimed border.

    Args:
        effect: name.
        truth: what was concealed.
        entry: of the report's `effects`.
        samples: of the recording.
        outline: (k, 2) of the object in its own frame [m].
    """
    if effect in PLACE_COLUMNS:
        told = [truth.told.get(column) for column in PLACE_COLUMNS[effect]]
        found = [entry["parameters"].get(column, {}).get("mean") for column in PLACE_COLUMNS[effect]]
        if None in told or None in found:
            return math.nan
        off = np.array(found, dtype=float) - np.array(told, dtype=float)
        if effect == "second_wheel" and truth.told["wheel2_mu_x"] <= ROLLS_FREELY * truth.told["wheel2_mu_y"]:
            rolls = truth.told["wheel2_theta"]
            return float(abs(off @ [math.cos(rolls), math.sin(rolls)]))
        return float(np.hypot(*off))
    where, place = entry.get("where"), truth.place.get(effect, [])
    if where is None or len(place) < 3:
        return math.nan
    if effect == "floor_patch":
        return border_error(samples.feet[samples.moving], np.array(place), np.array(where["shape"], dtype=float))
    if effect == "hidden_obstacle" and truth.when[effect]:
        return contact_error(samples, truth.when[effect][0][0], outline, np.array(place), np.array(where["shape"]))
    return math.nan


def border_error(feet: Array, true: Array, claimed: Array) -> float:
    """Return the median distance between two borders [m] where feet (n, F, 2) cross them; infinite if one never is.

    Args:
        feet: places in order of time [m].
        true: (k, 2) corners of the true region.
        claimed: (m, 2) corners of the claimed one.
    """
    distances: list[float] = []
    for one, other in ((true, claimed), (claimed, true)):
        crossings = _crossings(feet, one)
        if not crossings:
            return math.inf
        ring = LinearRing(other)
        distances += [ring.distance(Point(place)) for place in crossings]
    return float(np.median(distances))


def _crossings(feet: Array, region: Array) -> list[Array]:
    """Return where feet (n, F, 2) cross the border of a region (k, 2), on the border."""
    polygon, ring = Polygon(region), LinearRing(region)
    inside = contains_xy(polygon, feet[..., 0], feet[..., 1])
    when, which = np.nonzero(inside[1:] != inside[:-1])
    middles = 0.5 * (feet[when, which] + feet[when + 1, which])
    return [np.array(nearest_points(ring, Point(place))[0].coords[0]) for place in middles]


def contact_error(samples: Samples, time: float, outline: Array, true: Array, claimed: Array) -> float:
    """Return the distance [m] from where a fixed thing is met first to the border of the claimed one.

    Args:
        samples: of the recording; the state's place is the centre of mass, taken for the frame's origin.
        time: of the first contact [s].
        outline: (k, 2) of the object in its own frame [m].
        true: (m, 2) corners of the thing, `world`.
        claimed: (l, 2) corners of the claimed thing, `world`.
    """
    x, y, theta = samples.state[int(np.argmin(np.abs(samples.time - time))), :3]
    c, s = math.cos(theta), math.sin(theta)
    placed = Polygon(np.array([x, y]) + outline @ np.array([[c, s], [-s, c]]))
    met = nearest_points(Polygon(true), placed)[0]
    return float(LinearRing(claimed).distance(met))


def moment_error(effect: str, truth: Truth, entry: Mapping[str, Any]) -> float:
    """Return how far off one effect of a report is in the moment at which it begins [s], NaN where it has none."""
    if effect in MOMENT_COLUMNS:
        column = MOMENT_COLUMNS[effect]
        told, found = truth.told.get(column), entry["parameters"].get(column, {}).get("mean")
        return math.nan if told is None or found is None else abs(float(found) - told)
    if effect in CONTACTS and truth.when[effect]:
        when: Sequence[Sequence[float]] = entry.get("when") or []
        return abs(float(when[0][0]) - truth.when[effect][0][0]) if when else math.nan
    return math.nan


def parameter_bias(truth: Truth, entry: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return by parameter how far off its mean is, over the truth and in standard deviations.

    Angles are wrapped to what looks alike, see `PERIODS`. Parameters of which the simulator's settings say nothing are
    left out.
    """
    found: dict[str, tuple[float, float]] = {}
    for name, values in entry["parameters"].items():
        if name not in truth.told or name not in COLUMN:
            continue
        off = float(values["mean"]) - truth.told[name]
        if values["unit"] == "rad":
            off = math.remainder(off, PERIODS.get(name, 2.0 * math.pi))
        size, sd = abs(truth.told[name]), float(values["sd"])
        found[name] = (off / size if size > 0.0 else math.nan, off / sd if sd > 0.0 else math.nan)
    return found
