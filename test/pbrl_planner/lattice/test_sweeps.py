"""What moves covers what shapely says; the compiled look-up says of each cell what the mask does; who is in what."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from lattice_cases import CELL, SMALL, cart_motions, random_grid

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import ArticulatedBody, CostGrid, Lattice, LatticeProblem
from pbrl_planner.lattice.body import FINE, convex_pieces, rectangle
from pbrl_planner.lattice.sweep_kernel import is_free
from pbrl_planner.lattice.sweeps import cut_up

ELL = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.0], [0.0, 0.0], [0.0, 0.3], [-0.3, 0.3]])


def swept_by_shapely(body: ArticulatedBody, poses: np.ndarray) -> shapely.Geometry:
    share = np.linspace(0.0, 1.0, 60)[:, None]
    fine = np.concatenate([a + (b - a) * share for a, b in pairwise(poses)])
    rings = [shapely.polygons(each) for each in body.outlines(fine).values()]
    return shapely.union_all([part for each in rings for part in each])


@pytest.mark.parametrize("body", [SMALL, ArticulatedBody(ELL), ArticulatedBody.pr2_with_cart()])
def test_a_sweep_is_what_shapely_says_and_hardly_more(body: ArticulatedBody) -> None:
    rng = np.random.default_rng(1)
    for _ in range(4):
        cell = 0.05
        ends = rng.uniform([-0.4, -0.4, -3.0, -0.7], [0.4, 0.4, 3.0, 0.7])
        poses = np.array([[0.0, 0.0, ends[2] - 0.5, 0.0], [*ends[:2], ends[2], ends[3]]])
        mask = body.mask(poses, cell)
        reach = len(mask) // 2
        y, x = np.nonzero(np.ones_like(mask))
        boxes = shapely.box(
            (x - reach - 0.5) * cell, (y - reach - 0.5) * cell, (x - reach + 0.5) * cell, (y - reach + 0.5) * cell
        )
        true = swept_by_shapely(body, poses)
        shapely.prepare(true)
        touched = shapely.intersects(true, boxes).reshape(mask.shape)
        assert not (touched & ~mask).any(), "nothing is left out"
        slack = true.buffer(FINE * cell)
        assert shapely.intersects(slack, boxes).reshape(mask.shape)[mask].all(), "nothing is far off"
        assert mask.sum() <= 1.1 * touched.sum() + 20


def test_pieces_put_together_are_the_mask_and_those_of_an_outline_the_outline() -> None:
    rng = np.random.default_rng(2)
    mask = rng.random((21, 21)) < 0.6
    again = np.zeros_like(mask)
    for row, column, level in cut_up(mask, 3, -2):
        begin = column + 3 + 10
        assert not (row - 2 + 10 < 0 or begin < 0)
        again[row - 2 + 10, begin : begin + (1 << level)] = True
    assert (again == mask).all()
    pieces = [shapely.Polygon(ELL[piece]) for piece in convex_pieces(ELL)]
    assert shapely.union_all(pieces).symmetric_difference(shapely.Polygon(ELL)).area < 1e-12
    assert all(piece.convex_hull.area == pytest.approx(piece.area) for piece in pieces)
    assert len(convex_pieces(rectangle(-1.0, 2.0, 0.3))) == 1


def test_the_look_up_says_of_every_cell_what_the_mask_does() -> None:
    rng = np.random.default_rng(3)
    lattice = Lattice(random_grid(rng, 20, 90, 0.02), cart_motions())
    masks, grid = lattice.motions.masks, lattice.grid
    rows, columns = grid.cells.shape
    taken = np.pad(grid.cells >= grid.lethal, 40, constant_values=True)
    for direction in ("forward", "backward"):
        tables, sweeps = lattice.tables(direction), lattice.sweeps(direction)
        for m in rng.integers(0, len(tables.step), 12):
            each = lattice.primitives.primitives[tables.primitive[m]]
            mask = masks[tables.primitive[m]]
            dx, dy = each.end[:2] if direction == "backward" else (0, 0)
            covered = np.argwhere(mask) - len(mask) // 2 - [dy, dx] + 40
            for y in range(rows):
                for x in range(columns):
                    cell = (y + lattice.border) * lattice.stride + x + lattice.border
                    found = is_free(cell, m, lattice.stride, sweeps)
                    assert found == (not taken[covered[:, 0] + y, covered[:, 1] + x].any())


def lattice_with(x: float, y: float) -> Lattice:
    """Return a floor of 4 m by 4 m with one occupied cell."""
    cells = np.zeros((40, 40), dtype=np.uint8)
    cells[int(y / CELL), int(x / CELL)] = 254
    return Lattice(CostGrid(cells, CELL), cart_motions())


@pytest.mark.parametrize(
    ("pose", "who"),
    [
        ((2.05, 2.05, 0.0, 0.0), "the robot's centre would be in an obstacle"),
        ((1.95, 1.95, 0.0, 0.0), "the robot would be in an obstacle at"),
        ((1.55, 2.05, 0.0, 0.0), "the cart would be in an obstacle at"),
        ((2.05, 1.55, math.pi / 2, 0.0), "the cart would be in an obstacle at"),
        ((0.05, 2.05, 0.0, 0.0), "the robot would reach out of the map"),
        ((3.55, 2.05, 0.0, 0.0), "the cart would reach out of the map"),
        ((-0.05, 2.05, 0.0, 0.0), "is not on the map of 4 x 4 m"),
        ((1.0, 4.05, 0.0, 0.0), "is not on the map of 4 x 4 m"),
    ],
)
def test_who_is_in_what_is_said_of_start_and_goal(pose: tuple[float, ...], who: str) -> None:
    lattice = lattice_with(2.05, 2.05)
    fine = (1.05, 1.05, 0.0, 0.0)
    LatticeProblem(lattice, fine, fine)
    for name, start, goal in (("start", pose, fine), ("goal", fine, pose)):
        with pytest.raises(PlannerError, match=f"^{name}: .*{who}"):
            LatticeProblem(lattice, start, goal)


def test_the_arms_count() -> None:
    body = ArticulatedBody.pr2_with_cart()
    between = shapely.Point(0.45, 0.2)
    assert shapely.Polygon(body.outlines(np.zeros((1, 4)))["arms"][0]).contains(between)
    without = ArticulatedBody(body.robot, body.cart, body.grip)
    assert without.area(np.zeros((1, 4))) < body.area(np.zeros((1, 4)))


@pytest.mark.parametrize("pose", [(1.0, 1.0), (1.0, 1.0, math.nan, 0.0), (1.0, 1.0, 0.0, 1.3)])
def test_poses_that_make_no_sense_are_refused(pose: tuple[float, ...]) -> None:
    with pytest.raises(PlannerError, match="start: expected"):
        LatticeProblem(lattice_with(3.0, 3.0), pose, (1.0, 1.0, 0.0, 0.0))


def test_bodies_and_primitives_have_to_go_together() -> None:
    with pytest.raises(PlannerError, match="expected one with a cart"):
        type(cart_motions())(cart_motions().primitives, body=ArticulatedBody(ELL))
    with pytest.raises(PlannerError, match="resampled"):
        Lattice(CostGrid(np.zeros((5, 5), dtype=np.uint8), 0.05), cart_motions())
    with pytest.raises(PlannerError, match="outline of 'the cart'"):
        ArticulatedBody(ELL, np.zeros((4, 2)))
    with pytest.raises(PlannerError, match="within 20 m"):
        ArticulatedBody(100.0 * ELL)
