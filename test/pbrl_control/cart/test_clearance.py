"""Clearance against shapely; a body's roll-out against integration; bodies in words."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from cart_cases import pr2_body
from shapely import Polygon, box

from pbrl_control.cart import CartBody, CartSight, choose_sight
from pbrl_control.cart.clearance_kernel import path_clearance, roll_out
from pbrl_control.errors import ControlError
from pbrl_control.planar import compose

RESOLUTION, LEFT, BOTTOM = 0.05, -2.0, -2.5


def clearance(body: CartBody, poses: np.ndarray, cells: np.ndarray, enough: float, closed: bool = False) -> tuple:
    found = np.empty(len(poses))
    grip = np.array(body.grip)
    first = path_clearance(
        poses, body.corners, body.on_cart, body.first, grip, 0.3, enough, cells, RESOLUTION, LEFT, BOTTOM, closed, found
    )
    return first, found


@pytest.mark.parametrize("share", [0.0003, 0.003])
def test_distances_are_shapelys(share: float, rng: np.random.Generator) -> None:
    body = pr2_body()
    cells = np.where(rng.random((100, 80)) < share, 254, rng.integers(0, 254, (100, 80))).astype(np.uint8)
    lethal = shapely.union_all(
        [
            box(LEFT + j * 0.05, BOTTOM + i * 0.05, LEFT + (j + 1) * 0.05, BOTTOM + (i + 1) * 0.05)
            for i, j in np.argwhere(cells == 254)
        ]
    )
    poses = np.column_stack((rng.uniform(-1, 1, (60, 2)), rng.uniform(-4, 4, 60), rng.uniform(-0.8, 0.8, 60)))
    touched = 0
    for pose in poses:
        outline = shapely.union_all([Polygon(ring) for ring in body.outlines(pose[:3], pose[3])])
        expected = min(outline.distance(lethal), 0.3)
        first, found = clearance(body, pose[None], cells, 0.0)
        assert found[0] == pytest.approx(expected, abs=1e-9)
        assert first == (0 if expected == 0.0 else 1)
        touched += expected == 0.0
    assert 0 < touched < 60


def test_blocks_larger_than_the_body_are_touched_from_within_and_measured_from_without(
    rng: np.random.Generator,
) -> None:
    body = pr2_body()
    cells = np.zeros((100, 80), dtype=np.uint8)
    cells[:90, 30:] = 254
    block = box(LEFT + 30 * 0.05, BOTTOM, LEFT + 80 * 0.05, BOTTOM + 90 * 0.05)
    for x in np.linspace(-3.0, 2.0, 40):
        pose = np.array([x, 0.0, *rng.uniform(-0.5, 0.5, 2)])
        outline = shapely.union_all([Polygon(ring) for ring in body.outlines(pose[:3], pose[3])])
        if outline.bounds[2] < LEFT + 80 * 0.05:
            found = clearance(body, pose[None], cells, 0.0)[1][0]
            assert found == pytest.approx(min(outline.distance(block), 0.3), abs=1e-9)


def test_it_ends_at_the_first_pose_that_is_too_near(rng: np.random.Generator) -> None:
    cells = np.zeros((100, 80), dtype=np.uint8)
    cells[:, 70] = 254
    poses = np.column_stack((np.linspace(-1, 0.5, 30), np.zeros((30, 3))))
    first, found = clearance(pr2_body(), poses, cells, 0.02)
    assert poses[first, 0] + 1.55 >= LEFT + 70 * 0.05 - 0.02 > poses[first - 1, 0] + 1.55
    assert (found[first + 1 :] == 0.3).all()


def test_unknown_cells_and_the_end_of_the_grid_count_only_where_closed() -> None:
    cells = np.full((100, 80), 255, dtype=np.uint8)
    cells[30:70, 10:70] = 0
    inside, outside = np.array([[-1.0, 0.0, 0.0, 0.0]]), np.array([[50.0, 0.0, 0.0, 0.0]])
    for poses in (inside, outside):
        assert clearance(pr2_body(), poses, cells, 0.0)[0] == 1
    assert clearance(pr2_body(), inside, cells, 0.0, True)[1][0] > 0.0
    assert clearance(pr2_body(), outside, cells, 0.0, True)[0] == 0


def test_a_roll_out_is_what_integration_gives(rng: np.random.Generator) -> None:
    braking = np.array([2.0, 1.5, 1.0])
    for _ in range(5):
        pose = rng.uniform(-1, 1, 4)
        rates = rng.uniform(-0.4, 0.4, 4)
        poses = np.empty((400, 4))
        count = roll_out(pose, rates, 0.1, braking, np.array([1.8, 1.0]), 1e-3, poses)
        here, dt = pose.copy(), 1e-3
        speed = math.hypot(rates[0], rates[1])
        ends = np.array([speed, abs(rates[2]), abs(rates[3])]) / braking
        for t in np.arange(0.0, 0.1 + ends.max(), dt):
            left = np.clip(1.0 - max(t - 0.1, 0.0) / ends, 0.0, 1.0)
            c, s = math.cos(here[2]), math.sin(here[2])
            vx, vy = left[0] * rates[:2]
            here += dt * np.array([c * vx - s * vy, s * vx + c * vy, left[1] * rates[2], left[2] * rates[3]])
        assert np.allclose(poses[count - 1], here, atol=2e-3)


def test_outlines_seen_are_those_of_the_state_where_the_cart_is_where_it_should_be(rng: np.random.Generator) -> None:
    body = pr2_body()
    base, angle = rng.uniform(-1, 1, 3), 0.4
    for one, other in zip(
        body.outlines(base, angle), body.seen_outlines(base, np.array([*body.grip, angle])), strict=True
    ):
        assert np.allclose(one, other)
    assert len(body.seen_outlines(base, None)) == 1
    moved = compose(base, np.array([0.2, 0.1, 0.0]))
    assert not np.allclose(body.seen_outlines(moved, None)[0], body.seen_outlines(base, None)[0])


def test_a_hollow_body_is_cut_into_convex_pieces() -> None:
    hollow = np.array([[0, 0], [1, 0], [1, 1], [0.5, 0.2], [0, 1.0]])
    body = CartBody(hollow, hollow, (2.0, 0.0))
    for on_cart in (0, 1):
        pieces = [
            Polygon(body.corners[a:b])
            for a, b in zip(body.first, body.first[1:], strict=False)
            if body.on_cart[a] == on_cart
        ]
        assert all(piece.equals(piece.convex_hull) for piece in pieces)
        assert shapely.union_all(pieces).symmetric_difference(Polygon(hollow)).area < 1e-9


def test_the_planners_body_is_taken_over_and_a_robot_alone_refused() -> None:
    mine = pr2_body()
    given = SimpleNamespace(
        robot=mine.robot, cart=mine.cart, grip=mine.grip, shoulders=mine.shoulders, hands=mine.hands
    )
    assert np.array_equal(CartBody.of(given).corners, mine.corners)
    given.cart = None
    with pytest.raises(ControlError, match="robot alone"):
        CartBody.of(given)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"robot": np.zeros((4, 2))}, "robot"),
        ({"cart": np.full((4, 2), np.nan)}, "cart"),
        ({"cart": 100.0 * np.array([[0, 0], [1, 0], [1, 1.0]])}, "within 20 m"),
        ({"grip": (np.nan, 0.0)}, "grip"),
        ({"hands": None}, "neither"),
        ({"hands": np.zeros((3, 2))}, "hands"),
    ],
)
def test_bodies_that_are_none_are_refused_in_words(changes: dict, words: str) -> None:
    mine = pr2_body()
    good = {"robot": mine.robot, "cart": mine.cart, "grip": mine.grip, "shoulders": mine.shoulders, "hands": mine.hands}
    with pytest.raises(ControlError, match=words):
        CartBody(**{**good, **changes})


def test_the_hands_are_believed_first_and_the_checkerboard_where_they_cannot_be() -> None:
    pose = np.array([0.66, 0.01, 0.3])
    board = CartSight(1.0, "checkerboard", pose)
    for hands in (
        CartSight(1.0, "hands", pose, 0.2),
        CartSight(0.1, "hands", pose, 0.0),
        CartSight(1.5, "hands", pose, 0.0),
        CartSight(1.0, "hands", np.array([np.nan, 0, 0]), 0.0),
        None,
    ):
        assert choose_sight(1.1, [hands, board], 0.3, 0.03) is board
    good = CartSight(1.0, "hands", pose, 0.001)
    assert choose_sight(1.1, [good, board], 0.3, 0.03) is good
    assert choose_sight(2.0, [good, board], 0.3, 0.03) is None
    assert good.articulation == pytest.approx(0.3)
    assert np.allclose(good.grip_offset((0.65, 0.0)), (0.01, 0.01))
