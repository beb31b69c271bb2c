"""What is left out of a fit, and how well the learned model predicts it, beside the model before learning."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.errors import ModelError
from pbrl_model.fitting.options import FitOptions
from pbrl_model.geometry import MassProperties
from pbrl_model.predict import PathError, path_error, predict_windows, unlearned
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import Windows, integrated_windows, one_step_windows, shooting_windows, whole_windows

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Split:
    """Windows to fit and windows to predict.

    Attributes:
        fitted: windows of the likelihood.
        searched: motions that shorter windows may be cut from.
        heldout: windows left out, or None.
        kind: "windows" or "episodes".
    """

    fitted: Windows
    searched: tuple[Motion, ...]
    heldout: Windows | None
    kind: str


@dataclass(frozen=True)
class Heldout:
    """Errors on what was left out.

    Attributes:
        kind: "windows" (each from its smoothed start) or "episodes" (open loop from the first state).
        count: how many.
        seconds: length of the longest [s].
        before: with the nominal mass and no wheel.
        after: with the mean prediction of the posterior.
    """

    kind: str
    count: int
    seconds: float
    before: PathError
    after: PathError

    def to_report(self) -> dict[str, Any]:
        """Return the form of `report.json`."""
        fields = ("rmse_position", "rmse_yaw", "final_position", "final_yaw")
        units = ("m", "rad", "m", "rad")
        errors = {
            f"{field}_{unit}": {
                when: _number(getattr(error, field)) for when, error in (("before", self.before), ("after", self.after))
            }
            for field, unit in zip(fields, units, strict=True)
        }
        return {"kind": self.kind, "count": self.count, "seconds": self.seconds, **errors}


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def split(motions: Sequence[Motion], options: FitOptions) -> Split:
    """Divide the motions of one object into what is fitted and what is left out.

    Windows are left out evenly over the recording, so that both halves see every kind of motion.

    Raises:
        ModelError: more episodes are to be left out than can be spared.
    """
    kept = tuple(motions)
    aside: tuple[Motion, ...] = ()
    if options.holdout_episodes:
        if options.holdout_episodes >= len(motions):
            raise ModelError(
                f"{motions[0].object}: expected more than {options.holdout_episodes} episodes to leave so many out, "
                f"got {len(motions)}; leave out fewer (holdout_episodes)"
            )
        kept, aside = tuple(motions[: -options.holdout_episodes]), tuple(motions[-options.holdout_episodes :])
    if options.likelihood == "one_step":
        return Split(one_step_windows(kept), kept, whole_windows(aside) if aside else None, "episodes")
    if options.likelihood == "integrated":
        return Split(integrated_windows(kept), kept, whole_windows(aside) if aside else None, "episodes")
    windows = shooting_windows(kept, options.window)
    if aside:
        return Split(windows, kept, whole_windows(aside), "episodes")
    count = round(options.holdout_share * len(windows))
    if count == 0 or len(windows) - count < 1:
        return Split(windows, kept, None, "windows")
    out = np.zeros(len(windows), dtype=bool)
    out[np.round((np.arange(count) + 0.5) * len(windows) / count).astype(int)] = True
    return Split(windows.take(~out), kept, windows.take(out), "windows")


def heldout_error(kind: str, windows: Windows, rows: Array, geometry: BodyGeometry, body: MassProperties) -> Heldout:
    """Predict what was left out before and after learning.

    Args:
        kind: "windows" or "episodes".
        windows: left out.
        rows: (draws, 12) of the posterior.
        geometry: nominal mass.
        body: centre of mass and inertia over mass.
    """
    before = path_error(windows, predict_windows(windows, unlearned(geometry).to_vector()[None], body))
    after = path_error(windows, predict_windows(windows, rows, body))
    return Heldout(kind, len(windows), float(windows.steps.max() * windows.dt), before, after)
