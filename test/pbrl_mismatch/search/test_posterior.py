"""Draws of a hypothesis's coordinates: Laplace's where that is right, the prior's where nothing is seen, calibrated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, alone, scene_of
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import NUISANCES, Objective
from pbrl_mismatch.search.posterior import KEPT, POPULATION, Density, evolved, with_draws

FLOOR = 0.15


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


@pytest.fixture(scope="module")
def free() -> Any:
    return baselines(BaselineOptions(20.0, 0.1, 0.1, 0.005), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]


def told(rng: np.random.Generator, track: Any, hypothesis: Any, coordinates: np.ndarray) -> Objective:
    """Return windows whose poses are drawn from the hypothesis."""
    cuts = cut_windows(track, 2.0)
    z = rng.standard_normal((1, len(cuts), NUISANCES))
    starts = cuts.told + np.einsum("wkl,pwl->pwk", cuts.root, z[..., :6])
    extra = z[..., None, 6:] * FLOOR * np.array([1.0, 1.0, cuts.track.gyration])
    noise = rng.standard_normal(cuts.pose.shape) / np.where(cuts.weight > 0.0, cuts.weight, 1.0)
    seen = poses(hypothesis.rows(coordinates), cuts, starts, extra)[0] + noise
    return Objective(hypothesis, replace(cuts, pose=seen), FLOOR)


def test_they_are_laplace_s_where_the_density_is_gaussian(track: Any, free: Any) -> None:
    rng = np.random.default_rng(0)
    peak = alone(climb(told(rng, track, free, free.mean[None]), free.mean[None], iterations=8))
    draws, deviation = evolved(rng, peak), np.sqrt(np.diag(peak.covariance(0)))
    assert len(draws) == POPULATION * KEPT
    assert np.all(np.abs(draws.mean(axis=0) - peak.coordinates[0]) < 0.3 * deviation)
    assert draws.std(axis=0) == pytest.approx(deviation, rel=0.25)


def test_the_density_is_what_the_climb_climbs(track: Any, free: Any) -> None:
    rng = np.random.default_rng(1)
    peak = alone(climb(told(rng, track, free, free.mean[None]), free.mean[None], iterations=8))
    density, precision = Density(peak), np.linalg.inv(peak.covariance(0))
    steps = 0.3 * rng.standard_normal((20, 3)) * np.sqrt(np.diag(peak.covariance(0)))
    lost = density(peak.coordinates) - density(peak.coordinates + steps)
    assert lost == pytest.approx(0.5 * np.einsum("nk,kl,nl->n", steps, precision, steps), rel=0.3, abs=0.02)


def test_where_nothing_is_seen_they_are_the_prior_s(track: Any, free: Any) -> None:
    scene = scene_of(track, free.rows(free.mean[None])[0])
    laden = free.with_effect(EFFECTS["payload_change"], scene, 0)
    at = laden.columns.index("payload_time")
    laden = replace(
        laden,
        parameters=tuple(
            replace(each, centre=-1e3, spread=10.0) if k == at else each for k, each in enumerate(laden.parameters)
        ),
    )
    rng = np.random.default_rng(2)
    peak = alone(climb(told(rng, track, laden, laden.mean[None]), laden.mean[None], iterations=6))
    drawn = evolved(rng, peak)[:, at]
    assert drawn.mean() == pytest.approx(-1e3, abs=4.0)
    assert drawn.std() == pytest.approx(10.0, rel=0.35)


def test_when_a_load_was_put_down_lies_where_they_say_as_often_as_they_say(track: Any, free: Any) -> None:
    scene = scene_of(track, free.rows(free.mean[None])[0])
    laden = free.with_effect(EFFECTS["payload_change"], scene, 0)
    mass, at = (laden.columns.index(name) for name in ("payload_mass", "payload_time"))
    within = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        truth = laden.mean.copy()
        truth[mass] = np.log(0.15 * 20.0)
        truth[at] += 0.3 * laden.spread[at] * rng.uniform(-1.0, 1.0)
        peak = alone(climb(told(rng, track, laden, truth[None]), truth[None], iterations=6))
        low, high = np.percentile(evolved(rng, peak)[:, at], [5.0, 95.0])
        within += bool(low < truth[at] < high)
    assert within >= 5


def test_they_come_to_both_ends_of_a_cord_s_ridge(track: Any, free: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A body that goes away from an anchor in one direction shows a pull, and hardly how long the cord is."""
    scene = scene_of(track, free.rows(free.mean[None])[0])
    tethered = free.with_effect(EFFECTS["tether"], scene, 0)
    x, y, length, *at = (tethered.columns.index(f"tether_{name}") for name in ("x", "y", "length", "at_x", "at_y"))
    first = track.seen[0, :2]
    furthest = track.seen[np.argmax(np.hypot(*(track.seen[:, :2] - first).T)), :2]
    truth, way = tethered.mean.copy(), (first - furthest) / np.hypot(*(first - furthest))
    truth[[x, y]], truth[length], truth[at] = furthest + 0.9 * way, np.log(0.8), track.body[1:3]
    peak = alone(climb(told(np.random.default_rng(3), track, tethered, truth[None]), truth[None], iterations=10))
    drawn = evolved(np.random.default_rng(4), peak)[:, length]
    monkeypatch.setattr("pbrl_mismatch.search.posterior.KEPT", 1500)
    endless = evolved(np.random.default_rng(5), peak)[:, length]
    assert drawn.std() == pytest.approx(endless.std(), rel=0.25)
    assert endless.std() > 2.5 * np.sqrt(peak.covariance(0)[length, length])  # a Gaussian at the top does not know


