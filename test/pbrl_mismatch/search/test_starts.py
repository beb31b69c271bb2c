"""Where a hypothesis begins: an edge in time that few draws meet is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import DiagnoseOptions, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.effects.effect import Scene
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.search.fitted import cut_stages, fit_from
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.path.climb import climb_along
from pbrl_mismatch.search.path.ground import ground_of
from pbrl_mismatch.search.path.starts import ELSEWHERE, ELSEWHERE_ON_IT, each_first, going_on, starts_of

OPTIONS = DiagnoseOptions()
BIAS = np.array([0.4, 3.0, 0.2])
"""Of the sensor, in its own axes [N, N, N m]."""
ONSET = 1
SCENE = Scene(np.zeros(2), np.ones(2), np.zeros(2), np.zeros(2), np.array([0.6, 0.35]), 20.0, 10.0, 0.1, 0.0, 30.0)


@pytest.fixture(scope="module")
def clean(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


def biased(clean: Any, since: float) -> Any:
    """Return a track whose wrench has an offset from some moment on."""
    return replace(clean, felt=clean.felt + BIAS * (clean.clock >= since)[:, None])


@pytest.mark.parametrize("share", [0.23, 0.71])
def test_the_moment_that_a_sensor_s_offset_comes_is_found(clean: Any, share: float) -> None:
    since = float(clean.clock[0] + share * (clean.clock[-1] - clean.clock[0]))
    track = biased(clean, since)
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    base = fit_from(free, cut_stages(track, OPTIONS), free.mean[None], OPTIONS)
    ground = ground_of(free, base.peak.coordinates[0], cut_windows(track, 2.0), OPTIONS.sensor_floor)
    found = starts_of(np.random.default_rng(0), "wrench_bias", ONSET, base, ground, OPTIONS)
    best = found.coordinates[int(np.argmax(found.evidence))]
    told = dict(zip(found.hypothesis.columns, best, strict=True))
    assert told["bias_start"] == pytest.approx(since, abs=0.25)
    assert [told["bias_x"], told["bias_y"]] == pytest.approx(BIAS[:2].tolist(), abs=0.4)
    assert found.noise_scale < 1.1


@pytest.mark.parametrize(
    ("name", "variant", "seed"), [("payload_change", 0, 3), ("payload_change", 1, 1), ("external_force", 1, 3)]
)
def test_at_no_other_moment_is_it_likelier(
    concealed_recording: Callable[..., Recording], name: str, variant: int, seed: int
) -> None:
    """Not felt while nothing changes, a load has many tops over its moment, and few draws meet the highest."""
    track = track_of(concealed_recording(name, seed), "table")
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    base = fit_from(free, cut_stages(track, OPTIONS), free.mean[None], OPTIONS)
    ground = ground_of(free, base.peak.coordinates[0], cut_windows(track, 2.0), OPTIONS.sensor_floor)
    for draws in range(3):
        found = starts_of(np.random.default_rng(draws), name, variant, base, ground, OPTIONS)
        columns, best = found.hypothesis.columns, found.coordinates[:1]
        for moment in EFFECTS[name].moments:
            others = best.repeat(40, axis=0)
            others[:, columns.index(moment)] = np.linspace(*track.clock[[0, -1]], 40)
            elsewhen = climb_along(ground.climbed, found.hypothesis, others, 8)
            assert elsewhen.evidence.max() < found.evidence[0] + 1.0


@pytest.mark.parametrize(("name", "variant", "beside"), [("detent", 1, 1), ("floor_patch", 0, 1), ("tether", 0, 0)])
def test_starts_are_the_likeliest_first_and_of_those_sought_elsewhere_one_more(
    clean: Any, name: str, variant: int, beside: int
) -> None:
    options = DiagnoseOptions(draws=40)
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    base = fit_from(free, cut_stages(clean, options), free.mean[None], options)
    ground = ground_of(free, base.peak.coordinates[0], cut_windows(clean, 2.0), options.sensor_floor)
    found = starts_of(np.random.default_rng(2), name, variant, base, ground, options)
    assert np.all(np.diff(found.evidence) <= 0.0)
    assert len(found.coordinates) == len(found.misfit) == len(found.matrix) == options.keep[0] + beside


def test_each_group_s_likeliest_come_first_and_all_others_after() -> None:
    rng = np.random.default_rng(3)
    for counts in ([3, 4], [5], [2, 1, 6]):
        evidence = rng.normal(size=sum(counts))
        order = each_first(evidence, counts)
        assert sorted(order) == list(range(len(evidence)))
        edges = np.cumsum([0, *counts])
        leads = {int(a + np.argmax(evidence[a:b])) for a, b in pairwise(edges)}
        assert set(order[: len(counts)].tolist()) == leads
        for part in (order[: len(counts)], order[len(counts) :]):
            assert np.all(np.diff(evidence[part]) <= 0.0)


def test_borders_go_on_from_the_likeliest_and_from_another_place() -> None:
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    effect, rng = EFFECTS["floor_patch"], np.random.default_rng(5)
    hypothesis = free.with_effect(effect, SCENE, 0)
    x, y = (hypothesis.columns.index(column) for column in ("patch_x", "patch_y"))
    draws = hypothesis.sample_prior(rng, 60)
    draws[:, [x, y]] = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 3.0]]).repeat(20, axis=0)
    draws[:, [x, y]] += rng.uniform(-0.1, 0.1, (60, 2))
    assert going_on(draws, hypothesis, effect, 2).tolist() == [0, 1, 20]
    assert going_on(draws[:20], hypothesis, effect, 2).tolist() == [0, 1], "there is no other place"
    mixed = draws[rng.permutation(60)]
    *likeliest, elsewhere = mixed[going_on(mixed, hypothesis, effect, 1)][:, [x, y]]
    assert min(np.hypot(*(each - elsewhere)) for each in likeliest) > ELSEWHERE[0]
    bias = EFFECTS["wrench_bias"]
    laid = free.with_effect(bias, SCENE, ONSET)
    same = laid.sample_prior(rng, 4).repeat(2, axis=0)
    assert going_on(same, laid, bias, 3).tolist() == [0, 2, 4], "what has no borders is told by all its columns"


def test_a_catch_goes_on_from_other_points_of_the_body_where_those_are_sought() -> None:
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    detent, rng = EFFECTS["detent"], np.random.default_rng(6)
    somewhere, anywhere = (free.with_effect(detent, SCENE, variant) for variant in (0, 1))
    apart, most = ELSEWHERE_ON_IT
    draws = anywhere.sample_prior(rng, 400)
    chosen = going_on(draws, anywhere, detent, 2)
    assert chosen[:2].tolist() == [0, 1] and len(chosen) == 2 + most
    at = draws[:, [anywhere.columns.index(column) for column in ("detent_at_x", "detent_at_y")]][chosen]
    away = np.linalg.norm(at[:, None] - at, axis=2)
    assert all(away[k, :k].min() > apart for k in range(2, len(chosen)))
    assert going_on(somewhere.sample_prior(rng, 400), somewhere, detent, 2).tolist() == [0, 1]
