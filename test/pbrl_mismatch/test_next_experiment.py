"""The next push: its information is bounded, invariant and worth the name; the simulated hand obeys mechanics."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from shapely import Polygon, contains_xy, distance
from shapely import points as shapely_points

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, MismatchError, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.next_experiment.candidates import Candidates, Reach, candidates_of, outline_points
from pbrl_mismatch.next_experiment.experiment import (
    LOOKED_INTO,
    SEGMENTS,
    expected_bits,
    hand_of,
    next_experiment,
    random_experiment,
    survivors,
)
from pbrl_mismatch.next_experiment.hand_kernel import CHANNELS, push_all
from pbrl_mismatch.next_experiment.information import information_bounds
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, scene_of
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.weigh import Weighed

ROOM = np.array([[-3.0, -3.0], [4.0, -3.0], [4.0, 4.0], [-3.0, 4.0]])


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1, seconds=6.0), "table")


@pytest.fixture(scope="module")
def hypotheses(track: Any) -> tuple[Weighed, ...]:
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.005), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    scene, cuts = scene_of(track, free.rows(free.mean[None])[0]), cut_windows(track, 2.0)
    kinds = [
        free,
        free.with_effect(EFFECTS["viscous_drag"], scene, 1),
        free.with_effect(EFFECTS["ground_friction"], scene, 0),
    ]
    fits = [Fitted(each, climb(Objective(each, cuts, 0.15), each.mean[None], iterations=4), None) for each in kinds]
    return tuple(Weighed(fit.hypothesis.effects, fit, 0.0, 1.0 / 3.0, False) for fit in fits)


def test_bits_lie_between_zero_and_the_entropy(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    reach = Reach(most=20)
    pushes = candidates_of(np.random.default_rng(0), track, reach)
    low, high = expected_bits(np.random.default_rng(1), track, hypotheses, pushes, reach)
    assert len(pushes) == 20 and np.all(low >= 0.0) and np.all(low <= high + 1e-9)
    assert np.all(high <= math.log2(3) + 1e-9) and low.max() > 0.1


def test_identical_hypotheses_give_no_bits(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    same = tuple(replace(hypotheses[1], probability=0.5) for _ in range(2))
    reach = Reach(most=10)
    pushes = candidates_of(np.random.default_rng(0), track, reach)
    low, high = expected_bits(np.random.default_rng(1), track, same, pushes, reach)
    np.testing.assert_allclose(low, 0.0, atol=1e-9)
    np.testing.assert_allclose(high, 0.0, atol=1e-9)


def turned(track: Any, angle: float) -> Any:
    """Return the same recording in a room that is turned and shifted."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    seen, mount, pivot = track.seen.copy(), track.mount.copy(), track.pivot.copy()
    seen[:, :2], seen[:, 2], seen[:, 3:5] = (
        seen[:, :2] @ turn.T + [3.0, -2.0],
        seen[:, 2] + angle,
        seen[:, 3:5] @ turn.T,
    )
    mount[:, :2], mount[:, 2:4] = mount[:, :2] @ turn.T, mount[:, 2:4] @ turn.T
    pivot[:, :2], pivot[:, 2] = pivot[:, :2] @ turn.T + [3.0, -2.0], pivot[:, 2] + angle
    return replace(track, seen=seen, mount=mount, pivot=pivot)


