"""A running graph as the page's source: what it says is kept for ten minutes, and told on as it comes."""

from __future__ import annotations

import asyncio
import json
import math
import threading
from bisect import bisect_left
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag import BagError, BodyGeometry, PoseStream, Recording, WrenchStream
from pbrl_bag.decoding import poses_in, wrench_in
from pbrl_bag.geometry import bodies_of_scene, corners
from pbrl_bag.grasps import GraspChange, change_in, grasps_from_changes
from pbrl_bag.roles import CONTRACT, GRASPS_TOPIC, Kind, Role, roles_of
from pbrl_bringup.view.decorate import decorated
from pbrl_bringup.view.extras import Extras
from pbrl_bringup.view.shown import Shown, shown_of

Array = NDArray[np.float64]

MEMORY = 600.0
"""Seconds that are kept."""
TRIM = 1.1
"""Streams are cut back to that when they have so many times as much."""
PERIOD = 0.1
"""Between two events [s]."""
MARGIN = 1.0
"""Seconds before what is new that are told again, so that forces find the gripper's pose; the page knows them."""
BACK = 1.0
"""A stamp so much [s] before the last one means that the clock began anew."""
UNIT = 0.1
"""How much the length of a quaternion may differ from one; a pose with another is left out."""
TOLD = 5000
"""Samples of a stream in an answer at most."""


@dataclass
class Growing:
    """A stream that grows: stamps [s] and numbers."""

    time: list[float] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)

    def add(self, time: float, row: tuple[float, ...]) -> None:
        """Add a sample; one that is older than the last, or no number, is left out."""
        if (self.time and time <= self.time[-1]) or not np.isfinite([time, *row]).all():
            return
        self.time.append(time)
        self.rows.append(row)
        if self.time[-1] - self.time[0] > TRIM * MEMORY:
            cut = bisect_left(self.time, self.time[-1] - MEMORY)
            del self.time[:cut], self.rows[:cut]

    def since(self, time: float, width: int) -> tuple[Array, Array]:
        """Return times (n,) and rows (n, width) from a time [s] on."""
        first = bisect_left(self.time, time)
        return np.array(self.time[first:]), np.array(self.rows[first:], dtype=np.float64).reshape(-1, width)


class LiveGraph:
    """What has been heard of a graph. Messages may come from another thread.

    Args:
        title: names it on the page.
    """

    live = True

    def __init__(self, title: str) -> None:
        self.title = title
        self._lock = threading.Lock()
        self._extras = Extras()
        self._begin()

    def _begin(self) -> None:
        self._streams: dict[tuple[Kind, str], Growing] = {}
        self._changes: list[GraspChange] = []
        self._origin: float | None = None
        self._now = 0.0
        self._version = getattr(self, "_version", 0) + 1
        self._scene: tuple[dict[str, BodyGeometry], Array] = getattr(self, "_scene", ({}, np.empty((0, 2))))

    def wants(self, topic: str) -> bool:
        """Tell whether a topic is worth hearing."""
        return bool(roles_of(topic, CONTRACT)) or topic in self._extras.hearers()

    def hear(self, topic: str, message: Any) -> None:
        """Take a message; topics that nobody wants are left out.

        Raises:
            BagError: it does not fit its topic.
        """
        with self._lock:
            for role in roles_of(topic, CONTRACT):
                self._take(topic, role, message)
            if topic in self._extras.hearers():
                self._extras.hearers()[topic](message)

    def _take(self, topic: str, role: Role, message: Any) -> None:
        if role.kind == "scene":
            if not (hasattr(message, "bodies") and hasattr(message, "room")):
                raise BagError(f"{topic}: expected pbrl_msgs/Scene, got {type(message).__name__}")
            self._scene = (bodies_of_scene(topic, message), corners(message.room))
            self._version += 1
        elif role.kind == "grasps":
            change = change_in(topic, message)
            if not self._changes or change.time >= self._changes[-1].time:
                self._changes.append(change)
                self._version += 1
        elif role.kind == "wrenches":
            felt = wrench_in(topic, message)
            self._add(role, felt.time, (*felt.force, *felt.torque))
        else:
            for pose in poses_in(topic, message, None):
                if pose.frame == CONTRACT.world and abs(math.hypot(*pose.quaternion) - 1.0) < UNIT:
                    self._add(role, pose.time, (*pose.position, *pose.quaternion))

    def _add(self, role: Role, time: float, row: tuple[float, ...]) -> None:
        if self._origin is not None and time < self._now - BACK:
            self._begin()
        if self._origin is None:
            self._origin = time
        if (role.kind, role.name) not in self._streams:
            self._version += 1
        self._streams.setdefault((role.kind, role.name), Growing()).add(time, row)
        self._now = max(self._now, time)

    def data(self) -> dict[str, Any]:
        """Return all that is still and the whole of the streams."""
        with self._lock:
            shown = self._shown(-np.inf)
            begin = max(0.0, shown.end - MEMORY)
        return {**shown.data(TOLD), "begin": begin}

    def detail(self, start: float, end: float, most: int) -> dict[str, Any]:
        """Return the streams between two times [s], at most `most` samples of each."""
        with self._lock:
            shown = self._shown(start + (self._origin or 0.0) - MARGIN)
        return shown.detail(start, end, most)

    async def events(self) -> AsyncIterator[str]:
        """Yield `streams` with what is new, and `still` when everything has to be asked for again."""
        version, since = self._state()
        yield "retry: 1000\n\n"
        while True:
            await asyncio.sleep(PERIOD)
            now, end = self._state()
            if now != version:
                version, since = now, end
                yield "event: still\ndata: {}\n\n"
            elif end > since:
                told = {"end": round(end, 4), "streams": self.detail(since - MARGIN, end, TOLD)}
                since = end
                yield f"event: streams\ndata: {json.dumps(told, allow_nan=False, separators=(',', ':'))}\n\n"

    def _state(self) -> tuple[tuple[int, int], float]:
        with self._lock:
            return (self._version, self._extras.version), self._now - (self._origin or 0.0)

    def _shown(self, since: float) -> Shown:
        """Return what is shown from a time of the graph's clock [s] on."""
        poses: dict[str, dict[str, PoseStream]] = {"object_poses": {}, "gripper_poses": {}}
        wrenches = {}
        for (kind, name), stream in sorted(self._streams.items()):
            if kind == "wrenches":
                time, rows = stream.since(since, 6)
                wrenches[name] = WrenchStream(time, rows[:, :3], rows[:, 3:])
            else:
                time, rows = stream.since(since, 7)
                poses[kind][name] = PoseStream(time, rows[:, :3], rows[:, 3:])
        end = max([self._now, *(change.time for change in self._changes[-1:])])
        grasps = grasps_from_changes(GRASPS_TOPIC, self._changes, end)
        bodies, room = self._scene
        notes = () if self._streams or bodies else ("nothing has been heard yet: is a graph running in this domain?",)
        recording = Recording(Path(), bodies, **poses, wrenches=wrenches, grasps=grasps, room=room, notes=notes)
        origin = self._origin if self._origin is not None else end
        return decorated(shown_of(recording, self.title, span=(origin, end)), self._extras)
