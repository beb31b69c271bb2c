"""Generated primitives: every kind is there, and the set is the same mirrored and turned by a right angle."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from lattice_cases import CELL, cart_motions

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import (
    CostGrid,
    GeneratorSettings,
    Lattice,
    LatticeProblem,
    Pace,
    Primitive,
    PrimitiveSet,
    generate,
    plan,
)
from pbrl_planner.lattice.generator import direction

KINDS = {
    "forward", "far forward", "back", "diagonal", "turn", "arc", "back arc", "swing", "forward and swing",
    "arc and swing", "turn and swing",
}  # fmt: skip
SETS = [
    GeneratorSettings(),
    GeneratorSettings(headings=8, articulations=3, stride=5),
    GeneratorSettings(articulations=1),
]


def assert_same(these: list[Primitive], those: tuple[Primitive, ...]) -> None:
    """Say that two sets are one, but for the last digit of poses and whole turns."""
    keyed = {(each.start, each.end, each.multiplier, each.name): each.poses for each in those}
    assert len(these) == len(those) == len(keyed)
    for each in these:
        off = each.poses - keyed[each.start, each.end, each.multiplier, each.name]
        off[:, 2] -= np.round(off[0, 2] / (2.0 * math.pi)) * 2.0 * math.pi
        assert np.abs(off).max() < 3e-6


@pytest.mark.parametrize("chosen", SETS)
def test_there_is_every_kind_from_every_heading_and_articulation(chosen: GeneratorSettings) -> None:
    made = generate(chosen)
    expected = KINDS if chosen.articulations > 1 else {kind for kind in KINDS if "swing" not in kind}
    for heading in range(made.headings):
        for phi in range(len(made.articulations)):
            assert {each.name for each in made.primitives if each.start == (heading, phi)} == expected
    ends = {each.end[2:] for each in made.primitives}
    assert len(ends) == made.bins


@pytest.mark.parametrize("chosen", SETS)
def test_the_set_is_its_own_mirror_image(chosen: GeneratorSettings) -> None:
    made = generate(chosen)
    last = len(made.articulations) - 1

    def mirrored(each: Primitive) -> Primitive:
        (heading, phi), (dx, dy, end_heading, end_phi) = each.start, each.end
        poses = each.poses * [1.0, -1.0, -1.0, -1.0]
        start = (-heading % made.headings, last - phi)
        return Primitive(
            start, (dx, -dy, -end_heading % made.headings, last - end_phi), poses, each.multiplier, each.name
        )

    assert_same([mirrored(each) for each in made.primitives], made.primitives)


@pytest.mark.parametrize("chosen", SETS)
def test_the_set_is_the_same_after_a_quarter_of_a_turn(chosen: GeneratorSettings) -> None:
    made = generate(chosen)
    quarter = made.headings // 4

    def turned(each: Primitive) -> Primitive:
        (heading, phi), (dx, dy, end_heading, end_phi) = each.start, each.end
        poses = each.poses.copy()
        poses[:, 0], poses[:, 1] = -each.poses[:, 1], each.poses[:, 0]
        poses[:, 2] += math.pi / 2.0
        start = ((heading + quarter) % made.headings, phi)
        return Primitive(
            start, (-dy, dx, (end_heading + quarter) % made.headings, end_phi), poses, each.multiplier, each.name
        )

    assert_same([turned(each) for each in made.primitives], made.primitives)


def test_headings_are_all_different_and_steps_go_their_way() -> None:
    for headings in (8, 16):
        steps = [direction(heading, headings) for heading in range(headings)]
        angles = np.unwrap([math.atan2(y, x) for x, y in steps])
        assert all(b > a for a, b in pairwise(angles))
        assert np.abs(angles - np.arange(headings) * 2.0 * math.pi / headings).max() < 0.08


def test_time_is_the_longest_of_way_turn_and_swing() -> None:
    made = generate(GeneratorSettings(back=3))
    costs = made.base_costs(Pace(speed=0.5, yaw_rate=0.25, articulation_rate=2.0))
    by_name = {
        each.name: (each, int(cost)) for each, cost in zip(made.primitives, costs, strict=True) if each.start == (0, 2)
    }
    assert by_name["far forward"][1] == math.ceil(1000 * 8 * 0.025 / 0.5)
    assert by_name["back"][1] == 3 * 50
    assert by_name["turn"][1] == math.ceil(1000 * (math.pi / 8) / 0.25)
    assert by_name["arc"][1] == by_name["turn"][1], "turning takes longer than going"
    assert by_name["swing"][1] == pytest.approx(1000 * (math.pi / 8) / 2.0, abs=1.0)


def test_a_plan_s_mirror_image_is_a_plan_of_the_mirrored_floor() -> None:
    rng = np.random.default_rng(2)
    motions = cart_motions()
    compared = 0
    for _ in range(6):
        cells = np.where(rng.random((24, 30)) < 0.012, 254, 0).astype(np.uint8)
        upright, mirrored = (Lattice(CostGrid(each, CELL), motions) for each in (cells, cells[::-1]))
        start, goal = (0.65, 0.75, 0.0, 0.0), (2.25, 1.65, math.pi / 2, 0.7)
        try:
            found = plan(LatticeProblem(upright, start, goal))
        except PlannerError:
            continue
        images = [(x, 2.4 - y, -theta, -phi) for x, y, theta, phi in (start, goal)]
        assert plan(LatticeProblem(mirrored, *images)).cost == found.cost
        compared += found.found
    assert compared >= 2


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"end": (0, 0, 0, 0)}, "expected a motion"),
        ({"end": (2, 0, 0, 0)}, "expected the last pose at"),
        ({"end": (1, 0, 3, 0)}, "expected the last pose to head"),
        ({"end": (1, 0, 8, 0)}, "expected headings from 0 to 7, got 0 and 8"),
        ({"start": (-1, 0)}, "expected headings from 0 to 7, got -1"),
        ({"end": (1, 0, 0, 1)}, "expected articulations from 0 to 0"),
        ({"end": (1000, 0, 0, 0)}, "at most 200 cells away"),
        ({"multiplier": 0}, "multiplier"),
        ({"poses": np.full((3, 4), np.nan)}, "finite poses"),
        ({"poses": np.zeros((1, 4))}, "finite poses"),
    ],
)
def test_primitives_that_are_not_on_the_lattice_are_refused(change: dict[str, object], complaint: str) -> None:
    fine = {"start": (0, 0), "end": (1, 0, 0, 0), "poses": np.array([[0.0] * 4, [0.1, 0.0, 0.0, 0.0]]), "multiplier": 1}
    PrimitiveSet(0.1, 8, (0.0,), (Primitive(**fine),))  # type: ignore[arg-type]
    with pytest.raises(PlannerError, match=complaint):
        PrimitiveSet(0.1, 8, (0.0,), (Primitive(**(fine | change)),))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong", [{"resolution": 0.0}, {"headings": 0}, {"articulations": (0.1, 0.0)}, {"primitives": ()}]
)
def test_sets_that_make_no_sense_are_refused(wrong: dict[str, object]) -> None:
    fine = generate(GeneratorSettings(articulations=1))
    held = {"resolution": fine.resolution, "headings": 16, "articulations": (0.0,), "primitives": fine.primitives}
    with pytest.raises(PlannerError, match="primitives: expected"):
        PrimitiveSet(**(held | wrong))  # type: ignore[arg-type]
