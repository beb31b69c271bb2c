"""What is kept of a manipulation: margins, models told, stops, ends; rows, figure, and one quick trial in Bullet."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bullet_sim.scene import load_scene
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.body_jacobian import (
    CART,
    QUICK_SHARE,
    SUBJECTS,
    TABLE,
    WAYS,
    ending,
    job_of,
    rows_of,
)
from pbrl_bringup.experiments.body_jacobian_figure import VIEWS, draw
from pbrl_bringup.experiments.body_jacobian_scenes import believed_free, in_a_hall, told
from pbrl_bringup.experiments.body_jacobian_trials import Held, first_longer, largest, least, run, workspace_margin
from pbrl_control.constraints.classes import Freedom, ModelClass
from pbrl_control.planar import compose, inverse
from pbrl_control.settings import ProgramSettings
from pbrl_model.kernel import GRAVITY

PROGRAM = ProgramSettings(reach_x=(0.4, 1.0), reach_y=(-0.1, 0.5))


@pytest.mark.parametrize(
    ("left", "right", "margin"),
    [
        ((0.7, 0.2), (0.7, -0.2), 0.3),
        ((0.5, 0.2), (0.7, -0.2), 0.1),
        ((0.7, 0.2), (0.95, -0.2), 0.05),
        ((0.7, 0.2), (0.7, -0.55), -0.05),
        ((0.7, -0.12), (0.7, -0.2), -0.02),
        ((0.7, 0.2), (0.7, 0.09), 0.01),
    ],
)
def test_the_margin_is_that_of_the_worse_gripper_mirrored(left, right, margin) -> None:
    planar = np.array([[*left, 0.3], [*right, -0.3]])
    assert workspace_margin(planar, PROGRAM) == pytest.approx(margin)
    mirrored = np.array([[right[0], -right[1], 0.0], [left[0], -left[1], 0.0]])
    assert workspace_margin(mirrored, PROGRAM) == pytest.approx(margin)
    many = workspace_margin(np.tile(planar, (7, 1, 1)), PROGRAM)
    np.testing.assert_allclose(many, np.full(7, margin))


def test_no_rows_have_no_margin() -> None:
    assert workspace_margin(np.zeros((0, 2, 3)), PROGRAM).shape == (0,)


def test_something_is_true_for_long_enough_without_a_break_or_never() -> None:
    time, true = np.arange(8) * 0.1, np.array([0, 1, 1, 0, 1, 1, 1, 1], dtype=bool)
    assert first_longer(time, true, 0.15) == pytest.approx(0.6)
    assert first_longer(time, true, 0.0) == pytest.approx(0.1)
    assert math.isnan(first_longer(time, true, 1.0))
    assert math.isnan(first_longer(np.zeros(0), np.zeros(0, dtype=bool), 0.1))


@pytest.mark.parametrize(
    ("scene", "name", "expected"),
    [
        ("free_table", "table_a", ModelClass.UNCONSTRAINED),
        ("locked_caster", "table_a", ModelClass.FIXED_POINT),
        ("utility_cart", "cart_a", ModelClass.ANISOTROPIC),
    ],
)
def test_what_is_told_of_a_body_is_what_its_wheels_do(scene: str, name: str, expected: ModelClass) -> None:
    model = told(load_scene(scene), name)
    assert Freedom.of(model).model_class == expected
    assert Freedom.of(believed_free(model)).model_class == ModelClass.UNCONSTRAINED
    assert believed_free(model).mass == model.mass


def test_the_cart_s_wheel_is_told_on_its_axle_and_a_fixture_has_nothing_to_tell() -> None:
    assert told(load_scene("utility_cart"), "cart_a").wheel == pytest.approx([0.308, 0.0])
    with pytest.raises(BringupError, match="expected a body on casters"):
        told(load_scene("three_tables"), "pillar")


def test_casters_that_swing_round_are_told_of_and_those_that_do_not_are_not() -> None:
    free, locked = (told(load_scene(name), "table_a").casters for name in ("free_table", "locked_caster"))
    cart = told(load_scene("utility_cart"), "cart_a").casters
    assert [len(each.places) for each in (free, locked, cart)] == [4, 3, 2]
    assert {each.share for each in (free, locked, cart)} == {0.25}
    assert (cart.places[:, 0] < 0.0).all(), "those at the front are bolted on"
    load = 33.0 * GRAVITY / 4.0
    assert free.friction == pytest.approx((0.04 / load + 0.7 * 0.008 / 4.0) / 0.028)


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.name)
def test_the_robot_stands_square_before_its_grips(subject) -> None:
    plan = job_of(subject, "ours", 0, False).plan
    scene = load_scene(subject.scene)
    x, y, yaw = in_a_hall(scene, plan).robot.pose
    places = [compose(np.array(scene.bodies[subject.object].pose), np.array([*g.point, 0.0])) for g in plan.grips]
    seen = compose(inverse(np.array([x, y, yaw])), np.append(np.mean(places, axis=0)[:2], 0.0))
    assert seen[1] == pytest.approx(0.0, abs=1e-9)
    assert (x, yaw) == (pytest.approx(scene.robot.pose[0]), scene.robot.pose[2])


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.name)
def test_every_way_has_the_same_path_and_only_unknown_ones_no_constraint(subject) -> None:
    jobs = {way: job_of(subject, way, 0, False) for way in WAYS}
    assert len({job.plan.waypoints for job in jobs.values()}) == 1
    assert jobs["unknown"].model is None or not Freedom.of(jobs["unknown"].model).rows.size
    assert all(jobs[way].model is not None for way in WAYS if way != "unknown")
    part = job_of(subject, "ours", 0, True).plan.waypoints[0]
    np.testing.assert_allclose(np.array(part) / QUICK_SHARE, jobs["ours"].plan.waypoints[0])


def held(subject, way: str, force: float = 10.0, margin: float = 0.1, off: float = 0.0) -> Held:
    """What a trial with these numbers leaves."""
    count = 20
    path = np.linspace([1.0, 0.0, 0.1], [1.5, 0.2, 0.3], 50)
    body = np.linspace(path[0], path[-1] + [off, 0.0, 0.0], count)
    wrench = np.zeros((count, 2, 3))
    wrench[10:, 1] = 0.6 * force, -0.8 * force, 2.0
    plates = np.tile([[0.7, 0.15, 0.0], [0.7, -0.15, 0.0]], (count, 1, 1))
    outline = np.array([[-0.3, -0.5], [0.3, -0.5], [0.3, 0.5], [-0.3, 0.5]])
    return Held(
        job_of(subject, way, 0, False),
        "done",
        "done",
        np.linspace(0.0, 5.0, count),
        body,
        np.zeros((count, 3)),
        plates,
        wrench,
        np.full((count, 2), 8.0),
        np.full(count, margin),
        path,
        path[-1],
        1.0,
        8.0,
        outline,
        np.array([[0.2, 0.3]]),
    )


def everything(**changed: Held) -> dict[tuple[str, str], Held]:
    """Trials as the thesis has them: force where nothing is known, out of the workspace without steering."""
    trials = {(subject.name, way): held(subject, way) for subject in SUBJECTS for way in WAYS}
    trials["cart", "unknown"] = held(CART, "unknown", force=170.0, off=0.3)
    trials["table", "unsteered"] = held(TABLE, "unsteered", force=90.0, margin=-0.05)
    return trials | {("cart" if key.startswith("cart") else "table", "ours"): each for key, each in changed.items()}


def test_force_margin_end_and_stop_are_those_of_the_rows() -> None:
    trial = held(CART, "ours", force=60.0, margin=0.07, off=0.02)
    assert (largest(trial), least(trial)) == (pytest.approx(60.0), pytest.approx(0.07))
    assert ending(trial) == (pytest.approx(0.02), pytest.approx(0.0, abs=1e-12))
    assert trial.limit == 40.0
    assert trial.stopped == pytest.approx(trial.time[11]), "over the limit from row 10 on, for 0.2 s"
    assert math.isnan(held(CART, "ours", force=39.0).stopped)


def test_rows_hold_where_ours_is_gentle_and_inside_and_not_where_it_is_not() -> None:
    assert all(row.holds for row in rows_of(everything()))
    rough = rows_of(everything(cart=held(CART, "ours", force=80.0, margin=0.01, off=0.1)))
    assert [row.holds for row in rough[:4]] == [False] * 4
    out = rows_of(everything(table=held(TABLE, "ours", force=80.0, margin=0.01, off=0.1)))
    assert [row.holds for row in out[5:]] == [False] * 3


def never(trial: Held) -> Held:
    """A trial that did not get as far as moving anything."""
    none = np.zeros(0)
    return replace(
        trial,
        phase="failed",
        status="the edge was not reached",
        time=none,
        object=np.zeros((0, 3)),
        base=np.zeros((0, 3)),
        plates=np.zeros((0, 2, 3)),
        wrench=np.zeros((0, 2, 3)),
        expected=np.zeros((0, 2)),
        margin=none,
        path=np.zeros((0, 3)),
        peak=math.nan,
        progress=0.0,
    )


def test_a_trial_that_never_set_out_has_no_numbers_and_its_rows_do_not_hold(tmp_path: Path) -> None:
    trials = everything(cart=never(held(CART, "ours")))
    rows = rows_of(trials)
    assert not any(row.holds for row in rows[:4])
    assert draw(trials, tmp_path).is_file()


def test_the_figure_is_drawn_alike_each_time_with_what_there_is(tmp_path: Path) -> None:
    few = {key: each for key, each in everything().items() if key[1] in (VIEWS[0], VIEWS[-1])}
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        draw(few, tmp_path / name)
    assert (tmp_path / "first/figure.png").read_bytes() == (tmp_path / "second/figure.png").read_bytes()


def test_wheels_that_nobody_told_of_are_felt_in_bullet() -> None:
    job = job_of(CART, "unknown", 0, True)
    trial = run(job)
    assert trial.force.max() > trial.limit
    assert math.isfinite(trial.stopped)
    assert trial.margin.shape == trial.time.shape
    assert (np.diff(trial.time) > 0.0).all()
