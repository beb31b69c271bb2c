"""What the robot fits score: final errors, distances to what holds a body, the rows; and that the panels are drawn."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bullet_sim.scene import load_scene
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.robot_fits import CART, CASES, LOCKED, LOSSES, UNLOCKED, fit_options, rows_of
from pbrl_bringup.experiments.robot_fits_figure import draw, elsewhere, ending, title
from pbrl_bringup.experiments.robot_fits_trials import (
    EndError,
    Found,
    Overlay,
    Trial,
    end_error,
    holding_casters,
    placed,
    score,
)
from pbrl_control.push_plan import load_plan
from pbrl_model.parameters import free_columns
from pbrl_model.posterior import Posterior

TABLE = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_case_s_pushes_are_of_a_body_of_its_scene_that_can_weigh_as_much_as_it_does(case) -> None:
    scene, plans = load_scene(case.scene), (load_plan(case.push), load_plan(case.heldout))
    assert plans[0].object == plans[1].object
    assert plans[0].object in scene.bodies
    assert plans[0].segments != plans[1].segments


def test_the_final_error_of_a_shifted_and_turned_pose_is_that_by_hand() -> None:
    recorded = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.3]])
    shifted, turned, spun = (recorded + np.array(by) for by in ([0.3, 0.4, 0.0], [0.0, 0.0, 0.2], [0, 0, 2 * np.pi]))
    assert end_error(shifted, recorded, TABLE) == EndError(pytest.approx(0.5), 0.0, pytest.approx(0.5))
    radius = math.hypot(0.375, 0.75)
    error = end_error(turned, recorded, TABLE)
    assert (error.position, error.yaw) == (0.0, pytest.approx(0.2))
    assert error.corners == pytest.approx(2 * radius * math.sin(0.1))
    assert end_error(spun, recorded, TABLE).yaw == pytest.approx(2 * np.pi), "not wrapped"


def test_points_are_placed_as_the_body_turns() -> None:
    np.testing.assert_allclose(
        placed(np.array([[1.0, 0.0]]), np.array([2.0, 3.0, np.pi / 2])), [[2.0, 4.0]], atol=1e-12
    )


def one_wheel(name: str, x: float, y: float, theta: float) -> Posterior:
    """A posterior that is sure of one wheel."""
    names = free_columns("wheel+ground")
    values = {"mass": 30.0, "wheel_x": x, "wheel_y": y, "wheel_theta": theta, "mu_x": 0.0, "mu_y": 0.4}
    return Posterior(name, "wheel+ground", names, np.array([[[values.get(each, 0.01) for each in names]]]))


@pytest.mark.parametrize("y", [-0.3, 0.0, 0.2])
@pytest.mark.parametrize("theta", [0.0, np.pi, -np.pi])
def test_every_wheel_on_the_axle_that_rolls_ahead_is_the_cart_s(y: float, theta: float) -> None:
    found = score(load_scene("utility_cart"), one_wheel("cart_a", 0.308, y, theta), 0)
    assert found.distance == pytest.approx(0.0, abs=1e-9)
    assert found.turn == pytest.approx(0.0, abs=1e-9)
    assert math.isnan(found.contact)


def test_a_wheel_off_the_axle_and_turned_is_told_by_how_much() -> None:
    found = score(load_scene("utility_cart"), one_wheel("cart_a", 0.20, 0.1, np.pi - 0.25), 0)
    assert (found.distance, found.turn) == (pytest.approx(0.108), pytest.approx(0.25))


def test_a_table_s_wheel_is_measured_from_the_locked_caster_and_a_free_one_s_from_nothing() -> None:
    found = score(load_scene("locked_caster"), one_wheel("table_a", -0.315, -0.66, 0.4), 0)
    assert found.distance == pytest.approx(0.03)
    assert abs(found.contact - found.distance) <= 0.028, "the wheel touches the floor its trail off its axis"
    assert math.isnan(found.turn)
    free = score(load_scene("free_table"), one_wheel("table_a", 0.0, 0.0, 0.0), 0)
    assert math.isnan(free.distance)
    assert len(holding_casters(load_scene("free_table"), "table_a")[0]) == 0


def test_a_body_without_casters_holds_nothing_to_score() -> None:
    with pytest.raises(BringupError, match="pillar: expected a body on casters, got a fixture"):
        holding_casters(load_scene("three_tables"), "pillar")


def trial(case: str, seed: int, loss: str, corners: float, distance: float = 0.01) -> Trial:
    """A trial with these numbers; its errors on the recording are a tenth of those on the held-out push."""
    turn = 0.1 if case == CART.name else math.nan
    held, here = EndError(corners, 0.1, corners), EndError(0.1 * corners, 0.1, 0.1 * corners)
    far = EndError(5.0, 3.0, 5.0)
    found = Found(0.0, 0.0, 0.0, 33.0, distance, distance, turn)
    return Trial(case, seed, loss, found, (far, far), (here, held), (), 1.0)


GOOD = {"one_step": 0.9, "integrated": 0.2, "windowed": 0.1}


def all_trials(errors: dict[str, float], seeds: int = 5) -> list[Trial]:
    return [trial(case.name, seed, loss, errors[loss]) for case in CASES for seed in range(seeds) for loss in LOSSES]


def test_rows_hold_where_ours_is_best_and_say_what_they_are_compared_with() -> None:
    rows = rows_of(all_trials(GOOD))
    assert [row.holds for row in rows] == [True] * 6
    assert rows[0].value == 5
    assert rows[2].value == pytest.approx(4.5), "one-step over integrated"
    assert [row.value for row in rows[3:]] == [pytest.approx(0.5)] * 3
    assert {"one_step_m", "integrated_m", "windowed_m", "unlearned_m", "windowed_median_m"} <= set(rows[3].against)


def test_rows_do_not_hold_where_ours_is_worse_or_the_wheel_is_elsewhere() -> None:
    worse = rows_of(all_trials(GOOD | {"windowed": 0.3}))
    assert [row.holds for row in worse[3:]] == [False] * 3
    far = [replace(each, found=replace(each.found, distance=0.06)) for each in all_trials(GOOD)]
    assert [row.holds for row in rows_of(far)[:2]] == [False] * 2
    nowhere = [replace(each, found=replace(each.found, distance=math.nan)) for each in all_trials(GOOD)]
    assert [row.value for row in rows_of(nowhere)[:2]] == [0.0] * 2


def test_quick_fits_are_shorter_and_see_the_whole_recording() -> None:
    quick, full = (fit_options(3, "windowed", each) for each in (True, False))
    assert quick.draws < full.draws
    assert {quick.holdout_share, full.holdout_share} == {0.0}


def test_the_six_panels_are_drawn_alike_each_time(tmp_path: Path) -> None:
    path = np.linspace([0.0, 0.0, 0.0], [0.5, 0.1, 0.6], 40)
    overlay = Overlay(path, 9 * path, path + 0.02, TABLE, (0.1, 0.2, 0.3), np.array([[-0.3, -0.7]]), False)
    free = replace(overlay, holding=np.empty((0, 2)))
    drawn = {
        (case.name, loss): (trial(case.name, 0, loss, 0.1), free if case == UNLOCKED else overlay)
        for case in CASES
        for loss in LOSSES
    }
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        assert draw(drawn, tmp_path / name).name == "figure.png"
    assert (tmp_path / "first/figure.png").read_bytes() == (tmp_path / "second/figure.png").read_bytes()


def test_titles_say_what_was_learned_and_how_it_ends() -> None:
    assert title(LOCKED.name, "one_step", "learned") == "locked table: learned with the one-step loss (26)"
    assert title(CART.name, "windowed", "expected") == "cart: expected, nothing learned"
    ours, thesis = (trial(CART.name, 0, "windowed", corners) for corners in (0.14, 0.34))
    assert elsewhere(ours, thesis) == "held-out push: corners 14 cm off (integrated loss: 34 cm)"
    assert ending(EndError(0.123, np.pi / 2, 0.2)) == "ends 12 cm and 90° off"