def test_their_deviations_are_the_density_s_where_that_is_wide_and_has_a_side_peak(
    track: Any, free: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In fifteen coordinates sixty generations do not cool by moves alone, nor do these lead out of a side peak."""
    scene = scene_of(track, free.rows(free.mean[None])[0])
    rolling = free.with_effect(EFFECTS["caster_swivel"], scene, 0).with_effect(EFFECTS["payload_change"], scene, 0)
    peak = alone(climb(told(np.random.default_rng(6), track, rolling, rolling.mean[None]), rolling.mean[None]))
    at, top, laplace = rolling.columns.index("payload_time"), peak.coordinates[0], peak.covariance(0)
    wide, narrow = 1.6, 0.05  # of a load that was put down while nothing moved, the top's own curvature says nothing
    whiten = np.linalg.cholesky(np.linalg.inv(laplace))

    def density(points: np.ndarray) -> np.ndarray:
        away = (points - top) @ whiten
        aside = (points[:, at] - top[at]) / np.sqrt(laplace[at, at])
        return -0.5 * np.sum((away / wide) ** 2, axis=1) + np.logaddexp(
            -0.5 * (aside / narrow) ** 2, -200.0 - 0.5 * ((aside - 1.0) / 0.3) ** 2
        )

    monkeypatch.setattr("pbrl_mismatch.search.posterior.Density", lambda _: density)
    monkeypatch.setattr(type(rolling), "believable", lambda self, points: points)
    drawn = evolved(np.random.default_rng(7), peak)
    assert len(top) > 12
    assert density(drawn).min() > -100.0
    assert -np.mean(density(drawn)) == pytest.approx(0.5 * len(top), rel=0.25)


def test_same_seed_same_bytes_in_any_number_of_threads(track: Any, free: Any) -> None:
    peak = alone(climb(told(np.random.default_rng(3), track, free, free.mean[None]), free.mean[None], iterations=4))
    assert np.array_equal(evolved(np.random.default_rng(4), peak), evolved(np.random.default_rng(4), peak, workers=3))


def test_a_hold_that_gives_way_keeps_its_gaussian(track: Any, free: Any) -> None:
    peak = alone(climb(told(np.random.default_rng(5), track, free, free.mean[None]), free.mean[None], iterations=2))
    fitted = Fitted(replace(free, effects=(GRASP_COMPLIANCE,)), peak, None)
    assert with_draws(np.random.default_rng(6), fitted) is fitted
    assert with_draws(np.random.default_rng(6), replace(fitted, hypothesis=free)).draws is not None