def test_bits_do_not_depend_on_how_the_world_is_turned(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    reach = Reach(most=1000, contacts=3, directions=4, durations=(2.0,))
    # Dry friction is solved for by sweeps that end at a tolerance in each axis; without it nothing knows the axes.
    smooth = tuple(replace(each, probability=0.5) for each in hypotheses[:2])
    for left, within in ((smooth, 1e-4), (hypotheses, 0.02)):
        told = []
        for each in (track, turned(track, 0.7)):
            pushes = candidates_of(np.random.default_rng(0), each, reach)
            told.append(expected_bits(np.random.default_rng(1), each, left, pushes, reach)[0])
        np.testing.assert_allclose(told[0], told[1], atol=within)


def test_the_information_lies_between_the_bounds_for_gaussians_of_one_number() -> None:
    rng, probability = np.random.default_rng(0), np.array([0.3, 0.7])
    for apart, wide in ((0.5, 1.0), (2.0, 1.0), (1.0, 3.0), (6.0, 0.5)):
        mean = np.array([0.0, apart]).reshape(2, 1, 1)
        covariance = np.array([1.0, wide**2]).reshape(2, 1, 1, 1)
        low, high = information_bounds(probability, mean, covariance)
        which = (rng.random(200_000) < 0.7).astype(int)
        y = np.where(which == 1, apart + wide * rng.standard_normal(len(which)), rng.standard_normal(len(which)))
        density = np.stack([np.exp(-0.5 * y**2), np.exp(-0.5 * ((y - apart) / wide) ** 2) / wide])
        mixed = probability @ density
        truth = np.mean(np.log2(density[which, np.arange(len(y))] / mixed))
        assert low[0] - 0.01 < truth < high[0] + 0.01, (low, truth, high)


def test_a_wide_hypothesis_is_not_told_from_what_half_of_it_says() -> None:
    # Half of the draws say just what the other hypothesis says: a Gaussian of all of them would not know.
    draws = np.zeros((2, 40, 1, 1))
    draws[1, :20] = 100.0 * np.arange(1.0, 21.0)[:, None, None]
    mean = draws.mean(axis=1)
    noise = np.ones((1, 1, 1))
    spread = np.var(draws, axis=1)[..., None]
    half = np.array([0.5, 0.5])
    by_gaussians, _ = information_bounds(half, mean, spread + noise)
    by_draws, _ = information_bounds(half, np.zeros((2, 1, 1)), np.ones((2, 1, 1, 1)), draws, noise)
    assert by_gaussians[0] > 0.8 and by_draws[0] < 0.5


def one_push(speed: float, duration: float) -> Candidates:
    return Candidates(
        np.array([[-0.6, 0.0]]), np.array([[1.0, 0.0]]), np.array([[1.0, 0.0]]), np.array([speed]), np.array([duration])
    )


def pushed(
    track: Any, row: np.ndarray, push: Candidates, hand: np.ndarray, segments: int = SEGMENTS, began: float = 0.0
) -> np.ndarray:
    """Return (segments, CHANNELS) of one push straight ahead of a body that faces along x."""
    last = len(track.clock) - 1
    out = np.empty((1, 1, segments, CHANNELS))
    push_all(
        row[None], push.contact, push.normal, push.direction, push.speed, push.duration, np.zeros(6), began, track.seen,
        np.array([last, 0, 0, last]), np.zeros(3), track.body, track.outline, track.feet, hand, out,
    )  # fmt: skip
    return out[0, 0]


def table_row(**values: float) -> np.ndarray:
    row = neutral_row()
    row[COLUMN["mass"]] = 20.0
    for name, value in values.items():
        row[COLUMN[name]] = value
    return row


def test_the_hand_s_impulse_is_what_drag_takes(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    hand = hand_of(hypotheses[0], track, Reach())
    # Long enough to come to rest behind the hand: what was put in went into the drag, c times the way.
    push = one_push(0.1, 6.0)
    fine = pushed(track, table_row(drag_linear=30.0), push, hand, 200)
    way = fine[-1, 0] - fine[0, 0]
    assert way == pytest.approx(0.1 * (6.0 - 0.3), rel=0.05)
    assert fine[:, 3].mean() * 6.0 == pytest.approx(30.0 * way, rel=0.05)
    np.testing.assert_allclose(fine[:, [1, 2, 4]], 0.0, atol=1e-9)


def test_a_sensor_s_bias_is_felt_and_moves_nothing(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    hand, push = hand_of(hypotheses[0], track, Reach()), one_push(0.1, 2.0)
    plain, biased = (pushed(track, table_row(**values), push, hand) for values in ({}, {"bias_x": 1.0, "bias_y": 0.5}))
    np.testing.assert_allclose(biased - plain, np.tile([0, 0, 0, 1.0, 0.5, 0.0], (SEGMENTS, 1)), atol=1e-9)


@pytest.mark.parametrize("began", [5.0, 1.7e9])
def test_a_sensor_s_fault_is_what_it_is_since_it_was_read_at_rest(
    track: Any, hypotheses: tuple[Weighed, ...], began: float
) -> None:
    hand, push = hand_of(hypotheses[0], track, Reach()), one_push(0.1, 2.0)

    def added(**fault: float) -> np.ndarray:
        plain, wrong = (pushed(track, table_row(**each), push, hand, began=began) for each in ({}, fault))
        return (wrong - plain)[:, 3]

    middles = (np.arange(SEGMENTS) + 0.5) * 2.0 / SEGMENTS
    np.testing.assert_allclose(added(drift_x=0.3), 0.3 * middles, atol=0.3 * track.dt)
    # An offset that came on before the hand let go is known; one that comes on half-way through the push is not.
    np.testing.assert_allclose(added(bias_x=2.0, bias_start=began - 3.0), 0.0, atol=1e-9)
    on = added(bias_x=2.0, bias_start=began + 1.0)
    np.testing.assert_allclose([*on[:2], *on[-2:]], [0.0, 0.0, 2.0, 2.0], atol=1e-9)


def test_an_open_hand_never_pulls(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    hand, push = hand_of(hypotheses[0], track, Reach(gripped=False)), one_push(0.1, 3.0)
    fine = pushed(track, table_row(), push, hand, 300)
    assert fine[:, 3].min() >= 0.0 and fine[:, 3].max() > 1.0 and np.abs(fine[:, 5]).max() == 0.0
    assert np.all(np.abs(fine[:, 4]) <= 0.4 * fine[:, 3] + 1e-9)


def test_candidates_keep_the_body_in_the_room_and_an_open_hand_in_its_cone(track: Any) -> None:
    room = track.seen[-1, :2] + np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    reach = Reach(room=room, most=10_000)
    every = candidates_of(np.random.default_rng(0), track, replace(reach, room=None))
    kept = candidates_of(np.random.default_rng(0), track, reach)
    assert 0 < len(kept) < len(every)
    way = kept.direction * (kept.speed * kept.duration)[:, None]
    yaw = track.seen[-1, 2]
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    corners = track.outline @ turn.T + track.seen[-1, :2]
    left = room[0] + reach.margin - 1e-9, room[2] - reach.margin + 1e-9
    assert np.all((corners[None] + way[:, None] >= left[0]) & (corners[None] + way[:, None] <= left[1]))
    cone = candidates_of(np.random.default_rng(0), track, Reach(gripped=False, most=10_000))
    assert np.all(np.sum(cone.direction * (cone.normal @ turn.T), 1) >= math.cos(math.atan(0.4)))
    tight = 0.1 * ROOM
    assert len(candidates_of(np.random.default_rng(0), track, Reach(room=tight))) == 0


def test_no_push_goes_over_a_wall_that_reaches_into_the_room(track: Any) -> None:
    """A partition ends within the footprint's way, none of whose corners comes near it."""
    x, y = track.seen[-1, :2]
    size = float(np.ptp(track.outline, axis=0).max())
    room = np.array([x, y]) + size * np.array(
        [[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [0.02, 3.0], [0.02, 0.1], [-0.02, 0.1], [-0.02, 3.0], [-3.0, 3.0]]
    )
    assert len(candidates_of(np.random.default_rng(0), track, Reach(room=room))) == 0
    room[4:6, 1] = y + 2.5 * size
    assert len(candidates_of(np.random.default_rng(0), track, Reach(room=room))) > 0


def test_points_lie_on_the_outline_and_normals_point_inwards() -> None:
    outline = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    points, normals = outline_points(outline, 8)
    np.testing.assert_allclose(distance(Polygon(outline).exterior, shapely_points(points)), 0.0, atol=1e-12)
    assert np.all(contains_xy(Polygon(outline), points + 0.01 * normals))
    np.testing.assert_allclose(np.hypot(*normals.T), 1.0)


def test_the_choice_is_the_best_candidate_and_better_than_chance(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    best = next_experiment(np.random.default_rng(0), track, hypotheses)
    again = next_experiment(np.random.default_rng(0), track, hypotheses)
    assert best is not None and best == again
    others = [random_experiment(np.random.default_rng(seed), track, hypotheses) for seed in range(6)]
    assert np.mean([each.expected_bits for each in others if each]) < best.expected_bits
    report = json.loads(json.dumps(best.to_report(), allow_nan=False))
    assert set(report) == {"object", "contact_point", "direction", "speed", "duration", "expected_bits"}
    assert "viscous_drag" in best.sentence()


def test_what_a_glance_leaves_is_as_good_as_the_best_of_all(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    pushes = candidates_of(np.random.default_rng(0), track, Reach())
    low, _ = expected_bits(np.random.default_rng(1), track, hypotheses, pushes, Reach())
    best = next_experiment(np.random.default_rng(0), track, hypotheses)
    assert len(pushes) > LOOKED_INTO and best is not None
    assert best.expected_bits == pytest.approx(low.max(), rel=0.05)


def test_one_hypothesis_or_no_reach_needs_no_push(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    sure = (replace(hypotheses[0], probability=0.999), replace(hypotheses[1], probability=0.001))
    assert next_experiment(np.random.default_rng(0), track, sure) is None
    assert next_experiment(np.random.default_rng(0), track, hypotheses, Reach(room=0.1 * ROOM)) is None
    assert sum(each.probability for each in survivors(hypotheses[:2])) == pytest.approx(1.0)


def test_bad_input_is_refused(track: Any, hypotheses: tuple[Weighed, ...]) -> None:
    for bad in (
        {"speeds": (0.0,)},
        {"durations": ()},
        {"contacts": 0},
        {"room": np.zeros((2, 2))},
        {"stiffness": -1.0},
    ):
        with pytest.raises(MismatchError, match="reach"):
            Reach(**bad)
    pushes = candidates_of(np.random.default_rng(0), track, Reach(most=2))
    with pytest.raises(MismatchError, match="sum to one"):
        expected_bits(np.random.default_rng(0), track, hypotheses[:2], pushes, Reach())
