"""Settings of the watch over a stream."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pbrl_mismatch.errors import MismatchError
from pbrl_model.parameters import nearest

Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class MonitorOptions(BaseModel):
    """Settings of a `MismatchMonitor`.

    Attributes:
        false_alarm: chance of an alarm within `horizon` of pushing if the model is right, all objects apart.
        horizon: [s].
        hop: between two looks [s]; every length of a window is a whole number of hops.
        windows: lengths of the windows that are tested, each on as many grids as hops fit into it [s].
        lookahead: a window is tested when so much after it has been heard [s], so that its streams are complete.
        context: before a window that is smoothed with it [s].
        forces: sizes of a left-out force that are looked for [N].
        sensor_floor: size of the wrist sensor's own error in motion [N].
        sensor_share: the same as a share of what it feels: gain, and the lever of a grip that gives a little.
        closing: of a grip [s]: what is held may still be rolling, and is brought to rest at once.
        rest: after an alarm before the next about the same object [s].
        keep: given to a diagnosis, in whole holds [s].
        gather: heard after an alarm before the diagnosis begins [s]: a mismatch that has just begun has no shape yet.

    Raises:
        MismatchError: an option is unknown or out of range.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    false_alarm: Share = 0.01
    horizon: Positive = 1800.0
    hop: Positive = 0.5
    windows: tuple[Positive, ...] = (1.0, 2.0)
    lookahead: Annotated[float, Field(ge=0.0, le=2.0)] = 0.2
    context: Annotated[float, Field(ge=0.0, le=20.0)] = 2.0
    forces: tuple[Positive, ...] = (1.0, 3.0, 10.0, 30.0)
    sensor_floor: Positive = 0.15
    sensor_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    closing: Annotated[float, Field(ge=0.0, le=5.0)] = 0.5
    rest: Positive = 30.0
    keep: Annotated[float, Field(ge=5.0, le=600.0)] = 60.0
    gather: Annotated[float, Field(ge=0.0, le=60.0)] = 5.0

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"])
            if first["type"] == "extra_forbidden":
                hint = nearest(place, list(type(self).model_fields))
                raise MismatchError(f"monitor options: unknown option {place!r}{hint}") from None
            raise MismatchError(f"monitor options: {place}: {first['msg']}, got {first['input']!r}") from None
        hops = [length / self.hop for length in self.windows]
        if not hops or not self.forces or any(abs(each - round(each)) > 1e-6 or each < 0.5 for each in hops):
            raise MismatchError(
                f"monitor options: expected forces, and windows that are whole numbers of hops of {self.hop:g} s, got "
                f"{self.forces} and {self.windows}"
            )

    @property
    def grids(self) -> tuple[tuple[float, int], ...]:
        """Return every grid: length of its windows [s], and the hop at which its first one begins."""
        return tuple((length, k) for length in self.windows for k in range(round(length / self.hop)))

    @property
    def threshold(self) -> float:
        """Return the logarithm of what a grid's statistic must reach for an alarm.

        The statistic R of a grid is a Shiryaev-Roberts sum of e-values: R minus the number of windows is a martingale
        under the model, so by Doob's inequality R reaches c within n windows with a chance of at most n / c. The
        grids, and the sum for what lasts (`lasting`), share the promised chance evenly.
        """
        windows = sum(self.horizon / length for length, _ in self.grids) + self.horizon / max(self.windows)
        return float(np.log(windows / self.false_alarm))
