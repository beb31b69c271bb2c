"""The centre of rotation of exact, noisy and hostile motions; turns about points; rows, figure, one quick turn."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments import articulation
from pbrl_bringup.experiments.articulation import ANGLES, GRIPS, PIVOTS, Pivot, centre_up_to, job_of, rows_of, turned_of
from pbrl_bringup.experiments.articulation_figure import draw
from pbrl_bringup.experiments.articulation_reach import SPEED, centre_of_rotation, reach, turn_about
from pbrl_bringup.experiments.body_jacobian_trials import Held, run
from pbrl_control.planar import compose, rotation
from pbrl_control.trajectories.trajectory import move

START = np.array([1.2, -0.3, 0.4])


def turning(point: tuple[float, float], angles: np.ndarray, start: np.ndarray = START) -> np.ndarray:
    """Poses of a body that turns about a point of it."""
    place = compose(start, np.array([*point, 0.0]))[:2]
    return np.array([[*(place - rotation(start[2] + a) @ point), start[2] + a] for a in angles])


@pytest.mark.parametrize("pivot", PIVOTS, ids=lambda pivot: pivot.name)
@pytest.mark.parametrize("last", [0.05, -0.4, 3.0, -7.0])
def test_the_centre_of_an_exact_turn_is_found_whatever_its_angle(pivot: Pivot, last: float) -> None:
    poses = turning(pivot.point, np.linspace(0.0, last, 40))
    poses[:, 2] = np.angle(np.exp(1j * poses[:, 2]))
    found = centre_of_rotation(poses)
    np.testing.assert_allclose(found.body, pivot.point, atol=1e-9)
    np.testing.assert_allclose(found.world, compose(START, np.array([*pivot.point, 0.0]))[:2], atol=1e-9)
    assert found.wander < 1e-9


def test_the_centre_does_not_depend_on_where_the_world_begins() -> None:
    poses, frame = turning((0.3, -0.2), np.linspace(0.0, 0.5, 9)), np.array([100.0, -40.0, 2.0])
    moved = np.array([compose(frame, pose) for pose in poses])
    np.testing.assert_allclose(centre_of_rotation(moved).body, centre_of_rotation(poses).body, atol=1e-9)


def test_noise_of_millimetres_moves_the_centre_by_about_noise_over_angle() -> None:
    rng, poses = np.random.default_rng(3), turning((0.1, 0.5), np.linspace(0.0, 0.5, 200))
    noise = 1e-3
    poses[:, :2] += noise * rng.standard_normal((200, 2))
    found = centre_of_rotation(poses)
    assert np.hypot(*(found.body - [0.1, 0.5])) < noise / 0.5
    assert found.wander == pytest.approx(noise * math.sqrt(2.0), rel=0.2)


@pytest.mark.parametrize(
    "poses",
    [
        np.zeros((5, 3)),
        np.linspace([0.0, 0.0, 1.0], [1.0, 2.0, 1.0], 6),
        np.zeros((1, 3)),
        np.zeros((0, 3)),
        np.zeros((4, 2)),
        np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]]),
        np.array([[0.0, 0.0, 0.0], [0.0, np.inf, 1.0]]),
    ],
)
def test_what_does_not_turn_or_is_no_motion_is_refused(poses: np.ndarray) -> None:
    with pytest.raises(BringupError, match="centre of rotation: expected"):
        centre_of_rotation(poses)


@pytest.mark.parametrize("pivot", PIVOTS, ids=lambda pivot: pivot.name)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_turn_s_twist_leaves_its_point_where_it_is_and_is_slow(pivot: Pivot, sign: float) -> None:
    twist = turn_about(np.array(pivot.point), sign * 0.1)
    assert math.copysign(1.0, twist[2]) == sign
    assert np.hypot(*twist[:2]) <= SPEED + 1e-12
    poses = np.array([move(START, t * twist) for t in np.linspace(0.0, 5.0, 8)])
    np.testing.assert_allclose(centre_of_rotation(poses).body, pivot.point, atol=1e-9)


@pytest.mark.parametrize("pivot", PIVOTS, ids=lambda pivot: pivot.name)
def test_a_trial_s_path_turns_about_its_point_by_the_angle(pivot: Pivot) -> None:
    path = job_of(pivot, "right", 0.4, 0).plan.trajectory(START)
    poses = np.array([path.at(float(t)).pose for t in np.linspace(0.0, path.duration, 20)])
    np.testing.assert_allclose(centre_of_rotation(poses).body, pivot.point, atol=1e-9)
    assert poses[-1, 2] - poses[0, 2] == pytest.approx(-0.4)


def held(pivot: Pivot, way: str, angle: float, force: float = 5.0) -> Held:
    """What a perfect turn would leave."""
    count = 30
    angles = np.linspace(0.0, angle if way == "left" else -angle, count)
    poses = turning(pivot.point, angles)
    base = np.linspace([0.0, 0.0, 0.0], [0.3, 0.4, 0.2], count)
    plates = np.tile([[0.7, 0.15, 0.0], [0.7, -0.15, 0.0]], (count, 1, 1))
    wrench = np.zeros((count, 2, 3))
    wrench[:, 0, 0] = force
    outline = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])
    job = job_of(pivot, way, math.radians(ANGLES[-1]), 0)
    many = np.full((count, 2), 4.0)
    return Held(
        job,
        "done",
        "done",
        np.linspace(0.0, 5.0, count),
        poses,
        base,
        plates,
        wrench,
        many,
        np.full(count, 0.2),
        poses,
        poses[-1],
        1.0,
        4.0,
        outline,
        np.zeros((0, 2)),
    )


def test_a_perfect_turn_scores_no_error_at_each_angle_and_its_base_is_measured() -> None:
    asked = math.radians(ANGLES[-1])
    turned = turned_of(PIVOTS[1], "right", asked, held(PIVOTS[1], "right", asked))
    np.testing.assert_allclose(turned.off, 0.0, atol=1e-9)
    assert (turned.angle, turned.wander) == (pytest.approx(asked), pytest.approx(0.0, abs=1e-9))
    assert (turned.driven, turned.spun) == (pytest.approx(0.5), pytest.approx(0.2))


def test_angles_that_were_not_reached_or_not_asked_have_no_centre() -> None:
    angles = np.linspace(0.0, 0.3, 20)
    poses = turning((0.1, 0.2), angles)
    assert np.isnan(centre_up_to(poses, angles, 0.4, 0.5)).all(), "not reached"
    assert np.isnan(centre_up_to(poses, angles, 0.4, 0.3)).all(), "not asked"
    np.testing.assert_allclose(centre_up_to(poses, angles, 0.2, 0.3), [0.1, 0.2], atol=1e-9)


def test_a_turn_that_never_set_out_scores_nothing_and_no_row_holds_for_it() -> None:
    perfect = held(PIVOTS[0], "left", 0.4)
    never = replace(
        perfect,
        time=np.zeros(0),
        object=np.zeros((0, 3)),
        base=np.zeros((0, 3)),
        phase="failed",
        plates=np.zeros((0, 2, 3)),
        wrench=np.zeros((0, 2, 3)),
        margin=np.zeros(0),
    )
    turned = turned_of(PIVOTS[0], "left", 0.4, never)
    assert turned.angle == 0.0
    assert math.isnan(turned.last_off)
    rows = rows_of(
        [turned, turned_of(PIVOTS[5], "left", 0.4, held(PIVOTS[5], "left", 0.4))], {("a", "left"): (0.1, 0.2)}
    )
    assert not rows[0].holds
    assert not rows[1].holds


def test_rows_hold_for_perfect_turns_and_not_for_forces_beyond_the_expected() -> None:
    asked, reaches = math.radians(ANGLES[-1]), {("a", "left"): (0.5, 1.5)}
    good = [turned_of(p, "left", asked, held(p, "left", asked)) for p in PIVOTS]
    assert all(row.holds for row in rows_of(good, reaches))
    strong = [turned_of(p, "left", asked, held(p, "left", asked, 50.0)) for p in PIVOTS]
    assert {row.what for row in rows_of(strong, reaches) if not row.holds} == {
        "grip force over the expected, locked caster, worst",
        "grip force, free table, worst",
        "turns that unexpected force would have ended",
    }


def test_reach_without_the_base_is_alike_to_both_sides_and_ends() -> None:
    grips = np.array(GRIPS)
    left, right = (reach((-0.375, 0.0), sign, grips, driving=False) for sign in (1.0, -1.0))
    assert left == pytest.approx(right, abs=math.radians(2.0))
    assert math.radians(10.0) < left < math.radians(90.0)


def test_the_figure_is_drawn_alike_each_time_even_of_a_turn_that_never_set_out(tmp_path: Path) -> None:
    asked = math.radians(ANGLES[-1])
    turned = [turned_of(p, way, asked, held(p, way, asked)) for p in PIVOTS[:2] for way in ("left", "right")]
    reaches = {(each.pivot.name, each.way): (0.3, 0.6) for each in turned}
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        draw(turned, reaches, ANGLES, tmp_path / name)
    assert (tmp_path / "first/figure.png").read_bytes() == (tmp_path / "second/figure.png").read_bytes()


def test_a_table_turns_about_the_point_between_the_grips_in_bullet() -> None:
    pivot, asked = PIVOTS[3], math.radians(10.0)
    turned = turned_of(pivot, "left", asked, run(job_of(pivot, "left", asked, 0)))
    assert turned.held.phase == "done", turned.held.status
    assert turned.angle == pytest.approx(asked, abs=math.radians(2.0))
    assert turned.off[1] < 0.05
    assert turned.held.margin.min() > articulation.MARGIN
