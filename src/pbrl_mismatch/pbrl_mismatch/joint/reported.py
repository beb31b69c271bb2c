"""What was found on a door, in the form of `report.json`, and in sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.missing import runs_of
from pbrl_mismatch.joint.evidence import Explained
from pbrl_mismatch.joint.heldout import FIRST, HeldOut
from pbrl_mismatch.joint.laws import ALIKE, Law
from pbrl_mismatch.joint.pull import Pull
from pbrl_mismatch.moments import moments_of

Array = NDArray[np.float64]

ANGLE = "_angle"
"""Parameters that end so are places, and share the hinge's uncertainty."""


@dataclass(frozen=True)
class Finding:
    """One effect on a door.

    Attributes:
        effect: its name.
        form: which form of it.
        probability: of all sets that have it, or of the one it is told in.
        parameters: mean, sd and unit by name.
        place: (from, to) [rad] of where it acts, or None.
        radius: of the handle [m].
        when: intervals [s], or None.
    """

    effect: str
    form: str
    probability: float
    parameters: Mapping[str, Mapping[str, float | str]]
    place: tuple[float, float] | None
    radius: float
    when: list[list[float]] | None

    def to_report(self) -> dict[str, Any]:
        """Return the form of `report.json`; points in the frame "joint" are (angle [rad], radius [m])."""
        shape = [[round(each, 5), round(self.radius, 4)] for each in self.place or ()]
        return {
            "effect": self.effect,
            "form": self.form,
            "probability": self.probability,
            "parameters": {name: dict(values) for name, values in self.parameters.items()},
            "where": {"frame": "joint", "shape": shape} if self.place else None,
            "when": self.when,
            "direction": "path",
        }


def finding_of(explained: Explained, law: Law, probability: float) -> Finding:
    """Return what a fitted hypothesis says of one of its laws."""
    pull, hypothesis = explained.problem.pull, explained.hypothesis
    parameters: dict[str, dict[str, float | str]] = {}
    fitted: dict[str, float] = {}
    own = {each.name for each in law.unknowns(pull)}
    for k, unknown in enumerate(explained.problem.unknowns):
        if unknown.name in own:
            fitted[unknown.name] = value = float(explained.values[k])
            coordinate = math.log(value) if unknown.positive else value
            mean, sd = moments_of(coordinate, float(explained.covariance[k, k]), unknown.positive)
            if unknown.name.endswith(ANGLE):
                sd = math.hypot(sd, value * pull.hinge.sd[2] / pull.hinge.radius)
            parameters[unknown.name] = {"mean": mean, "sd": sd, "unit": unknown.unit}
    means, sds = explained.solved.moments(explained.problem.positive)
    named = {each.name for each in law.strengths(pull)}
    for strength, mean, sd in zip(hypothesis.strengths(pull), means.tolist(), sds.tolist(), strict=True):
        if strength.name in named:
            parameters[strength.name] = {"mean": mean, "sd": sd, "unit": strength.unit}
    place = law.place(fitted) if law.place is not None else None
    when = None
    if place is not None:
        low, high = max(place[0], float(pull.angle.min())), min(place[1], float(pull.angle.max()))
        place = (low, max(high, low))
        when = _intervals(pull, (pull.angle >= low) & (pull.angle <= high))
    return Finding(law.effect, law.form, probability, parameters, place, pull.hinge.radius, when)


def _intervals(pull: Pull, inside: NDArray[np.bool_]) -> list[list[float]]:
    """Return the intervals of time [s] in which cells are inside, hold by hold."""
    found = []
    for number in np.unique(pull.number):
        time = pull.time[pull.number == number]
        found += [[float(time[a]), float(time[b - 1])] for a, b in runs_of(inside[pull.number == number])]
    return found


