"""Displacement models: running moments against numpy, intervals that hold what they say, honest refusals."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from desk_cases import ERASER, SCALE

from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop import LearnedDisplacements, Push, PushStatistics, displaced, displacement, pushes_of


def test_running_moments_are_those_of_numpy(rng: np.random.Generator) -> None:
    values, each = rng.normal([0.05, 1e3, -2.0], [0.01, 1e-3, 0.3], (50, 3)), PushStatistics()
    for value in values:
        each.update(value)
    np.testing.assert_allclose(each.mean, values.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(each.variance, values.var(axis=0, ddof=1), rtol=1e-6)
    np.testing.assert_allclose(each.error, values.std(axis=0, ddof=1) / math.sqrt(50), rtol=1e-6)


@pytest.mark.parametrize("count", [3, 5, 20])
def test_intervals_hold_the_next_push_as_often_as_they_say(count: int, rng: np.random.Generator) -> None:
    inside = []
    for _ in range(1500):
        each = PushStatistics()
        for _ in range(count):
            each.update(rng.normal([0.05, 0.0, 0.3], [0.003, 0.002, 0.05]))
        low, high = each.interval(0.95)
        following = rng.normal([0.05, 0.0, 0.3], [0.003, 0.002, 0.05])
        inside.append((low <= following) & (following <= high))
    assert abs(np.mean(inside) - 0.95) < 0.015


def test_pushes_that_were_by_luck_alike_are_not_taken_for_certain(rng: np.random.Generator) -> None:
    inside = []
    for _ in range(300):
        model, truth = LearnedDisplacements(), {}
        for push in pushes_of((0.05, 0.015)):
            truth[push] = rng.normal([0.05, 0.0, 0.0], 0.01), 0.001 * rng.chisquare(3, 3)
            for _ in range(4):
                model.update("eraser", push, rng.normal(*truth[push]))
        push = min(truth, key=lambda each: model.of("eraser", each).variance.sum())
        low, high = model.interval("eraser", push)
        plain = model.of("eraser", push).interval()
        following = rng.normal(*truth[push])
        inside.append([(low <= following) & (following <= high), (plain[0] <= following) & (following <= plain[1])])
    moderated, plain_share = np.mean(inside, axis=(0, 2))
    assert moderated > 0.9
    assert plain_share < moderated, "the push that seems surest is where luck shows"


def test_displacements_are_in_the_items_frame(rng: np.random.Generator) -> None:
    for _ in range(50):
        pose, by = rng.uniform(-3, 3, 3), rng.uniform(-1, 1, 3)
        np.testing.assert_allclose(displacement(pose, displaced(pose, by)), by, atol=1e-12)
    quarter = np.array([1.0, 2.0, math.pi / 2])
    np.testing.assert_allclose(displaced(quarter, np.array([0.1, 0.0, 0.2])), [1.0, 2.1, math.pi / 2 + 0.2])


def test_primitives_are_laid_out_as_in_figure_4() -> None:
    radius, approach = 0.01, 0.02
    for push in pushes_of((0.05,)):
        begin, end = push.path(ERASER, radius, approach)
        contact = push.contact(ERASER)
        np.testing.assert_allclose(end - begin, (0.05 + approach) * push.direction, atol=1e-12)
        np.testing.assert_allclose(begin, contact - (radius + approach) * push.direction, atol=1e-12)
        # The force at the contact turns the item the way that the primitive's name says.
        moment = contact[0] * push.direction[1] - contact[1] * push.direction[0]
        assert np.sign(moment) == {"+turn": 1, "-turn": -1}.get(push.primitive, 0)
    assert abs(Push("+turn").contact(ERASER)[0]) == pytest.approx(0.45 * 0.13)


def test_too_few_pushes_are_refused_by_name() -> None:
    model, pushes = LearnedDisplacements(least=3), pushes_of((0.05,))
    for push in pushes:
        for _ in range(3 if push.primitive != "-y" else 2):
            model.update("scale", push, np.array([0.01, 0.0, 0.0]))
    with pytest.raises(PlannerError, match=r"model of 'scale': expected 3 pushes -y by 0.05 m, got 2"):
        model.displacements(SCALE, pushes)
    found = model.displacements(SCALE, [push for push in pushes if push.primitive != "-y"])
    assert (found.spread > 0.0).all(), "pushes that were by luck all alike are not believed to be certain"


def test_a_model_goes_to_a_file_and_back(rng: np.random.Generator) -> None:
    model, pushes = LearnedDisplacements(), pushes_of((0.05, 0.01))
    for _ in range(4):
        for push in pushes:
            model.update("eraser", push, rng.normal(size=3))
    model.update("scale", pushes[0], rng.normal(size=3))
    again = LearnedDisplacements.from_dict(json.loads(json.dumps(model.as_dict())))
    np.testing.assert_allclose(
        again.displacements(ERASER, pushes).spread, model.displacements(ERASER, pushes).spread, rtol=1e-12
    )
    for each in (model, again):
        each.update("eraser", pushes[0], np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(again.of("eraser", pushes[0]).variance, model.of("eraser", pushes[0]).variance)
    with pytest.raises(PlannerError, match="model of 'eraser'"):
        LearnedDisplacements.from_dict({"eraser": [{"primitive": "+x"}]})


@pytest.mark.parametrize("bad", [[0.0, math.nan, 0.0], [0.0, 0.0], [math.inf, 0.0, 0.0]])
def test_what_is_no_displacement_is_refused(bad: list[float]) -> None:
    with pytest.raises(PlannerError, match="expected a finite"):
        PushStatistics().update(np.array(bad))


def test_pushes_that_are_none_are_refused() -> None:
    with pytest.raises(PlannerError, match="expected one of"):
        Push("sideways")
    with pytest.raises(PlannerError, match="travel above zero"):
        Push("+x", 0.0)
    with pytest.raises(PlannerError, match="at least one travel"):
        pushes_of(())
