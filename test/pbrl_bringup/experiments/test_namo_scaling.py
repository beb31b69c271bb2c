"""The scaling experiment: exponents of known laws come out, rooms have an answer, what is drawn is the plan."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bringup.commands.experiment import EXPERIMENTS
from pbrl_bringup.experiments import namo_scaling as scaling
from pbrl_bringup.experiments.namo_scaling_figure import draw, length_of, way_of
from pbrl_namo.planner import NamoPlan
from pbrl_namo.scene import NamoScene


def planned(count: int, number: int, seconds: float, answer: str = scaling.MOVE) -> scaling.Planned:
    return scaling.Planned(count, number, seconds, seconds, 0.0, 3, 4, 2, answer, "")


def by_law(exponent: float, factor: float = 0.02) -> list[scaling.Planned]:
    """Rooms of a power law; one of each size took far longer, which medians do not mind."""
    return [
        planned(count, number, (50.0 if number == 0 else 1.0) * factor * count**exponent)
        for count in scaling.SIZES
        for number in range(5)
    ]


@pytest.fixture(scope="module")
def room() -> tuple[scaling.Planned, NamoScene, NamoPlan]:
    return scaling.trial(0, 5, 0)


@pytest.mark.parametrize("exponent", [0.0, 0.9, 1.0, 2.0])
def test_the_exponent_of_a_power_law_is_found(exponent: float) -> None:
    fit = scaling.fitted(by_law(exponent))
    assert fit.exponent == pytest.approx(exponent, abs=1e-9)
    assert fit.at(np.array([17.0])) == pytest.approx([0.02 * 17.0**exponent])


def test_a_row_holds_up_to_its_goal_and_not_beyond() -> None:
    slow = by_law(1.3)
    assert not scaling.rows_of(slow, scaling.fitted(slow))[0].holds
    good = by_law(1.1)
    assert scaling.rows_of(good, scaling.fitted(good))[0].holds
    late = [*good, planned(max(scaling.SIZES), 9, 20.1)]
    assert not scaling.rows_of(late, scaling.fitted(late))[1].holds
    broken = [*good, planned(max(scaling.SIZES), 9, float("nan"))]
    assert not scaling.rows_of(broken[::-1], scaling.fitted(good))[1].holds


def test_every_answer_is_counted_once() -> None:
    found = [planned(5, 0, 1.0), planned(80, 0, 2.0, scaling.CUT_OFF), planned(80, 1, 2.0, scaling.NONE)]
    against = scaling.rows_of(found, scaling.fitted(found))[1].against
    assert [against[answer] for answer in (scaling.MOVE, scaling.CUT_OFF, scaling.NONE)] == [1.0, 1.0, 1.0]
    assert scaling.summary(found, 80)["answers"] == {scaling.CUT_OFF: 1, scaling.NONE: 1}


def test_a_trial_says_what_the_plan_says(room: tuple[scaling.Planned, NamoScene, NamoPlan]) -> None:
    done, scene, made = room
    assert len(scene.movable) == done.count == 5
    assert (done.answer == scaling.MOVE) == (made.chosen is not None) == (done.reason == "")
    assert done.wall >= done.believing > 0.0
    assert done.process > 0.0
    again, _, _ = scaling.trial(0, 5, 0)
    still = {"process": 0.0, "wall": 0.0, "believing": 0.0}
    assert replace(again, **still) == replace(done, **still)


def test_the_way_that_is_drawn_ends_where_the_plan_does(room: tuple[scaling.Planned, NamoScene, NamoPlan]) -> None:
    _, scene, made = room
    assert made.chosen is not None and made.chosen.plan is not None
    plan = made.chosen.plan
    way = way_of(plan, scene.poses[plan.object])
    assert way[0] == pytest.approx(scene.poses[plan.object])
    assert way[-1] == pytest.approx(plan.end, abs=1e-9)
    assert 0.0 < length_of(scene, plan) < 3.0


def test_there_is_a_figure_with_and_without_a_move(
    room: tuple[scaling.Planned, NamoScene, NamoPlan], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pbrl_bringup.experiments.figures.DPI", 25)
    _, scene, made = room
    found = [*by_law(1.0), planned(80, 7, 3.0, scaling.CUT_OFF)]
    fit = scaling.fitted(found)
    pictures = [draw(found, fit, scene, each, tmp_path).read_bytes() for each in (made, replace(made, chosen=None))]
    assert all(picture.startswith(b"\x89PNG") for picture in pictures)
    assert pictures[0] != pictures[1]


def test_it_is_known_by_name() -> None:
    assert "namo-scaling" in EXPERIMENTS
