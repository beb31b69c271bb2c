"""From recording and posterior to the page's data: what must hold whatever was learned."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag import Recording, read_recording
from pbrl_bringup.clouds import ellipse
from pbrl_bringup.replay import AHEAD, Replay, replay
from pbrl_bringup.report_build import object_report, whole_report
from pbrl_bringup.report_data import ObjectReport
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.geometry import mass_properties
from pbrl_model.posterior import Posterior

NAMES = ("mass", "wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y")
MakeBag = Callable[..., Path]


@pytest.fixture
def recording(make_bag: MakeBag) -> Recording:
    return read_recording(make_bag())


def posterior(friction: float, spread: float = 0.0) -> Posterior:
    """Draws about the corner that the recorded table turns about; mass 30 kg is the scene's nominal one."""
    rng = np.random.default_rng(5)
    centre = np.array([30.0, -0.55, 0.32, 0.4, friction, friction])
    scale = spread * np.array([1.0, 0.02, 0.02, 0.1, 0.02, 0.02])
    return Posterior("table", "wheel", NAMES, centre + scale * rng.standard_normal((1, 300, 6)))


def replays_of(recording: Recording, learned: Posterior) -> list[Replay]:
    body = mass_properties(recording.bodies["table"].footprint)
    return replay(recording, motions_of(recording, "table"), learned, body, np.random.default_rng(0))


def report_of(recording: Recording, learned: Posterior) -> ObjectReport:
    rng = np.random.default_rng(1)
    return object_report(recording.bodies["table"], learned, replays_of(recording, learned), None, rng, [(-0.55, 0.32)])


def test_learning_nothing_predicts_what_was_believed_before(recording: Recording) -> None:
    for each in replays_of(recording, posterior(friction=0.0)):
        np.testing.assert_array_equal(each.after, np.broadcast_to(each.before, each.after.shape))


def test_a_push_is_predicted_as_a_whole_and_if_long_enough_in_pieces(recording: Recording) -> None:
    (whole,) = replays_of(recording, posterior(friction=0.5))
    assert whole.restart is None
    assert whole.time[-1] - whole.time[0] < 2 * AHEAD
    assert np.isfinite(whole.after).all()


def test_predictions_begin_where_the_body_was(recording: Recording) -> None:
    (whole,) = replays_of(recording, posterior(friction=0.5, spread=1.0))
    np.testing.assert_allclose(
        whole.after[:, 0], np.broadcast_to(whole.recorded[0], whole.after[:, 0].shape), atol=0.02
    )


def test_the_data_is_strict_json_of_bounded_size(recording: Recording) -> None:
    learned = report_of(recording, posterior(friction=0.5, spread=1.0))
    report = whole_report("title", recording, [learned], "./pbrl fit bag", 0, 1.0)
    text = report.model_dump_json()
    json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    assert len(text) < 2_000_000


def test_truth_is_compared_only_where_it_is_given(recording: Recording) -> None:
    learned = posterior(friction=0.5, spread=1.0)
    told = report_of(recording, learned)
    assert told.truth is not None
    assert told.truth.distance == pytest.approx(0.0, abs=0.01)
    untold = object_report(recording.bodies["table"], learned, [], None, np.random.default_rng(0))
    assert untold.truth is None


def test_the_same_seed_makes_the_same_report(recording: Recording) -> None:
    learned = posterior(friction=0.5, spread=1.0)
    assert report_of(recording, learned) == report_of(recording, learned)


def test_a_recording_in_which_nothing_was_held_has_a_page_too(recording: Recording) -> None:
    report = whole_report("title", recording, [], "./pbrl fit bag", None, 0.0)
    assert "Nothing was learned" in report.verdict


def test_the_ellipse_holds_95_percent_of_a_normal() -> None:
    points = np.random.default_rng(2).multivariate_normal([1.0, 2.0], [[4e-4, 1e-4], [1e-4, 1e-4]], 20_000)
    outline = ellipse(points)
    shape = np.linalg.inv(np.cov(points.T))
    inside = np.einsum("ni,ij,nj->n", points - points.mean(0), shape, points - points.mean(0))
    edge = np.einsum("ni,ij,nj->n", outline - points.mean(0), shape, outline - points.mean(0))
    np.testing.assert_allclose(edge, 5.991, rtol=1e-3)
    assert np.mean(inside < edge.min()) == pytest.approx(0.95, abs=0.01)
