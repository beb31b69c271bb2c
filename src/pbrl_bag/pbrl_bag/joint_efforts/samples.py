"""What /joint_states has brought so far of one arm: efforts of its joints, positions of all."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pbrl_bag.decoding import seconds
from pbrl_bag.errors import BagError
from pbrl_bag.mapping import EffortSource
from pbrl_bag.streams import check_finite
from pbrl_bag.types import Array
from pbrl_bag.validation import nearest


@dataclass
class JointSamples:
    """Joint states of one arm.

    A topic may bring the joints in several messages of its own each; those with none of the arm's are still read for
    positions, since a torso turns the arm against gravity.

    Attributes:
        label: what to call the stream in errors: its topic.
        source: how it is read.
        times: [s] of the messages with the arm's joints.
        efforts: (k,) [N m] each, in the order of `source.joints`.
        positions: times [s] and positions [rad or m] by joint.
        lags: when each was heard less its stamp [s], where that is known.
    """

    label: str
    source: EffortSource
    times: list[float] = field(default_factory=list)
    efforts: list[list[float]] = field(default_factory=list)
    positions: dict[str, tuple[list[float], list[float]]] = field(default_factory=dict)
    lags: list[Array] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.times)

    @property
    def time(self) -> Array:
        """Return (n,) when the arm's efforts were measured [s]."""
        return np.array(self.times)

    def add(self, message: Any, heard: float | None) -> None:
        """Take one sensor_msgs/JointState.

        Raises:
            BagError: it is none, it has some of the arm's joints only, or it has no efforts.
        """
        if not all(hasattr(message, name) for name in ("header", "name", "position", "effort")):
            raise BagError(
                f"{self.label}: expected sensor_msgs/JointState, got {type(message).__name__}; "
                "give another topic in the mapping"
            )
        time = seconds(message.header.stamp) + self.source.clock_offset
        places = {name: k for k, name in enumerate(message.name)}
        if len(message.position) == len(places):
            for name, k in places.items():
                times, values = self.positions.setdefault(name, ([], []))
                times.append(time)
                values.append(float(message.position[k]))
        missing = [name for name in self.source.joints if name not in places]
        if len(missing) == len(self.source.joints):
            return
        if missing:
            raise BagError(
                f"{self.label}: t = {time:.6f} s: expected joint {missing[0]!r} beside the arm's others, got none; "
                f"{nearest(missing[0], list(places))}"
            )
        if len(message.effort) != len(places):
            raise BagError(
                f"{self.label}: t = {time:.6f} s: effort: expected {len(places)} numbers, one for each joint, got "
                f"{len(message.effort)}; without efforts nothing is known of what the hand feels"
            )
        self.times.append(time)
        self.efforts.append([float(message.effort[places[name]]) for name in self.source.joints])
        if heard is not None:
            self.lags.append(np.array([heard - time]))

    def effort(self) -> Array:
        """Return (n, k) efforts [N m].

        Raises:
            BagError: one is not finite, as of a driver that has no effort interface.
        """
        values = np.array(self.efforts).reshape(-1, len(self.source.joints))
        check_finite(self.label, self.time, values, tuple(f"effort of {name}" for name in self.source.joints))
        return values

    def angles(self, joints: tuple[str, ...]) -> Array:
        """Return (n, c) positions of joints at the times of the efforts [rad or m].

        Raises:
            BagError: one of them is never told.
        """
        columns = []
        for name in joints:
            if name not in self.positions:
                raise BagError(
                    f"{self.label}: expected the position of joint {name!r}, which carries the hand, got none; "
                    f"{nearest(name, list(self.positions))}"
                )
            times, values = map(np.array, self.positions[name])
            check_finite(self.label, times, values[:, None], (f"position of {name}",))
            columns.append(np.interp(self.time, times, values))
        return np.column_stack(columns)
