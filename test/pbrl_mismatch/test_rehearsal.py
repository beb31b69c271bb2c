"""What is in motion besides the body when a window begins: one walk along the track finds what many would."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.kernels.motion_kernel import rehearse, rehearse_windows
from pbrl_mismatch.kernels.state import FIRST_CASTER, SLOSH, STATE, UNSEEN

DT = 0.01
SPAN = np.array([[k, 100, begin, last] for begin, last in ((0, 599), (600, 999)) for k in range(begin, last - 99, 75)])
LAWS = {
    "swing": {"slosh_mass": 4.0, "slosh_frequency": 0.8, "slosh_damping": 0.05, "slosh_y": 0.2},
    "casters": {"caster_roll": 0.02, "caster_trail": 0.04, "caster_heading": 0.3},
    "met": {"unseen_force": 10.0, "unseen_x": 0.85, "unseen_radius": 0.15},
    "all": {"slosh_mass": 4.0, "caster_scrub": 0.02, "unseen_force": 10.0, "unseen_x": 0.85},
}


@pytest.fixture(scope="module")
def walked(bench: Any) -> Any:
    """Return a function of a law: the states (W, STATE) of one walk, and those of a walk for each window."""
    time = DT * np.arange(1000)
    seen = np.stack([0.3 * np.sin(time), 0.1 * np.sin(1.7 * time), 0.2 * np.sin(0.9 * time)], -1)
    state = np.ascontiguousarray(np.column_stack([seen, np.gradient(seen, DT, axis=0)]))
    track = bench(np.zeros((1000, 3))).cuts().track

    def walk(**values: float) -> tuple[np.ndarray, np.ndarray]:
        row, com = neutral_row(), np.zeros(2)
        row[COLUMN["mass"]] = 20.0
        for name, value in values.items():
            row[COLUMN[name]] = value
        at_once, alone = np.zeros((2, len(SPAN), STATE))
        rehearse_windows(row, state, SPAN, track.body, track.outline, track.feet, com, at_once)
        for k, span in enumerate(SPAN):
            rehearse(row, state, span, track.body, track.outline, track.feet, com, alone[k])
        return at_once, alone

    return walk


@pytest.mark.parametrize("law", LAWS)
def test_one_walk_is_a_walk_for_each_window(walked: Any, law: str) -> None:
    at_once, alone = walked(**LAWS[law])
    np.testing.assert_array_equal(at_once, alone)
    assert np.ptp(at_once[:, FIRST_CASTER:], axis=0).max() > 0.01


@pytest.mark.parametrize(("law", "first", "speed"), [("casters", 16, 0.5), ("met", 300, 0.2)])
def test_what_follows_is_as_far_at_a_window_s_start_wherever_that_lies(
    bench: Any, law: str, first: int, speed: float
) -> None:
    """A table that goes steadily has a crate ahead by as much at every step, and casters that turn with each."""
    row, seen = neutral_row(), np.zeros((600, 6))
    row[COLUMN["mass"]] = 20.0
    for name, value in LAWS[law].items():
        row[COLUMN[name]] = value
    seen[:, 0], seen[:, 3] = speed * DT * np.arange(600), speed
    track = bench(np.zeros((600, 3))).cuts().track
    span = np.array([[k, 100, 0, 599] for k in range(first, first + 8)])
    found = np.zeros((len(span), STATE))
    rehearse_windows(row, seen, span, track.body, track.outline, track.feet, np.zeros(2), found)
    ahead = found[:, UNSEEN] - seen[span[:, 0], 0]
    heading = np.arctan2(found[:, FIRST_CASTER + 1], found[:, FIRST_CASTER])
    if law == "met":
        np.testing.assert_allclose(ahead, ahead[0], atol=2e-4)
    else:
        assert np.all(np.abs(np.diff(heading)) > 1e-3)


def test_a_load_is_at_rest_when_a_grasp_begins_and_swings_later(walked: Any) -> None:
    swing = np.abs(walked(**LAWS["swing"])[0][:, SLOSH : SLOSH + 4]).sum(axis=1)
    begins = SPAN[:, 0] == SPAN[:, 2]
    np.testing.assert_array_equal(swing[begins], 0.0)
    assert swing[~begins].min() > 0.0


def test_casters_and_a_body_that_was_met_stay_between_grasps(walked: Any) -> None:
    state = walked(**LAWS["all"])[0]
    first = np.flatnonzero(SPAN[:, 0] == 600)[0]
    assert state[first, UNSEEN] > 0.85
    assert np.abs(state[first, FIRST_CASTER]) > 0.0


def test_every_caster_begins_at_a_turn_of_its_own_and_one_that_is_told_none_as_the_first(walked: Any) -> None:
    turns = {"caster_turn2": 0.5, "caster_turn4": -1.1}
    begin = walked(**LAWS["casters"], **turns)[0][0, FIRST_CASTER:SLOSH].reshape(-1, 2)
    heading = np.arctan2(begin[:, 1], begin[:, 0])
    wanted = 0.3 + np.array([0.0, 0.5, 0.0, -1.1, *np.zeros(len(heading) - 4)])  # the body begins at a heading of zero
    np.testing.assert_allclose(heading, wanted, atol=1e-9)


def test_what_does_not_move_is_not_rehearsed(walked: Any) -> None:
    np.testing.assert_array_equal(walked(slide_mu=0.1)[0], 0.0)