def held_out_report(blocks: HeldOut, wider: Sequence[HeldOut], rest: HeldOut | None, noise: float) -> dict[str, Any]:
    """Return held-out errors of the force; the entries that poses have are there and empty."""
    nothing = {"baseline": None, "repaired": None, "noise_floor": None}
    return {
        "rmse_position_m": nothing,
        "rmse_yaw_rad": nothing,
        "log_score": {"baseline": blocks.score_before, "repaired": blocks.score_after},
        "rmse_force_N": {"baseline": blocks.rmse_before, "repaired": blocks.rmse_after, "noise_floor": noise},
        "split": f"every other {math.degrees(blocks.width):.1f} degrees of the angle, predicted from those between",
        "by_block_width": [
            {"width_rad": each.width, "baseline": each.rmse_before, "repaired": each.rmse_after}
            for each in sorted((blocks, *wider), key=lambda each: each.width)
        ],
        "rest_from_beginning_N": None
        if rest is None
        else {"baseline": rest.rmse_before, "repaired": rest.rmse_after, "first_share": FIRST},
    }


def hinge_report(pull: Pull) -> dict[str, Any]:
    """Return the hinge that angles are measured about."""
    hinge = pull.hinge
    entries = zip(("hinge_x", "hinge_y", "hinge_radius"), (*hinge.centre, hinge.radius), hinge.sd, strict=True)
    peak = int(np.argmax(pull.force))
    return {
        **{name: {"mean": float(mean), "sd": float(sd), "unit": "m"} for name, mean, sd in entries},
        "handle_off_circle_m": hinge.off,
        "opened_rad": pull.reach,
        "zero": "first recorded pose",
        "largest_force_N": float(pull.force[peak]),
        "largest_force_angle_rad": float(pull.angle[peak]),
    }


def notes_of(
    pull: Pull,
    chance: float,
    mismatch: bool,
    repaired: Explained,
    effects: Sequence[Finding],
    blocks: HeldOut,
    length: float,
) -> tuple[str, ...]:
    """Return the verdict, then what must not be read into it."""
    notes = [
        f"accelerations are not used: force along the path against angle, {len(pull)} cells of "
        f"{math.degrees(pull.reach) / len(pull):.1f} degrees over {math.degrees(pull.reach):.0f} degrees"
    ]
    if mismatch and effects and not repaired.settled:
        notes.append("the fit had not settled: its numbers are rough")
    if effects and math.isnan(repaired.checked):
        notes.append("the evidence is by Laplace alone: samples did not confirm it")
    if effects and length > blocks.width:
        notes.append(
            f"what is left is alike over {math.degrees(length):.1f} degrees, more than a held-out block of "
            f"{math.degrees(blocks.width):.1f}: look at wider blocks, and at the rest predicted from the beginning, too"
        )
    for name in {each.effect for each in effects}:
        notes += [f"{name} and {' and '.join(ALIKE[name])} are the same along one path"] if name in ALIKE else []
    return (sentence(pull, chance, mismatch, effects, blocks), *notes)


def sentence(pull: Pull, chance: float, mismatch: bool, effects: Sequence[Finding], blocks: HeldOut) -> str:
    """Return the verdict in one sentence."""
    if not mismatch:
        return f"{pull.object}: constant friction on a hinge and recording agree (p = {chance:.2g})"
    if not effects:
        return f"{pull.object}: something is left out (p = {chance:.2g}), and it is none of what the library knows"
    told = []
    for each in effects:
        where = next((entry for name, entry in each.parameters.items() if name.endswith(ANGLE)), None)
        spot = ""
        if where is not None:
            mean, sd = math.degrees(float(where["mean"])), math.degrees(float(where["sd"]))
            spot = f" at {mean:.1f} ± {max(sd, 0.1):.1f} degrees"
        told.append(f"{each.effect}{spot}")
    sure = 100.0 * min(each.probability for each in effects)
    return (
        f"{pull.object}: {' and '.join(told)} left out ({sure:.0f} %, p = {chance:.2g}); held-out force off by "
        f"{blocks.rmse_before:.2f} N before, {blocks.rmse_after:.2f} N after"
    )
