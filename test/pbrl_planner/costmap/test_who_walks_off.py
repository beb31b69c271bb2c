"""Who walks off takes their trunk along, as soon as the level laser sees the floor where they stood."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_control.planar import Array, on_floor
from pbrl_planner.costmap import Costmap, CostmapSettings, RangeScan

LEVEL, NODDING = 0.28, 1.26
"""Heights of both lasers [m]."""
ANGLES = -0.82 + 0.01 * np.arange(165)
RATE = 20.0
"""Scans of either laser [1/s]."""
WALL = 4.0
TRUNK = 0.24, 0.85, 1.6
LEG = 0.07
TABLE = (1.4, 2.0), 0.5, (0.70, 0.74)
"""Along x, half its width along y, and heights of its top [m]."""


def discs(rays: Array, height: float, radius: float, low: float, high: float, x: float, y: float) -> Array:
    """Ranges to an upright cylinder, from over the origin."""
    flat = np.hypot(rays[:, 0], rays[:, 1])
    along = (rays[:, 0] * x + rays[:, 1] * y) / flat
    off = (rays[:, 0] * y - rays[:, 1] * x) / flat
    with np.errstate(invalid="ignore"):
        far = (along - np.sqrt(radius**2 - off**2)) / flat
    at = height + far * rays[:, 2]
    return np.where(np.isfinite(far) & (far > 0.0) & (at > low) & (at < high), far, np.inf)


def world(rays: Array, height: float, person: tuple[float, float] | None, table: bool) -> Array:
    """Ranges along rays (n, 3) from over the origin to floor, wall, person and table."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.where(rays[:, 2] < 0.0, -height / rays[:, 2], np.inf)
        found = np.minimum(found, np.where(rays[:, 0] > 0.0, WALL / rays[:, 0], np.inf))
        if table:
            far = (TABLE[2][1] - height) / rays[:, 2]
            ends = far[:, None] * rays
            on = (far > 0.0) & (ends[:, 0] > TABLE[0][0]) & (ends[:, 0] < TABLE[0][1]) & (np.abs(ends[:, 1]) < TABLE[1])
            found = np.minimum(found, np.where(on, far, np.inf))
            for x in (TABLE[0][0] + 0.03, TABLE[0][1] - 0.03):
                for y in (-TABLE[1] + 0.03, TABLE[1] - 0.03):
                    found = np.minimum(found, discs(rays, height, 0.03, 0.0, TABLE[2][0], x, y))
    if person is not None:
        found = np.minimum(found, discs(rays, height, *TRUNK, *person))
        for side in (-0.1, 0.1):
            found = np.minimum(found, discs(rays, height, LEG, 0.0, TRUNK[1], person[0], person[1] + side))
    return found


def nod(time: float) -> Array:
    """Pose (4, 4) of a laser that nods once in 4 s."""
    down = 1.05 - 1.45 * abs((time / 2.0) % 2.0 - 1.0)
    pose = on_floor(np.zeros(3))
    pose[2, 3] = NODDING
    c, s = math.cos(down), math.sin(down)
    pose[:3, :3] = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return pose


class Watch:
    """A costmap that is told of a world twenty times a second."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.costmap, self._rng, self.time = (
            Costmap(CostmapSettings(resolution=0.05, width=10.0, height=10.0)),
            rng,
            0.0,
        )

    def until(self, end: float, person: tuple[float, float] | None, table: bool) -> None:
        flat = np.column_stack((np.cos(ANGLES), np.sin(ANGLES), np.zeros_like(ANGLES)))
        while self.time < end:
            self.time += 1.0 / RATE
            ranges = [
                world(rays, height, person, table) for rays, height in ((flat, LEVEL), (self._leaning(flat), NODDING))
            ]
            noisy = [each + self._rng.normal(0.0, 0.005, len(each)) for each in ranges]
            level, leaning = (RangeScan(self.time, float(ANGLES[0]), 0.01, (0.1, 30.0), each) for each in noisy)
            self.costmap.observe(level, np.zeros(3))
            self.costmap.observe_nodding(leaning, nod(self.time))

    def _leaning(self, flat: Array) -> Array:
        return flat @ nod(self.time)[:3, :3].T

    def taken(self, x: float, y: float, radius: float) -> int:
        """Lethal cells about a place."""
        field = self.costmap.field(self.time)
        rows, columns = np.nonzero(field.cells == 254)
        places = np.column_stack((columns, rows)) * field.resolution + field.resolution / 2 + field.origin
        return int((np.hypot(*(places - [x, y]).T) < radius).sum())


@pytest.mark.parametrize("stood", [2.0, 6.0, 20.0])
def test_who_stood_there_for_long_is_gone_within_a_second_and_again_the_next_time(
    stood: float, rng: np.random.Generator
) -> None:
    watch = Watch(rng)
    watch.until(4.0, None, False)
    for _ in range(2):
        watch.until(watch.time + stood, (2.0, 0.0), False)
        assert watch.taken(2.0, 0.0, 0.35) > 10, "they stand there"
        watch.until(watch.time + 1.0, None, False)
        assert watch.taken(2.0, 0.0, 0.35) == 0, "a nod takes 4 s"


def test_a_table_stays_when_who_stood_at_it_goes(rng: np.random.Generator) -> None:
    watch = Watch(rng)
    watch.until(8.0, None, True)
    before = watch.taken(1.7, 0.0, 0.7)
    watch.until(16.0, (1.2, 0.0), True)
    watch.until(17.0, None, True)
    assert watch.taken(1.7, 0.0, 0.7) >= 0.9 * before
    assert watch.taken(1.1, 0.0, 0.2) == 0, "while nobody is there any more"


def test_a_table_stays_while_its_legs_are_seen(rng: np.random.Generator) -> None:
    watch = Watch(rng)
    watch.until(8.0, None, True)
    before = watch.taken(1.7, 0.0, 0.7)
    for _ in range(20):
        watch.until(watch.time + 1.0, None, True)
        assert watch.taken(1.7, 0.0, 0.7) >= 0.95 * before
