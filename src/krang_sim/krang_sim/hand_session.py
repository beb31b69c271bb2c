"""A hand without a robot that pushes furniture when it is asked to: physics, pushes in, observations out. No ROS.

Simulated time stands still between pushes. Same scene, same seed and same pushes: same observations, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Self

import numpy as np

from bullet_sim.catalogue import Fixture
from bullet_sim.client import BulletClient
from bullet_sim.hand import HandSpec
from bullet_sim.hand_push import HandRun, check_pushes
from bullet_sim.hand_recording import GraspChange, HandPath, HandPush
from bullet_sim.scene import Scene
from bullet_sim.sensors import TagReading as SeenTag
from bullet_sim.sensors import Ticker
from bullet_sim.sensors import WristReading as FeltWrist
from bullet_sim.world import World
from krang_sim.errors import KrangError
from krang_sim.known import known_scene
from krang_sim.observations import ClockTick, GraspState, Hold, Observation, TagReading, WristReading

SIDE = "left"
"""The gripper that the hand plays."""
CLOCK_RATE = 100.0
"""Ticks of the clock a simulated second [Hz]."""
RAMP = 0.2
"""In which a push gets up to speed, and stops [s]."""
LONGEST = 60.0
"""Of one push [s]."""

Publish = Callable[[list[Observation]], None]


def straight_push(
    body: str, contact: Sequence[float], direction: Sequence[float], speed: float, duration: float
) -> HandPush:
    """Return a push along a straight line, with a ramp at both ends.

    Args:
        body: name.
        contact: (2,) on its outline, in its frame [m].
        direction: (2,) in `world`; its length does not matter.
        speed: [m/s].
        duration: [s].

    Raises:
        KrangError: a number that is none, a direction without length, or one that is too long or too short.
    """
    numbers = np.array([*contact[:2], *direction[:2], speed, duration], dtype=float)
    if not np.isfinite(numbers).all():
        raise KrangError(f"push: expected finite numbers, got {numbers.tolist()}")
    length = float(np.hypot(numbers[2], numbers[3]))
    if length <= 0.0 or speed <= 0.0:
        raise KrangError(f"push: expected a direction and a speed above zero, got {list(direction)} and {speed} m/s")
    if not 2 * RAMP < duration <= LONGEST:
        raise KrangError(f"push: expected a duration from {2 * RAMP} to {LONGEST} s, got {duration} s")
    along = speed / length * np.array([numbers[2], numbers[3], 0.0])
    time = np.array([0.0, RAMP, duration - RAMP, duration])
    return HandPush(body, (float(contact[0]), float(contact[1])), HandPath(time, np.outer([0, 1, 1, 0], along)))


class HandSession:
    """Furniture and a hand.

    Args:
        scene: what to build, concealed part included; its robot is left out.
        seed: of every random draw.
        publish: takes what is published, step by step while a push goes on.

    Raises:
        SimError: a scene that cannot be built.
    """

    def __init__(self, scene: Scene, *, seed: int, publish: Publish) -> None:
        world_seed, self._sensor_seed = np.random.SeedSequence(seed).spawn(2)
        self._client = BulletClient()
        try:
            self._world = World(self._client, scene, np.random.default_rng(world_seed))
        except BaseException:
            self._client.close()
            raise
        self.scene = scene
        self.tagged = tuple(name for name, body in scene.bodies.items() if not isinstance(body, Fixture))
        self._publish = publish
        self._clock = Ticker(CLOCK_RATE)
        self._run: HandRun | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def latched(self) -> list[Observation]:
        """Return what is known from the start: the scene, and that nothing is held."""
        return [ClockTick(0.0), known_scene(self.scene, 0.0), GraspState(0.0, ())]

    def push(self, push: HandPush) -> str:
        """Do one push and publish what is seen and felt; give "done", or a sentence on what went wrong.

        Raises:
            SimError: the push does not fit the scene.
        """
        check_pushes(self.scene, [push], SIDE)
        if self._run is None:
            rng = np.random.default_rng(self._sensor_seed)
            self._run = HandRun(self._world, push, HandSpec(), SIDE, rng, self._heard)
        return self._run.one_more(push)

    def close(self) -> None:
        """End the Bullet client; a second call does nothing."""
        self._client.close()

    def _heard(
        self, time: float, felt: FeltWrist | None, seen: list[SeenTag], changes: tuple[GraspChange, ...]
    ) -> None:
        news: list[Observation] = [ClockTick(time)] if self._clock.due(time) else []
        news += [GraspState(change.time, _holds(change)) for change in changes]
        if felt is not None:
            news.append(WristReading(felt.stamp, SIDE, felt.force, felt.torque))
        news += [TagReading(each.stamp, each.name, each.position, each.quaternion) for each in seen]
        if news:
            self._publish(news)


def _holds(change: GraspChange) -> tuple[Hold, ...]:
    return () if change.body is None else (Hold(SIDE, change.body, change.contact),)
