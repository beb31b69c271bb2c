"""What the page of a report shows: the schema of the JSON blob that `report.html` carries.

SI units, radians, seconds; planar poses are (x, y, theta) of the body's frame in `world`; points of
an outline are (x, y) in the body's frame. Times start at zero with each episode. A number that is
not known is None, never NaN: the blob is strict JSON.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field


def _finite_or_none(value: float | None) -> float | None:
    """Turn NaN and infinities, which JSON does not have, into None."""
    return None if value is None or not math.isfinite(value) else value


Number = Annotated[float | None, BeforeValidator(_finite_or_none)]
Point = tuple[float, float]
Pose = tuple[float, float, float]


class _Part(BaseModel):
    """Base of the parts: nothing unknown, nothing changed afterwards, no NaN."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Parameter(_Part):
    """One line of the table of numbers.

    Attributes:
        name: as in `report.json`, e.g. `wheel_x`.
        meaning: in plain words.
        mean: posterior mean (circular for angles).
        sd: posterior standard deviation.
        unit: "kg", "m", "rad" or "1".
        prior: what was believed before, in words and numbers.
    """

    name: str
    meaning: str
    mean: Number
    sd: Number
    unit: str
    prior: str


class Wheel(_Part):
    """Posterior of the one constrained wheel, in the body's frame.

    Attributes:
        draws: (n) of (x, y, theta).
        mean: (x, y).
        ellipse: outline of the region that holds 95 % of a normal with the draws' moments.
        radius95: 95 % of the draws lie within this distance of the mean [m].
    """

    draws: list[Pose]
    mean: Point
    ellipse: list[Point]
    radius95: float


class Hinge(_Part):
    """Posterior of a pivot fixed to the world: draws of (x, y, radius) in `world`."""

    draws: list[Pose]
    mean: Pose
    ellipse: list[Point]


class Contact(_Part):
    """Where one gripper held, in the body's frame."""

    gripper: str
    point: Point


class Episode(_Part):
    """One push: what was recorded and what the models make of the same forces.

    Attributes:
        time: (n) [s] from the push's beginning.
        recorded: (n) poses from the tags.
        before: (n) poses predicted by the model without learning; empty where there is none.
        after: (n) poses predicted with the posterior mean of the rollouts.
        draws: (k, n) poses predicted by single posterior draws.
        wrench: (n) of (fx [N], fy [N], tau [N m]) at the body's frame origin, world axes.
        contacts: the grippers that held.
        error_before: (n) [m] distance between recorded and predicted position.
        error_after: (n) [m] the same after learning.
        fitted: whether the model saw this push when it was fitted.
        restart: [s] after which predictions start again from what was recorded; None: never.
        end_before: [m] how far predictions are off where they end, without learning.
        end_after: [m] the same after learning.
    """

    label: str
    time: list[float]
    recorded: list[Pose]
    before: list[Pose]
    after: list[Pose]
    draws: list[list[Pose]]
    wrench: list[Pose]
    contacts: list[Contact]
    error_before: list[Number]
    error_after: list[Number]
    fitted: bool
    restart: Number = None
    end_before: Number = None
    end_after: Number = None


class HeldOut(_Part):
    """Prediction of windows that the fit did not see; root mean squares over the windows' ends."""

    windows: int
    horizon: Number = Field(description="length of a window [s]")
    position_before: Number
    position_after: Number
    yaw_before: Number
    yaw_after: Number


class Truth(_Part):
    """What the simulator concealed. Given for comparison after the fit, never to the fit.

    Attributes:
        note: one sentence that says where this comes from.
        locked: positions of locked casters in the body's frame.
        distance: from the posterior mean of the wheel to the nearest locked caster [m].
    """

    note: str
    locked: list[Point]
    distance: Number


class ObjectReport(_Part):
    """Everything about one object."""

    name: str
    verdict: str
    detail: str
    model_class: str
    footprint: list[Point]
    casters: list[Point]
    parameters: list[Parameter]
    notes: list[str] = []
    wheel: Wheel | None = None
    hinge: Hinge | None = None
    episodes: list[Episode]
    heldout: HeldOut | None = None
    truth: Truth | None = None


class Made(_Part):
    """How the page was made, so that it can be made again."""

    command: str
    recording: str
    seed: int | None
    created: str
    seconds: Number
    versions: dict[str, str]


class Report(_Part):
    """The whole page."""

    title: str
    verdict: str
    detail: str
    room: list[Point]
    objects: list[ObjectReport]
    made: Made
