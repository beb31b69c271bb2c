"""Floor tiles that hold feet: friction that is laid into a rectangle is found there, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from concealed_cases import concealed, on_the_way
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_mismatch import DiagnoseOptions, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.search.fitted import cut_stages, fit_baseline
from pbrl_mismatch.search.hypothesis import OF_FRICTION, BaselineOptions, baselines
from pbrl_mismatch.search.path.ground import ground_of
from pbrl_mismatch.search.path.regions import SLIDES, tile_friction, with_regions

WEIGHT = 196.0
FRICTION = 0.06
NOISE = np.diag([0.2, 0.2, 0.1]) ** 2


@pytest.fixture(scope="module")
def clean(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


@pytest.fixture(scope="module")
def lacking(clean: Any) -> ResidualWrench:
    """Return what a model of the clean table lacks, its wrench replaced by none at all."""
    row = neutral_row()
    row[COLUMN["mass"]] = WEIGHT / 9.81
    found = residual_wrench(clean, row, size=1.0)
    return replace(found, world=np.zeros_like(found.world), covariance=np.tile(NOISE, (len(found.time), 1, 1)))


def held(
    track: Any, lacking: ResidualWrench, inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]]
) -> ResidualWrench:
    """Return a residual wrench that is the friction of feet inside a region of the floor."""
    world = np.zeros_like(lacking.world)
    for foot in track.feet - track.body[1:3]:
        c, s = np.cos(lacking.state[:, 2]), np.sin(lacking.state[:, 2])
        arm = np.stack([c * foot[0] - s * foot[1], s * foot[0] + c * foot[1]], -1)
        velocity = lacking.state[:, 3:5] + lacking.state[:, 5:6] * np.stack([-arm[:, 1], arm[:, 0]], -1)
        speed = np.hypot(*velocity.T)
        holds = inside(lacking.state[:, :2] + arm) & (speed > SLIDES)
        force = -FRICTION * WEIGHT / len(track.feet) * velocity / np.maximum(speed, SLIDES)[:, None] * holds[:, None]
        world[:, :2] += force
        world[:, 2] += arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]
    return replace(lacking, world=world)


def test_friction_is_found_on_the_tiles_that_have_it(clean: Any, lacking: ResidualWrench) -> None:
    edge = float(np.median(lacking.state[:, 0]))
    tiles, friction = tile_friction(
        clean, held(clean, lacking, lambda place: place[:, 0] > edge), WEIGHT, neutral_row()
    )
    beyond, before = tiles[:, 0] > edge + 0.1, tiles[:, 0] < edge - 0.1
    assert beyond.any() and before.any()
    assert np.median(friction[beyond]) == pytest.approx(FRICTION, rel=0.15)
    assert np.median(friction[before]) < 0.1 * FRICTION


def test_nothing_lacking_is_no_friction(clean: Any, lacking: ResidualWrench) -> None:
    _, friction = tile_friction(clean, lacking, WEIGHT, neutral_row())
    assert np.all(friction == 0.0)
    draws = np.zeros((20, 5))
    still = with_regions(np.random.default_rng(0), draws, (0, 1, 2, 3, 4), np.zeros((3, 2)), np.zeros(3))
    np.testing.assert_array_equal(still, draws)


def test_rectangles_lie_about_the_tiles_that_hold() -> None:
    rng, turn = np.random.default_rng(1), 0.4
    c, s = math.cos(turn), math.sin(turn)
    grid = np.stack(np.meshgrid(np.arange(-1.5, 1.5, 0.1), np.arange(-1.5, 1.5, 0.1)), -1).reshape(-1, 2) + 0.05
    own = (grid - [0.5, -0.3]) @ np.array([[c, -s], [s, c]])
    friction = np.where((np.abs(own[:, 0]) < 0.7) & (np.abs(own[:, 1]) < 0.3), 0.05, 0.001)
    draws = np.full((400, 6), 9.0)
    placed = with_regions(rng, draws, (0, 1, 2, 3, 4), grid, friction)
    moved = placed[placed[:, 0] != 9.0]
    assert 0.6 < len(moved) / len(draws) < 0.8
    np.testing.assert_array_equal(placed[:, 5], 9.0)
    middle = np.median(moved, axis=0)
    assert middle[:2] == pytest.approx([0.5, -0.3], abs=0.05)
    assert np.exp(middle[2:4]) == pytest.approx([0.75, 0.35], abs=0.1)
    assert middle[4] == pytest.approx(turn, abs=0.1)


@pytest.mark.parametrize("heavier", [1.0, 8.0])
def test_a_ground_that_a_patch_has_bent_still_says_where_the_patch_is(
    concealed_recording: Callable[..., Recording], heavier: float
) -> None:
    seed, options = 8, DiagnoseOptions()
    patch = on_the_way("floor_patch", concealed("floor_patch", np.random.default_rng([seed, 7])), seed)
    track = track_of(concealed_recording("floor_patch", seed), "table")
    believed = BaselineOptions(WEIGHT / 9.81, 0.1, 0.1, 0.02)
    wheel = baselines(believed, ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    base = fit_baseline(np.random.default_rng(0), track, wheel, cut_stages(track, options), options)
    ground = ground_of(wheel, base.peak.coordinates[0], cut_windows(track, 2.0), options.sensor_floor)
    # What holds a body is easily taken for its weight; a wheel's friction then is as much less of that.
    bent = ground.coordinates + np.log(heavier) * (
        np.array([column == "mass" for column in wheel.columns], dtype=float) - np.isin(wheel.columns, OF_FRICTION)
    )
    tiles, friction = tile_friction(
        track, replace(ground, found=replace(ground.found, coordinates=bent)).believed, WEIGHT, ground.row
    )
    x, y, turn = track.seen[0, :3]
    c, s = math.cos(turn), math.sin(turn)
    own = (tiles - [x, y]) @ np.array([[c, -s], [s, c]])
    inside = np.all(np.abs(own - [patch["x"], patch["y"]]) < patch["half"] + 0.1, axis=1)
    assert inside.any()
    assert not inside.all()
    assert friction[inside].mean() > 3.0 * friction[~inside].mean()
