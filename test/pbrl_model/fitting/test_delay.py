"""Cameras are late: a delay of the poses after the wrenches is estimated, and does not move the wheel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.fitting.fit import FitOptions, ObjectFit, fit_recording
from pbrl_model.verdicts import note_on_delay

Maker = Callable[..., Recording]
DELAY = 0.08
WHEEL = np.array([-0.65, 0.3])
QUICK = {"draws": 125, "search_draws": 200, "holdout_share": 0.0}


def late(recording: Recording, delay: float) -> Recording:
    """The same recording with every camera's stamps late."""
    objects = {name: replace(stream, time=stream.time + delay) for name, stream in recording.object_poses.items()}
    hands = {name: replace(stream, time=stream.time + delay) for name, stream in recording.gripper_poses.items()}
    return replace(recording, object_poses=objects, gripper_poses=hands)


@pytest.fixture(scope="module")
def recording(make_recording: Maker) -> Recording:
    return make_recording(2, seconds=10.0, speed=0.25)


@pytest.fixture(scope="module")
def fits(recording: Recording) -> tuple[ObjectFit, ObjectFit]:
    on_time, delayed = (fit_recording(late(recording, delay), FitOptions(**QUICK)) for delay in (0.0, DELAY))
    return on_time.objects["table"], delayed.objects["table"]


def place(found: ObjectFit) -> tuple[np.ndarray, np.ndarray]:
    columns = np.stack([found.posterior.column(name).ravel() for name in ("wheel_x", "wheel_y")])
    return columns.mean(axis=1), columns.std(axis=1)


def test_the_delay_is_found(fits: tuple[ObjectFit, ObjectFit]) -> None:
    on_time, delayed = fits
    assert abs(on_time.delay.mean()) < 3.0 * on_time.delay.std()
    assert abs(delayed.delay.mean() - DELAY) < 3.0 * delayed.delay.std() < 0.09
    assert delayed.delay.mean() > on_time.delay.mean() + 0.04


def test_late_poses_do_not_move_the_wheel(fits: tuple[ObjectFit, ObjectFit]) -> None:
    (here, _), (there, spread) = (place(found) for found in fits)
    assert np.linalg.norm(there - WHEEL) < 0.015
    assert np.all(np.abs(there - WHEEL) < 4.0 * spread)
    assert np.linalg.norm(there - here) < 0.005


def test_wrenches_are_put_on_the_clock_of_the_poses(recording: Recording) -> None:
    (here,) = motions_of(recording, "table")
    (there,) = motions_of(late(recording, DELAY), "table", delay=DELAY)
    # The episode begins DELAY later in the push: the wrench that acted then is the one that is there.
    shift = round(DELAY / here.dt)
    np.testing.assert_allclose(there.wrench[50 + shift : -50], here.wrench[50 : -50 - shift], atol=0.6)
    assert there.delay == DELAY and here.delay == 0.0


def test_a_delay_is_said_where_it_is_sure() -> None:
    rng = np.random.default_rng(0)
    assert note_on_delay(0.08 + 0.05 * rng.normal(size=500)) == ()
    assert note_on_delay(0.005 + 0.001 * rng.normal(size=500)) == ()
    (after,), (before,) = (note_on_delay(mean + 0.01 * rng.normal(size=500)) for mean in (0.08, -0.08))
    assert "ms after the wrenches" in after and "ms before the wrenches" in before
