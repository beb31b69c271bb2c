"""Map, footprint and the motions they leave free."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from floor_cases import ROOM, TABLE, box, table_room
from shapely import MultiPoint, Point, Polygon

from pbrl_control.errors import ControlError
from pbrl_control.navigation import KRANG_STOWED, FloorMap, Footprint, MotionChecker, reaching_arms
from pbrl_control.settings import ControllerSettings


def collision_corners(urdf: Path, arms: np.ndarray) -> np.ndarray:
    """Return the corners (n, 3) in `base` of every collision shape, arms at (7,) and mirrored, waist at 2.73."""
    model = pin.buildModelFromUrdf(str(urdf))
    geometry = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION)
    q = pin.neutral(model)
    angles = {"waist": 2.732} | {f"{s}J{i + 1}": v * a for s, v in (("L", 1), ("R", -1)) for i, a in enumerate(arms)}
    for name, angle in angles.items():
        q[model.joints[model.getJointId(name)].idx_q] = angle
    placed = geometry.createData()
    pin.updateGeometryPlacements(model, model.createData(), geometry, placed, q)
    corners = []
    for shape, pose in zip(geometry.geometryObjects, placed.oMg, strict=True):
        shape.geometry.computeLocalAABB()
        low, high = shape.geometry.aabb_local.min_, shape.geometry.aabb_local.max_
        grid = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        corners.append(grid @ pose.rotation.T + pose.translation)
    return np.vstack(corners)


def test_the_footprint_covers_the_description_with_arms_stowed(root: Path) -> None:
    corners = collision_corners(root / "urdf/krang/krang.urdf", np.array(ControllerSettings().stowed))
    seen = MultiPoint(corners[:, :2]).convex_hull
    footprint = Polygon(KRANG_STOWED.outline)
    assert footprint.buffer(2e-3).covers(seen)
    assert footprint.area < 1.1 * seen.area, "no roomier than the robot"


def test_body_and_lowered_arms_cover_the_description_with_grippers_at_home(root: Path) -> None:
    settings = ControllerSettings()
    corners = collision_corners(root / "urdf/krang/krang.urdf", np.array(settings.nominal))
    seen = MultiPoint(corners[:, :2]).convex_hull
    body = Polygon(KRANG_STOWED.outline).union(Polygon(reaching_arms(settings.home[1]).outline))
    assert body.convex_hull.buffer(5e-3).covers(seen)


@pytest.mark.parametrize(
    "footprint", [KRANG_STOWED, Footprint.circle(0.4), Footprint.polygon(box(-0.3, -0.2, 0.5, 0.2))]
)
def test_a_footprint_turns_within_its_radius_and_is_swept_without_gaps(
    footprint: Footprint, rng: np.random.Generator
) -> None:
    for _ in range(20):
        start, end, heading = rng.uniform(-2, 2, 2), rng.uniform(-2, 2, 2), rng.uniform(-4, 4)
        swept = footprint.swept(start, end, heading).buffer(1e-9)
        for share in np.linspace(0.0, 1.0, 5):
            placed = Polygon(footprint.at(np.array([*(start + share * (end - start)), heading])))
            assert swept.covers(placed)
            assert Point(start + share * (end - start)).buffer(1.01 * footprint.radius, 64).covers(placed)


def test_a_pose_is_free_exactly_where_the_placed_outline_keeps_the_margin(rng: np.random.Generator) -> None:
    floor = table_room(np.array([0.3, 0.2, 0.5]))
    checker = MotionChecker(floor, KRANG_STOWED, 0.05)
    walls, table = Polygon(ROOM).exterior, floor.obstacles["table"]
    for _ in range(300):
        pose = rng.uniform([-3, -3, -3], [3, 3, 3])
        placed = Polygon(KRANG_STOWED.at(pose))
        gap = min(placed.distance(table), placed.distance(walls)) if Polygon(ROOM).covers(placed) else 0.0
        if abs(gap - 0.05) > 1e-3:
            assert (checker.pose_fault(pose) == "") == (gap > 0.05)


def test_a_place_to_turn_is_free_at_every_heading(rng: np.random.Generator) -> None:
    checker = MotionChecker(table_room(np.array([0.3, 0.2, 0.5])), KRANG_STOWED)
    for x, y in rng.uniform(-3, 3, (200, 2)):
        if checker.can_turn(x, y):
            assert all(checker.pose_fault(np.array([x, y, theta])) == "" for theta in np.linspace(-3, 3, 9))
            assert checker.can_swing(np.array([x, y]), 0.0, 3.0)


def test_a_swing_knows_which_side_is_free() -> None:
    floor = FloorMap.of(box(-2, -2, 2, 2), {"post": box(-0.45, 0.4, -0.35, 0.5)})  # behind, on the left
    checker = MotionChecker(floor, KRANG_STOWED)
    assert not checker.can_turn(0.0, 0.0)
    assert checker.can_swing(np.zeros(2), 0.0, 0.5)  # the rear goes to the right
    assert not checker.can_swing(np.zeros(2), 0.0, -0.5)


@pytest.mark.parametrize(
    ("pose", "reason"),
    [((0.0, 0.0, 0.0), "'table'"), ((2.7, 0.0, 0.0), "walls"), ((9.0, 0.0, 0.0), "outside the map")],
)
def test_a_fault_names_what_is_in_the_way(pose: tuple, reason: str) -> None:
    assert reason in MotionChecker(table_room(np.zeros(3)), KRANG_STOWED).pose_fault(np.array(pose))


def test_a_held_body_can_be_left_out_and_a_floor_needs_no_walls() -> None:
    poses = {"table": np.array([1.0, 2.0, math.pi / 2])}
    floor = FloorMap.of_scene(None, {"table": TABLE}, poses)
    np.testing.assert_allclose(floor.obstacles["table"].bounds, [0.25, 1.625, 1.75, 2.375], atol=1e-12)
    assert floor.room.area > 100.0
    assert not FloorMap.of_scene(None, {"table": TABLE}, poses, leave_out="table").obstacles


@pytest.mark.parametrize(
    "make",
    [
        lambda: FloorMap.of(np.zeros((2, 2)), {}),
        lambda: FloorMap.of(None, {"t": np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]])}),
        lambda: FloorMap.of(None, {"t": np.full((4, 2), np.nan)}),
        lambda: FloorMap.of_scene(None, {"t": TABLE}, {}),
        lambda: FloorMap.of_scene(None, {"t": TABLE}, {"t": np.array([0, 0, np.inf])}),
        lambda: Footprint.circle(0.0),
        lambda: Footprint.circle(math.nan),
        lambda: Footprint.polygon(np.zeros((3, 2))),
        lambda: Footprint.polygon(np.zeros((3, 3))),
    ],
)
def test_what_is_no_floor_and_no_footprint_is_refused_in_one_line(make) -> None:
    with pytest.raises(ControlError, match="expected") as caught:
        make()
    assert "\n" not in str(caught.value)
