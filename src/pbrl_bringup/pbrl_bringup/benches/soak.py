"""An hour among furniture: one room after another, the same nodes. Memory, handles, threads and deadlines over time."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pbrl_bag.errors import BagError
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.figures import canvas, save
from pbrl_bringup.soak.deadlines import Ticks, read_ticks
from pbrl_bringup.soak.rooms import Room, Sample, in_rooms

Array = NDArray[np.float64]

MINUTES, QUICK_MINUTES = 60.0, 2.0
WARM, LAST = 0.35, 0.2
"""Shares of the time: what is allocated once is allocated by then; the end is compared with what follows that."""
GROWTH, MISSED, GAP = 0.02, 0.01, 1.0
"""Of memory; of ticks; of a recording [s]."""
COLOURS = {"sim": "#d98b3a", "controller": "#3a7bd9", "namo": "#5aa469", "recorder": "#a05aa4"}


@dataclass(frozen=True)
class Trend:
    """One number of one node over the time.

    Attributes:
        begin: median of the fifth of the time that follows the warm-up.
        end: median of the last fifth.
    """

    begin: float
    end: float

    @property
    def growth(self) -> float:
        """Share by which it has grown."""
        return (self.end - self.begin) / self.begin if self.begin else 0.0


def measure(seed: int, quick: bool, out: Path, *, minutes: float | None = None) -> Measured:
    """Let the robot find its way in random rooms.

    Args:
        seed: of rooms, simulators and missions.
        quick: whether it is short.
        out: folder for logs, the recording, the figure.
        minutes: of simulated time; None: 60.

    Raises:
        BringupError: a node does not come, or ends by itself.
    """
    length = 60.0 * ((QUICK_MINUTES if quick else MINUTES) if minutes is None else minutes)
    begun = time.time()
    rooms, samples = in_rooms(out / f"soak_{int(begun)}", seed, length)
    bag = out / f"soak_{int(begun)}" / "bag"
    try:
        ticks = read_ticks(bag)
    except BagError as error:
        raise BringupError(f"soak: expected a recording that reads: {error}") from error
    draw(out, samples, ticks)
    trends = {node: trend_of([(each.time, each.memory) for each in own]) for node, own in by_node(samples).items()}
    rows = rows_of(rooms, samples, ticks, trends)
    return Measured(
        rows, {"rooms": [asdict(each) for each in rooms], "memory": {k: asdict(v) for k, v in trends.items()}}
    )


def by_node(samples: Sequence[Sample]) -> dict[str, list[Sample]]:
    """Return the samples of each node, in their order."""
    return {node: [each for each in samples if each.node == node] for node in sorted({each.node for each in samples})}


def trend_of(points: Sequence[tuple[float, float]]) -> Trend:
    """Return what became of a number, from (when [s], value)."""
    times, values = np.array(points, dtype=float).T
    first, whole = times[0] + WARM * (times[-1] - times[0]), times[-1] - times[0]
    begin = values[(times >= first) & (times <= first + LAST * whole)]
    end = values[times >= times[-1] - LAST * whole]
    return Trend(float(np.median(begin if len(begin) else values)), float(np.median(end)))


def rows_of(
    rooms: Sequence[Room], samples: Sequence[Sample], ticks: Mapping[str, Ticks], trends: Mapping[str, Trend]
) -> list[Row]:
    """Return the rows of acceptance."""
    own = by_node(samples)
    handles = {node: trend_of([(each.time, each.handles) for each in rows]) for node, rows in own.items()}
    threads = {node: trend_of([(each.time, each.threads) for each in rows]) for node, rows in own.items()}
    worst = max(trends, key=lambda node: trends[node].growth)
    ended = sum(room.reached for room in rooms)
    simulated = sum(room.seconds for room in rooms)
    return [
        at_least("simulated time", simulated / 60.0, "min", 0.0, rooms=len(rooms), goals_reached=ended),
        at_most(
            "memory, growth of the node with most of it",
            trends[worst].growth,
            "1",
            GROWTH,
            node=worst,
            **{node: f"{each.begin / 2**20:.0f} to {each.end / 2**20:.0f} MiB" for node, each in trends.items()},
        ),
        at_most("file handles, most that a node has gained", max(t.end - t.begin for t in handles.values()), "1", 0),
        at_most("threads, most that a node has gained", max(t.end - t.begin for t in threads.values()), "1", 0),
        *(
            at_most(
                f"deadlines of {name} missed, share",
                each.missed,
                "1",
                MISSED,
                ticks=each.count,
                longest=each.longest,
                uneven=each.uneven,
            )
            for name, each in ticks.items()
        ),
        at_most("longest gap in the recording while a simulator ran", max(t.gap for t in ticks.values()), "s", GAP),
    ]


def draw(out: Path, samples: Sequence[Sample], ticks: Mapping[str, Ticks]) -> Path:
    """Draw memory, handles, threads and late ticks over time."""
    figure, (memory, handles, late) = canvas(3, width=13.0, height=4.2)
    for node, own in by_node(samples).items():
        minutes = [(each.time - samples[0].time) / 60.0 for each in own]
        colour = COLOURS.get(node, "grey")
        memory.plot(minutes, [each.memory / 2**20 for each in own], color=colour, label=node)
        handles.plot(minutes, [each.handles for each in own], color=colour, label=f"{node}, handles")
        handles.plot(minutes, [each.threads for each in own], color=colour, linestyle=":", label="threads")
    for name, each in ticks.items():
        late.plot(each.minutes, 100.0 * np.asarray(each.uneven_by_minute), label=name)
    _name(memory, "memory [MiB]")
    _name(handles, "handles, and threads (dotted)")
    _name(late, "ticks later than two periods [%]")
    memory.legend(frameon=False, fontsize=8)
    late.legend(frameon=False, fontsize=8)
    return save(figure, out)


def _name(axes: Axes, text: str) -> None:
    axes.set_xlabel("wall clock [min]")
    axes.set_title(text, fontsize=10, loc="left")
    axes.set_ylim(bottom=0.0)
