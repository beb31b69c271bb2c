"""Turns and doorways of robot and cart: passages widen without losing room, least widths, what is swept."""

from __future__ import annotations

import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from pbrl_bringup.commands.experiment import EXPERIMENTS
from pbrl_bringup.experiments import cart_doors, cart_passages
from pbrl_bringup.experiments.cart_doors_figure import draw as draw_doors
from pbrl_bringup.experiments.cart_passages import (
    BENT,
    BESIDE,
    CELL,
    STRAIGHT,
    Least,
    corner,
    into_door,
    least_width,
    open_floor,
    out_of_door,
    solve,
)
from pbrl_bringup.experiments.cart_plan_drawing import Drawn, spaced
from pbrl_bringup.experiments.cart_turn import Turn, cells_swept, row_of, scenes, swept_area, trimmed
from pbrl_bringup.experiments.cart_turn_figure import draw as draw_turns
from pbrl_planner.lattice import ArticulatedBody, GeneratorSettings, Motions, generate
from pbrl_planner.lattice.body import rectangle

HALF = 0.15


@pytest.fixture(scope="module")
def small() -> Motions:
    """A square of 0.3 m that goes any way it likes."""
    settings = GeneratorSettings(headings=8, articulations=1, stride=4)
    return Motions(generate(settings), None, ArticulatedBody(rectangle(-HALF, HALF, HALF)))


@pytest.mark.parametrize("make", [corner, lambda n: into_door(n, 70), partial(into_door, 30), partial(out_of_door, 30)])
def test_a_wider_passage_has_all_the_room_of_a_narrower_one(make) -> None:
    for narrow, wide in ((40, 41), (41, 60)):
        one, other = make(narrow), make(wide)
        rows, columns = one.occupied.shape
        shift = np.round((np.array(one.origin) - other.origin) / CELL).astype(int)
        same = other.occupied[shift[1] : shift[1] + rows, shift[0] : shift[0] + columns]
        assert same.shape == one.occupied.shape and not (same & ~one.occupied).any()
        assert (one.start, one.goal) == (other.start, other.goal)
        assert (same != one.occupied).any()


@pytest.mark.parametrize("door", [28, 33])
def test_a_doorway_is_as_wide_as_it_says(door: int) -> None:
    passage = into_door(door, 60)
    row = math.floor((-0.05 - passage.origin[1]) / CELL)
    assert np.count_nonzero(~passage.occupied[row]) == door
    assert np.count_nonzero(~passage.occupied[:, 10]) == 60, "beside the room there is the corridor alone"


def test_the_least_width_is_bisected_and_says_what_is_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def answer(width: int, _: object) -> SimpleNamespace:
        asked.append(width)
        return None if width < 25 else SimpleNamespace(found=width >= 37, exhausted=width < 36)

    monkeypatch.setattr(cart_passages, "solve", answer)
    found = least_width(lambda width: width, None, 20, 80)
    assert (found.cells, found.refused, found.width) == (37, 36, pytest.approx(37 * CELL))
    assert not found.proved and len(asked) <= 8, "36 was given up, which is no proof"
    assert least_width(lambda width: width, None, 20, 24).proved, "who has no room to stand does not get through"
    assert least_width(lambda width: width, None, 37, 80).refused is None
    none = least_width(lambda width: width, None, 20, 30)
    assert none.cells is None and none.refused == 30 and none.proved and math.isnan(none.width)


def test_a_square_needs_the_room_from_where_it_starts_to_its_own_side(small: Motions) -> None:
    found = least_width(corner, small, 24, 30)
    assert found.proved and found.width == pytest.approx(BESIDE + HALF, abs=2 * CELL)


def test_what_is_swept_is_the_same_in_cells_and_as_a_polygon(small: Motions) -> None:
    passage = open_floor(1.0)
    made = solve(passage, small)
    assert made.found and small.body is not None
    area = swept_area(small.body, made.poses)
    cells = cells_swept(passage, small.body, made.poses)
    assert area <= cells.sum() * CELL**2 < area * 1.25
    assert not (cells & passage.occupied).any()
    assert area >= 2 * HALF * math.sqrt(2.0) * 1.0


def test_trimming_never_sweeps_more_and_keeps_start_and_goal(small: Motions) -> None:
    passage = open_floor(1.0)
    one, again = (trimmed(passage, small, np.random.default_rng(3), 5) for _ in range(2))
    assert one.area <= one.quickest and one.area == again.area and np.array_equal(one.poses, again.poses)
    ends = np.array([passage.start, passage.goal])
    assert np.abs(one.poses[[0, -1], :2] - ends[:, :2]).max() <= CELL / 2.0 + 1e-9
    free = trimmed(passage, small, np.random.default_rng(3), 0)
    assert free.area == free.quickest


def test_rows_say_where_articulation_helps() -> None:
    assert {"cart-turn", "cart-doors"} <= set(EXPERIMENTS) and set(scenes(True)) < set(scenes(False))
    poses = np.zeros((2, 4))
    row = row_of("a place", {BENT: Turn(poses, 3.0, 4.5), STRAIGHT: Turn(poses, 5.0, 6.0)})
    assert row.holds and row.value == pytest.approx(0.4) and row.against["saved_by_quickest_plans"] == 0.25
    assert not row_of("b", {BENT: Turn(poses, 4.0, 4.0), STRAIGHT: Turn(poses, 5.0, 5.0)}).holds


@pytest.mark.parametrize(("refused", "proved", "holds"), [(79, True, True), (74, True, False), (79, False, False)])
def test_a_doorway_counts_only_with_the_proof_that_a_straight_cart_fails(
    refused: int, proved: bool, holds: bool
) -> None:
    plan = SimpleNamespace(cost=1)
    row = cart_doors.passed_row({BENT: Least(75, plan, 74, True), STRAIGHT: Least(refused + 1, plan, refused, proved)})
    assert row.holds is holds


def test_figures_are_drawn(small: Motions, tmp_path) -> None:
    passage = into_door(30, 60)
    body = ArticulatedBody.pr2_with_cart()
    poses = np.array([[-2.0, 0.5, 0.0, 0.0], [-1.9, 0.5, -0.1, 0.1]])
    drawn = [Drawn(kind, passage, poses, swept_area(body, poses)) for kind in (BENT, STRAIGHT)]
    assert draw_turns({"a place": drawn}, {"a place": 0.3, "b": 0.1}, 0.25, tmp_path).stat().st_size > 10_000
    least = Least(60, SimpleNamespace(poses=poses), 59, True)
    widths = {"corner": {BENT: least, STRAIGHT: Least(64, least.plan, 63, True)}}
    assert draw_doors(least, partial(into_door, 30), widths, tmp_path).stat().st_size > 10_000
    corners = np.zeros((11, 1, 2))
    corners[:, 0, 0] = np.linspace(0.0, 1.0, 11)
    assert list(spaced(corners, 0.25)) == [0, 3, 5, 8, 10]
