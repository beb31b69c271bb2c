"""What was found, in sentences that need no knowledge of the method.

A sentence is made from the posterior and the known geometry alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEAR = 0.06  # [m] a place this close to a caster is called by the caster's name
FREE_FRICTION = 0.02  # a wheel whose friction is below this in nearly all draws does not hold anything
HOLDING_FRICTION = 0.04  # in its weaker direction a stuck wheel has more than the rolling resistance of good casters
UNPLACED = 0.2  # [m] a place known no better than this is no place


def spoken(name: str) -> str:
    """Return an object's name as it is said: "table_a" is a table."""
    words = name.split("_")
    return " ".join(words[:-1] if len(words) > 1 and len(words[-1]) == 1 else words)


def place_name(point: Sequence[float], footprint: Array) -> str:
    """Name a place on a body as a person looking along its x axis does: "rear-left", "front", "middle".

    Args:
        point: (2,) in the body's frame [m].
        footprint: (k, 2) outline in the body's frame [m].
    """
    half = np.ptp(footprint, axis=0) / 2
    middle = (footprint.max(axis=0) + footprint.min(axis=0)) / 2
    share = (np.asarray(point[:2]) - middle) / half
    along = "" if abs(share[0]) < 0.2 else ("front" if share[0] > 0 else "rear")
    across = "" if abs(share[1]) < 0.2 else ("left" if share[1] > 0 else "right")
    return "-".join(part for part in (along, across) if part) or "middle"


def wheel_verdict(name: str, draws: Mapping[str, Array], footprint: Array, casters: Array) -> str:
    """Say what the posterior of the one constrained wheel means.

    Args:
        name: of the object.
        draws: (n,) draws of `wheel_x`, `wheel_y` [m] and, where known, `mu_x`, `mu_y`.
        footprint: (k, 2) outline [m].
        casters: (c, 2) known swivel axes [m], possibly none.
    """
    if holds_nothing(draws):
        return f"The {name} rolls freely: nothing holds it to the floor."
    points = np.column_stack([draws["wheel_x"], draws["wheel_y"]])
    mean = points.mean(axis=0)
    radius = spread_radius(points)
    if radius > UNPLACED:
        return _unplaced(name, radius, rolls=rolls_along(draws))
    distances = np.hypot(*(casters - mean).T) if len(casters) else np.array([np.inf])
    nearest = int(distances.argmin())
    at_caster = distances[nearest] < max(NEAR, radius)
    where = place_name(casters[nearest] if at_caster else mean, footprint)
    gap, middle = _length(distances[nearest]), _length(math.hypot(*mean))
    if rolls_along(draws):
        place = f"{where} caster" if at_caster else where
        text = (
            f"Nothing holds the {name} in place, but it resists going sideways at its {place}: "
            "a wheel there rolls and does not swivel"
        )
    elif at_caster:
        text = f"The {name}’s {where} caster is stuck: the {name} turns about a point {gap} from it"
    else:
        text = f"Something holds the {name} to the floor at its {where}, {middle} from the middle"
    return f"{text} (known to ± {_length(radius)})."


def _unplaced(name: str, radius: float, *, rolls: bool) -> str:
    """Say what is known of a wheel that has no certain place."""
    if rolls:
        return (
            f"Nothing holds the {name} in place: it rolls, and what resists its going sideways has no certain place "
            f"(± {_length(radius)})."
        )
    return f"Something holds the {name} to the floor, but this recording does not say where (± {_length(radius)})."


def holds_nothing(draws: Mapping[str, Array]) -> bool:
    """Tell whether the wheel's friction is negligible in at least 95 % of the draws."""
    if "mu_x" not in draws or "mu_y" not in draws:
        return False
    return bool(np.quantile(np.maximum(draws["mu_x"], draws["mu_y"]), 0.95) < FREE_FRICTION)


def rolls_along(draws: Mapping[str, Array]) -> bool:
    """Tell whether the wheel rolls one way, as one that is free or only does not swivel, and a stuck one does not."""
    if "mu_x" not in draws or "mu_y" not in draws:
        return False
    return bool(np.median(np.minimum(draws["mu_x"], draws["mu_y"])) < HOLDING_FRICTION)


def hinge_verdict(name: str, draws: Mapping[str, Array]) -> str:
    """Say where the hinge is and how sure that is."""
    radius = draws["hinge_radius"]
    return (
        f"The {name} turns on a hinge {_length(radius.mean())} from where it was held (± {_length(2 * radius.std())})."
    )


def circle_verdict(worst: float) -> str:
    """Say how far the recorded path leaves the circle about the hinge at most [m]."""
    return f"All of the recorded path lies within {_length(worst)} of the circle about it."


def free_verdict(name: str, draws: Mapping[str, Array]) -> str:
    """Say that nothing was found, and the mass if that was learned."""
    mass = draws.get("mass")
    return f"The {name} moves freely." if mass is None else f"The {name} moves freely and weighs {mass.mean():.0f} kg."


def ahead_verdict(seconds: float | None, before: float | None, after: float | None) -> str:
    """Say how far predictions are off that look only `seconds` ahead."""
    if seconds is None or before is None or after is None:
        return ""
    return f"Looking {seconds:g} seconds ahead it was {_length(before)} off and is {_length(after)} off."


def learning_verdict(before: float | None, after: float | None, seconds: float, *, fitted: bool) -> str:
    """Say what learning did to the prediction of the motion.

    Args:
        before: [m] error at the end of a push, without learning; None where there is no such model.
        after: [m] the same, after learning.
        seconds: length of the push.
        fitted: whether the push is the one that was learned from.
    """
    if after is None:
        return ""
    which = f"this push of {seconds:.0f} seconds" if fitted else f"a push of {seconds:.0f} seconds it had not seen"
    if before is None:
        return (
            f"From the recorded forces alone, the learned model predicts {which} to within {_length(after)} at its end."
        )
    if after >= before:
        return (
            f"Learning did not help: the end of {which} is predicted {_length(after)} off after it, "
            f"{_length(before)} before."
        )
    return (
        f"From the recorded forces alone, the end of {which} was predicted {_length(before)} off before learning "
        f"and {_length(after)} off after it."
    )


def spread_radius(points: Array) -> float:
    """Return the distance from the mean within which 95 % of the (n, 2) points lie."""
    return float(np.quantile(np.hypot(*(points - points.mean(axis=0)).T), 0.95))


def _length(metres: float) -> str:
    if metres >= 1:
        return f"{metres:.{0 if metres >= 10 else 2}f} m"
    return f"{100 * metres:.0f} cm" if metres >= 0.1 else f"{100 * metres:.1f} cm"
