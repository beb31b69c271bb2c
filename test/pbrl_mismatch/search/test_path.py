"""Hypotheses along the recorded path: what is linear is the simulation's own answer, and what is true is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import scene_of
from pbrl_mismatch.search.hypothesis import FURTHEST, BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.along import lay_along
from pbrl_mismatch.search.path.climb import climb_along
from pbrl_mismatch.search.path.ground import ground_of, traced, traced_score
from pbrl_mismatch.search.path.screen import screen

FLOOR, MASS = 0.15, 20.0


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("viscous_drag", 1), "table")


@pytest.fixture(scope="module")
def free() -> Any:
    return baselines(BaselineOptions(MASS, 0.1, 0.1, 0.005), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]


@pytest.fixture(scope="module")
def drag(track: Any, free: Any) -> Any:
    return free.with_effect(EFFECTS["viscous_drag"], scene_of(track, free.rows(free.mean[None])[0]), 0)


def test_a_body_without_laws_is_as_likely_along_its_path_as_simulated(
    concealed_recording: Callable[..., Recording], free: Any
) -> None:
    track = track_of(concealed_recording("clean", 1), "table")
    cuts = cut_windows(track, 1.0)
    simulated = climb(Objective(free, cuts, FLOOR), free.mean[None], iterations=8)
    along = lay_along(cuts, track.seen, MASS, FLOOR, 1)
    found = climb_along(along, free, free.mean[None], 8)
    np.testing.assert_allclose((found.coordinates[0] - simulated.coordinates[0]) / free.spread, 0.0, atol=0.3)
    # The steady wrench turns with the body in one and not in the other, and the path is smoothed.
    assert found.evidence[0] == pytest.approx(simulated.evidence[0], abs=0.01 * simulated.objective.observations)


def test_drag_along_a_path_is_the_speed_over_the_mass(track: Any, free: Any) -> None:
    along = lay_along(cut_windows(track, 1.0), track.seen, MASS, FLOOR, 4)
    rows = free.rows(np.repeat(free.mean[None], 2, 0))
    rows[1, COLUMN["drag_linear"]] = 10.0
    without, with_drag = along.accelerations(rows)
    where = np.concatenate([np.arange(b, e + 1, 4) for b, e in zip(track.begin, track.last, strict=True)])
    np.testing.assert_allclose((with_drag - without)[:, :2], -10.0 * track.seen[where, 3:5] / MASS, atol=1e-9)


def test_a_load_that_swings_slowly_is_left_behind_by_the_path(track: Any, free: Any) -> None:
    # On a soft spring a load goes on as it went: it is no part of the body, and pulls with its stiffness times the way.
    rows = free.rows(np.repeat(free.mean[None], 2, 0))
    rows[1, [COLUMN[name] for name in ("slosh_mass", "slosh_frequency", "slosh_damping")]] = 5.0, 0.02, 0.0
    for stride in (1, 4):
        along = lay_along(cut_windows(track, 1.0), track.seen, MASS, FLOOR, stride)
        without, swinging = along.accelerations(rows)
        start = round(2.0 / track.dt / stride)
        moved = track.seen[start * stride, :2] - track.seen[0, :2] - 2.0 * track.seen[0, 3:5]
        pull = -5.0 * (2.0 * np.pi * 0.02) ** 2 * moved
        found = swinging[start, :2] * (MASS - 5.0) - without[start, :2] * MASS
        np.testing.assert_allclose(found, pull, atol=0.15 * np.hypot(*pull))


def test_a_draw_near_the_truth_ranks_first_and_is_climbed_from(track: Any, free: Any, drag: Any) -> None:
    ground = ground_of(free, free.mean, cut_windows(track, 2.0), FLOOR)
    draws = np.repeat(drag.mean[None], 3, 0)
    for k, column in enumerate(drag.columns):
        if column in free.columns:
            draws[:, k] = ground.coordinates[free.columns.index(column)]
    ranked, misfit = screen(ground, drag, EFFECTS["viscous_drag"], draws)
    still = float(np.sum(ground.first.still**2))
    assert misfit.min() < 0.5 * still
    assert climb_along(ground.climbed, drag, ranked[:1], 6).evidence[0] > ground_evidence(ground) + 50.0


def ground_evidence(ground: Any) -> float:
    return float(climb_along(ground.climbed, ground.hypothesis, ground.coordinates[None], 2).evidence[0])


def test_held_out_windows_are_likelier_under_the_law_that_is_true(track: Any, free: Any, drag: Any) -> None:
    cuts = cut_windows(track, 2.0)
    kept = cuts.take(np.arange(len(cuts)) % 4 != 2)
    scores = [traced_score(traced(each, each.mean[None], cuts, FLOOR), kept, cuts, FLOOR) for each in (free, drag)]
    assert scores[1] > scores[0] + 10.0


def test_what_was_not_seen_says_nothing(track: Any, free: Any) -> None:
    cuts = cut_windows(track, 1.0)
    blind = cuts.weight.copy()
    blind[3] = 0.0
    one, other = (lay_along(each, track.seen, MASS, FLOOR, 4) for each in (cuts, replace(cuts, weight=blind)))
    rows = free.rows(free.mean[None])
    found = other.residual(rows)[0]
    assert not found[3].any() and np.array_equal(np.delete(found, 3, 0), np.delete(one.residual(rows)[0], 3, 0))


def test_no_climb_leaves_what_is_believed_of_an_effect_and_the_body_is_free_to(track: Any, free: Any) -> None:
    sensor = free.with_effect(EFFECTS["wrench_frame"], scene_of(track, free.rows(free.mean[None])[0]), 1)
    scale, mass = sensor.columns.index("force_scale"), sensor.columns.index("mass")
    far = sensor.mean.copy()
    far[[scale, mass]] += 8.0 * sensor.spread[[scale, mass]]
    kept = sensor.believable(far[None])[0]
    assert kept[scale] == pytest.approx(FURTHEST * sensor.spread[scale]) and kept[mass] == far[mass]
    along = lay_along(cut_windows(track, 1.0), track.seen, MASS, FLOOR, 4)
    found = climb_along(along, sensor, far[None], 6).coordinates[0]
    assert abs(found[scale]) <= FURTHEST * sensor.spread[scale] + 1e-12
