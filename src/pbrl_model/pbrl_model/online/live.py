"""A recording that is still growing: messages in as they come, the last stretch of it out whenever it is asked for."""

from __future__ import annotations

import math
from typing import Any

from pbrl_bag.builder import RecordingBuilder
from pbrl_bag.decoding import seconds
from pbrl_bag.mapping import PoseSource, WrenchSource
from pbrl_bag.roles import CONTRACT, GRASPS_TOPIC, SCENE_TOPIC, roles_of
from pbrl_bag.types import Recording

RESTART = 1.0
"""A stamp that is older than the topic's last by more than this [s] is of another clock: a bag played again."""
BEFORE_GRASP = 2.5
"""Of what lies before a grasp, this much is kept with the grasp [s]: weight and bias are read there."""
AFTER_GRASP = 0.5
"""Likewise of what lies after its beginning [s]."""


class LiveRecording:
    """Collects the contract's topics.

    Attributes:
        clocks: how many clocks there have been; it grows when stamps go back.
        left_out: messages older than the last of their topic, which were left out.
    """

    def __init__(self) -> None:
        self.clocks = 0
        self.left_out = 0
        self._builder = RecordingBuilder()
        self._last: dict[str, float] = {}
        self._forgotten = -math.inf
        self._scene: Any = None
        self._grasps: list[Any] = []

    def add(self, topic: str, message: Any) -> None:
        """Take one decoded message; topics without a role are ignored.

        Raises:
            BagError: its type or frame does not fit the topic's role.
        """
        if not self._builder.wants(topic):
            return
        if topic == SCENE_TOPIC:
            self._scene = message
            self._builder.add(topic, message)
            return
        stamp = seconds(message.header.stamp)
        last = self._last.get(topic, stamp)
        if stamp < last - RESTART:
            self._begin_again(stamp)
        elif stamp < last or (stamp == last and topic in self._last and topic != GRASPS_TOPIC):
            self.left_out += 1
            return
        self._last[topic] = stamp
        if topic == GRASPS_TOPIC:
            if self._grasps and self._grasps[-1].grasps == message.grasps:
                return
            self._grasps.append(message)
        self._builder.add(topic, message)

    def recording(self) -> Recording:
        """Return what is kept; of a hold that was forgotten there may be nothing but the word on it.

        Raises:
            BagError: a topic is missing or a stream is malformed.
        """
        return self._builder.build("what is heard", since=self._forgotten)

    @property
    def held(self) -> bool:
        """Tell whether anything has been held on this clock."""
        return any(message.grasps for message in self._grasps)

    @property
    def now(self) -> float:
        """Return the newest stamp of any topic [s], minus infinity before the first."""
        return max(self._last.values(), default=float("-inf"))

    def forget(self, before: float) -> None:
        """Drop samples older than `before` [s], but for those around the beginning of the holds that lasted until then.

        Args:
            before: what came earlier is used up.
        """
        self._forgotten = before
        starts = self._starts(before)
        for topic in self._last:
            for role in roles_of(topic, CONTRACT):
                if not isinstance(role.source, PoseSource | WrenchSource):
                    continue
                rows = self._builder.samples(role.kind, role.name, topic, role.source).rows
                rows[:] = [
                    row
                    for row in rows
                    if row[0] >= before or any(-BEFORE_GRASP <= row[0] - start <= AFTER_GRASP for start in starts)
                ]

    def _starts(self, before: float) -> set[float]:
        """Return when the grasps began that last, or ended after `before`: their end is not yet used up [s]."""
        since: dict[tuple[str, str], float] = {}
        ended: set[float] = set()
        for message in self._grasps:
            held = {(grasp.gripper, grasp.object) for grasp in message.grasps}
            stamp = seconds(message.header.stamp)
            if stamp > before:
                ended |= {start for pair, start in since.items() if pair not in held}
            since = {pair: since.get(pair, stamp) for pair in held}
        return ended | set(since.values())

    def _begin_again(self, stamp: float) -> None:
        """Drop everything but the scene, and a last word on grasps that is not older than the new clock."""
        self.clocks += 1
        self._builder, self._last, self._forgotten = RecordingBuilder(), {}, -math.inf
        if self._scene is not None:
            self._builder.add(SCENE_TOPIC, self._scene)
        grasps = [message for message in self._grasps[-1:] if seconds(message.header.stamp) <= stamp]
        self._grasps = []
        for message in grasps:
            self.add(GRASPS_TOPIC, message)
