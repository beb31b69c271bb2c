"""Coordinates in which a cord's ridge is straight, and draws along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, track_of
from pbrl_mismatch.search.cords import Cord, bent, cords_of, log_volume, straightened
from pbrl_mismatch.search.fitted import scene_of
from pbrl_mismatch.search.hypothesis import BaselineOptions, Hypothesis, baselines

CORD = Cord(0, 1, 2, np.array([0.4, -0.3]), 2.9)


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


@pytest.fixture(scope="module")
def tethered(track: Any) -> Hypothesis:
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.005), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    return free.with_effect(EFFECTS["tether"], scene_of(track, free.rows(free.mean[None])[0]), 0)


def points(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return coordinates of anchors all around the cord's end, and of lengths."""
    return np.column_stack([rng.uniform(-2.0, 2.0, (count, 2)), rng.uniform(-1.5, 0.5, count)])


def test_there_and_back_is_where_it_was() -> None:
    begun = points(np.random.default_rng(0), 200)
    np.testing.assert_allclose(bent([CORD], straightened([CORD], begun)), begun, atol=1e-12)


def test_what_a_taut_cord_shows_is_straight() -> None:
    lengths = np.linspace(-1.0, 0.5, 20)
    way = np.array([np.cos(2.0), np.sin(2.0)])
    ridge = np.column_stack([CORD.end + (np.exp(lengths) + 0.1)[:, None] * way, lengths])
    straight = straightened([CORD], ridge)
    np.testing.assert_allclose(straight[:, 0], 0.1, atol=1e-12)
    np.testing.assert_allclose(straight[:, 1], 2.0 - CORD.bearing, atol=1e-12)


def test_the_volume_is_that_of_the_way_back() -> None:
    step = 1e-6
    for straight in straightened([CORD], points(np.random.default_rng(1), 20)):
        moved = bent([CORD], straight + step * np.eye(3)) - bent([CORD], straight - step * np.eye(3))
        slope = np.abs(np.linalg.det(moved / (2.0 * step)))
        assert log_volume([CORD], straight[None])[0] == pytest.approx(np.log(slope), abs=1e-6)


def test_an_anchor_on_the_wrong_side_of_its_end_has_no_volume() -> None:
    assert log_volume([CORD], np.array([[-1.0, 0.0, np.log(0.5)]]))[0] == -np.inf


def test_it_is_about_where_the_cord_was_taut(track: Any, tethered: Hypothesis) -> None:
    coordinates = tethered.mean.copy()
    place = {name: tethered.columns.index(f"tether_{name}") for name in ("x", "y", "length", "at_x", "at_y")}
    middle = track.seen[:, :2].mean(axis=0)
    coordinates[[place["x"], place["y"]]] = [middle[0] + 3.0, middle[1]]
    coordinates[[place["at_x"], place["at_y"]]] = track.body[1:3]
    coordinates[place["length"]] = np.log(3.0)
    (cord,) = cords_of(tethered, coordinates, track)
    # Longer than half of the distances is taut where the body is on the far side.
    far = np.hypot(*(track.seen[:, :2] - middle - [3.0, 0.0]).T) > 3.0
    np.testing.assert_allclose(cord.end, track.seen[far, :2].mean(axis=0), atol=1e-9)
    assert (cord.x, cord.y, cord.length) == (place["x"], place["y"], place["length"])
    slack = replace(tethered, parameters=tuple(p for p in tethered.parameters if p.column != "tether_length"))
    assert cords_of(slack, np.delete(coordinates, place["length"]), track) == ()
