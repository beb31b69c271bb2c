"""A simulated desk end to end in one process: seen, taught, tidied; rows of the experiments from outcomes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bullet_sim.settings import parse_settings
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.displacement_models import Compared
from pbrl_bringup.experiments.displacement_models import rows_of as model_rows
from pbrl_bringup.experiments.tabletop_clean import rows_of as clean_rows
from pbrl_bringup.experiments.tabletop_executed import Executed
from pbrl_bringup.experiments.tabletop_models import rows_of as compared_rows
from pbrl_bringup.experiments.tabletop_obstacle import rows_of as obstacle_rows
from pbrl_bringup.experiments.tabletop_planning import Searched, Thesis
from pbrl_bringup.experiments.tabletop_planning import rows_of as planning_rows
from pbrl_bringup.tabletop.desk_run import DeskRun, random_layout
from pbrl_bringup.tabletop.models import best_known, desk_scene, objective_file, taught
from pbrl_bringup.tabletop.pictures import Pictures
from pbrl_bringup.tabletop.teaching import teach
from pbrl_bringup.tabletop.tidy import Outcome, tidied
from pbrl_control.planar import wrap
from pbrl_planner.tabletop import (
    LearnedDisplacements,
    LessonSettings,
    Near,
    Objective,
    PhysicsDisplacements,
    TabletopSettings,
    Tidying,
    TidyingSettings,
    pushes_of,
)
from tabletop_sim.scene import DeskScene

TRAVELS = (0.05,)


def one(vision: str = "noise") -> DeskScene:
    data = {"items": {"eraser": {"kind": "eraser", "pose": [0.1, 0.0, 0.4]}}, "vision": {"source": vision}}
    return parse_settings(data, DeskScene, "test")


def test_the_camera_sees_what_is_there_and_which_way_round() -> None:
    with DeskRun(desk_scene("desk", "rendered"), seed=1) as run:
        rng = np.random.default_rng(2)
        for _ in range(4):
            layout = random_layout(run.desk, rng)
            run.place(layout)
            run.session.follow(np.tile(run.session.arm.joint_state()[0], (5, 1)), 0.01)
            seen, truth = run.layout(run.look()), run.truth()
            assert np.abs(seen[:, :2] - truth[:, :2]).max() < 0.004
            assert max(abs(wrap(a - b)) for a, b in zip(seen[:, 2], truth[:, 2], strict=True)) < math.radians(2.0)


def test_items_that_touch_each_other_or_an_obstacle_are_told_apart() -> None:
    with DeskRun(desk_scene("obstacle", "rendered"), seed=1) as run:
        beside = np.array([[0.04 + 0.0255, 0.0, math.pi / 2]])  # flat against the hole punch
        run.place(beside)
        run.session.follow(np.tile(run.session.arm.joint_state()[0], (5, 1)), 0.01)
        seen = run.look()
        assert "eraser" in seen
        np.testing.assert_allclose(seen["eraser"][:2], run.truth()[0, :2], atol=0.004)
    with DeskRun(desk_scene("desk", "rendered"), seed=1) as run:
        layout = np.array([[-0.25, 0.1, 0.3], [0.2, 0.1, 0.0], [0.0, -0.05, 0.0]])
        run.place(layout)
        run.look()
        layout[0] = [0.0, 0.0555, 0.0]  # the eraser is pushed up to the scale
        run.session.world.place("eraser", layout[0])
        run.session.follow(np.tile(run.session.arm.joint_state()[0], (5, 1)), 0.01)
        seen = run.look()
        assert set(seen) == {"eraser", "remote", "scale"}
        np.testing.assert_allclose(seen["eraser"][:2], run.truth()[0, :2], atol=0.005)


def test_an_eraser_is_taught_and_then_put_in_its_place() -> None:
    with DeskRun(one(), seed=1) as run:
        settings = LessonSettings(least=3, most=3)
        model, seen = teach(run, pushes_of(TRAVELS), settings)
        assert len(seen) >= 18
        physics = PhysicsDisplacements(run.desk.effector, seed=1)
        for name, push, moved in seen[:6]:
            physics.update(name, push, moved)
        item = run.desk.items[0]
        learned = model.displacements(item, pushes_of(TRAVELS))
        told = physics.displacements(item, pushes_of(TRAVELS))
        assert np.abs(learned.mean - told.mean)[:, :2].max() < 0.008
        assert np.abs(learned.mean - told.mean)[:, 2].max() < 0.3, "across the middle a push turns either way"
        run.place(np.array([[0.2, 0.1, 0.5]]))
        objective = Objective.of(run.desk, [Near(term="near", items=("eraser",), point=(-0.1, 0.0))])
        task = Tidying(
            objective,
            physics,
            seed=1,
            settings=TidyingSettings(enough=0.03, think=1.0),
            planning=TabletopSettings(travels=(0.05, 0.02)),
        )
        pictures = Pictures(run.session, most=4)
        outcome, layouts = tidied(run, task, pictures.take)
        assert outcome.ending == "TIDY", outcome.reason
        assert outcome.cost < 0.035
        assert len(layouts) == outcome.pushes + 1
        strip = pictures.strip()
        assert strip[0][0] == 0
        assert strip[-1][0] == outcome.pushes
        assert [number for number, _ in strip] == sorted({number for number, _ in strip})


@pytest.mark.parametrize(("forward", "most"), [("tables", 130), ("physics", 8)])
def test_what_was_taught_makes_a_model_in_another_process(forward: str, most: int) -> None:
    found = taught(one(), 1, forward)
    assert 6 <= found.pushes <= most
    model = found.model(0.012, 1)
    with DeskRun(one(), seed=1) as run:
        told = model.displacements(run.desk.items[0], pushes_of((0.05,)))
    assert told.mean[0, 0] > 0.02 > -0.02 > told.mean[1, 0]


def test_an_item_that_is_gone_ends_teaching_in_words() -> None:
    with DeskRun(one(), seed=1) as run:
        run.session.world.place("eraser", np.array([9.0, 0.0, 0.0]))
        run.session.follow(np.tile(run.session.arm.joint_state()[0], (50, 1)), 0.01)
        with pytest.raises(BringupError, match="not seen: eraser"):
            teach(run, pushes_of(TRAVELS))


@pytest.mark.parametrize("name", ["desk", "table_3", "table_6", "obstacle"])
def test_desks_of_the_workspace_have_an_objective_that_can_be_reached(name: str) -> None:
    with DeskRun(desk_scene(name, "noise"), seed=1) as run:
        objective = Objective.from_file(run.desk, objective_file("straighten" if name == "desk" else name))
        start = run.truth()
        assert run.desk.fault(start, 0.01) == ""
        assert best_known(objective, [start])[1] < objective(start)


def outcome(cost: float, replans: int = 2) -> Outcome:
    return Outcome("TIDY", "", 20, replans, 0.8, cost, 3.0, 200.0)


def test_rows_count_what_they_say() -> None:
    straight = [[0.01, 0.0, 0.0], [-0.01, 0.0, math.pi / 2], [0.0, 0.0, math.pi]]
    runs = [Executed(outcome(0.2), straight, 0.0, 150)] * 18 + [
        Executed(outcome(0.9, 9), [[0.3, 0.0, 0.4]] * 3, 0.0, 150)
    ] * 2
    rows = clean_rows(runs, 0.3)
    assert (rows[0].value, rows[0].holds) == (18.0, True)
    assert (rows[1].value, rows[2].value) == (2.0, 18.0)
    assert not clean_rows(runs[1:] + runs[-1:], 0.3)[0].holds
    touched = [Executed(outcome(0.02), [], 0.0, 50)] * 18 + [Executed(outcome(0.02), [], 0.01, 50)] * 2
    assert [row.holds for row in obstacle_rows(touched, 0.05)][:2] == [False, False]
    few = [Executed(outcome(0.2), straight, 0.0, 18)] * 7 + [Executed(outcome(0.9, 9), straight, 0.0, 18)]
    both = compared_rows(runs[:8], few, 0.3)
    assert [row.holds for row in both] == [False, True, True, True]
    assert both[1].value == pytest.approx(150 / 18)
    searched = Searched(0.8, 0.3, 4.0, 0.2, 1.0, 0.5, (math.inf, 2.0, 1.0), math.inf, 0.1, 30)
    held = planning_rows([searched] * 3, [searched] * 3, Thesis(1399, 18.0, 33.0, 2.0))
    assert [row.holds for row in held] == [True, True, True, True, False]
    assert [row.value for row in held[1:4]] == pytest.approx([0.1, 4.0, 30.0]), "who gets nowhere counts with his time"
    neither = replace(searched, seconds_with=math.inf, nearly=(math.inf, math.inf, 1.0))
    unknown = planning_rows([neither] * 3, [], Thesis(1399, 18.0, 33.0, 2.0))
    assert [row.holds for row in unknown] == [False, True, False], "two searches that get nowhere are not compared"
    compared = Compared(
        "a", "+x", 0.05, (0.05, 0, 0), (0.05, 0.001, 0.01), (True, True, False), (0.05, 0, 0.01), (0.05, 0.002, 0.01)
    )
    told = model_rows([compared] * 10, 50)
    assert told[0].value == pytest.approx(2.0 / 3.0)
    assert told[2].value == pytest.approx(2.0)
    assert LearnedDisplacements().as_dict() == {}
