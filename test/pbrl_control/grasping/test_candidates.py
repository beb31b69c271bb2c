"""Grasps that the robot can drive to; and the whole way from 1.5 m off to before the edge."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_cases import ROOM, TABLE, Unicycle, base_pose_off_the_table, box, table_room
from shapely import LinearRing, Point, Polygon

from pbrl_control.errors import ControlError
from pbrl_control.grasping import GraspCandidate, GraspModel, GraspSearch, GraspSettings, sample_grasps
from pbrl_control.grasping.contacts import face_point, place_plates
from pbrl_control.kinematics import Posture, RobotKinematics
from pbrl_control.navigation import KRANG_STOWED, FloorMap, MotionChecker, PathTracker, TrackStatus
from pbrl_control.percept import BodyShape
from pbrl_control.planar import compose, inverse
from pbrl_control.settings import BaseSettings, ControllerSettings

SETTINGS = GraspSettings()
FREE = GraspModel("unconstrained")
BASE = np.array([-2.0, 0.5, 0.4])
POSE = np.array([0.2, -0.1, 0.3])


def search(model: GraspModel = FREE, seed: int = 3, **more) -> GraspSearch:
    floor = more.pop("floor", None) or table_room(POSE)
    shape = more.pop("shape", TABLE)
    return sample_grasps(
        "table", shape, POSE, model, more.pop("base", BASE), floor, np.random.default_rng(seed), **more
    )


def plates(candidate: GraspCandidate, side: str, base: np.ndarray) -> np.ndarray:
    """Return the pose (3,) in the object's frame of plates at their home, base at (3,) in `world`."""
    x, y, _ = SETTINGS.home
    y = y if len(candidate.sides) == 1 else abs(np.subtract(*candidate.contacts.values())).max() / 2.0
    lateral = y if side == "left" else -y
    return compose(inverse(POSE), compose(base, np.array([x, lateral, 0.0])))


def test_homes_agree_with_the_controller() -> None:
    assert SETTINGS.home == ControllerSettings().home


@pytest.mark.parametrize("hands", [("left",), ("right",)])
def test_one_gripper_at_home_is_past_the_edge_at_the_grasp_and_before_it_at_the_goal(hands) -> None:
    for candidate in search(hands=[hands]).candidates:
        (side,) = hands
        closed = plates(candidate, side, candidate.base_grasp)
        contact = candidate.contacts[side]
        assert np.hypot(*(closed[:2] - contact)) == pytest.approx(SETTINGS.depth)
        assert Polygon(TABLE.footprint).contains(Point(closed[:2]))
        before = plates(candidate, side, candidate.base_goal)
        assert np.hypot(*(before[:2] - contact)) == pytest.approx(SETTINGS.standoff)
        assert not Polygon(TABLE.footprint).intersects(Point(before[:2]))
        assert LinearRing(TABLE.footprint).distance(Point(contact)) < 1e-9


def test_two_grippers_share_a_face_as_far_apart_as_arms_reach() -> None:
    both = search(hands=[("left", "right")], settings=GraspSettings(samples=24, wanted=12)).candidates
    assert both
    for candidate in both:
        left, right = candidate.contacts["left"], candidate.contacts["right"]
        apart = float(np.hypot(*(left - right)))
        assert 2.0 * SETTINGS.lateral[0] <= apart <= 2.0 * SETTINGS.lateral[1]
        for side, contact in candidate.contacts.items():
            closed = compose(inverse(POSE), candidate.base_grasp)
            local = compose(inverse(closed), np.array([*contact, 0.0]))
            assert local[0] == pytest.approx(SETTINGS.home[0] - SETTINGS.depth)
            assert local[1] == pytest.approx(apart / 2.0 if side == "left" else -apart / 2.0)


def test_plates_never_hang_over_a_corner(rng: np.random.Generator) -> None:
    corners = TABLE.footprint
    for _ in range(300):
        point = np.array(LinearRing(corners).interpolate(rng.uniform(), normalized=True).coords[0])
        for hands in (("left", "right"), ("left",), ("right",)):
            reach = place_plates(face_point(corners, point), hands, SETTINGS)
            if not isinstance(reach, str):
                for contact in reach.contacts.values():
                    gap = np.hypot(*(corners - contact).T).min()
                    assert gap >= SETTINGS.plate_width / 2.0 + SETTINGS.corner_margin - 1e-9


def test_two_faces_on_one_line_are_two_faces() -> None:
    u_shape = np.array([[0, 0], [3, 0], [3, 1], [2, 1], [2, 0.5], [1, 0.5], [1, 1], [0, 1.0]])
    face = face_point(u_shape, np.array([0.4, 1.0]))
    assert face.left + face.right == pytest.approx(1.0)
    assert (face.left, face.right) == pytest.approx((0.6, 0.4))  # seen from outside, facing in


def test_the_lateral_and_height_ranges_are_within_the_arms_reach(kinematics: RobotKinematics) -> None:
    """Newton's method brings the plates there, level, far from singularities and stops."""
    controller = ControllerSettings()
    limits = kinematics.limits("left")
    for lateral in SETTINGS.lateral:
        for height in SETTINGS.heights:
            joints = np.array(controller.nominal)
            for _ in range(200):
                gripper = kinematics.grippers(Posture(2.732, 0.0, joints, -joints))["left"]
                tilt = np.cross(gripper.pose.rotation[:, 2], [0.0, 0.0, 1.0])
                away = np.array([SETTINGS.home[0], lateral]) - gripper.planar[:2]
                error = np.array([*away, height - gripper.height, *tilt[:2], -gripper.planar[2]])
                joints = joints + np.clip(np.linalg.pinv(gripper.jacobian) @ error, -0.1, 0.1)
            assert np.abs(error).max() < 1e-6
            assert np.linalg.svd(gripper.jacobian, compute_uv=False)[-1] > 0.1
            assert (joints > limits.lower + 0.03).all()
            assert (joints < limits.upper - 0.03).all()


def test_candidates_come_shortest_first_stand_free_and_say_why_the_others_do_not() -> None:
    obstacles = {"table": TABLE.footprint + POSE[:2], "shelf": box(0.9, -3.0, 1.4, 3.0)}
    floor = FloorMap.of(ROOM, obstacles)
    found = sample_grasps("table", TABLE, np.array([*POSE[:2], 0.0]), FREE, BASE, floor, np.random.default_rng(1))
    lengths = [candidate.path_length for candidate in found.candidates]
    assert lengths == sorted(lengths)
    checker = MotionChecker(floor, KRANG_STOWED, SETTINGS.clearance)
    for candidate in found.candidates:
        assert checker.pose_fault(candidate.base_goal) == ""
        assert checker.pose_fault(candidate.base_grasp) == ""
        np.testing.assert_array_equal(candidate.path.goal, candidate.base_goal)
    assert any("'shelf'" in rejection.reason for rejection in found.rejected)
    assert all(rejection.reason and "\n" not in rejection.reason for rejection in found.rejected)
    assert len(found.candidates) + len(found.rejected) == 3 * SETTINGS.samples


def test_every_candidate_is_allowed_by_its_model() -> None:
    anisotropic = search(GraspModel("anisotropic", free_axis=0.0)).candidates
    assert anisotropic
    assert all(abs(abs(c[0]) - 0.375) < 1e-9 for g in anisotropic for c in g.contacts.values())
    anchor = np.array([0.3, 0.65])
    fixed = search(GraspModel("fixed-point", anchor=anchor)).candidates
    assert fixed
    assert all(c[1] < -0.1 for g in fixed for c in g.contacts.values())


def test_the_same_seed_gives_the_same_candidates() -> None:
    first, again = (
        [(g.sides, g.base_goal.tobytes(), g.path.poses().tobytes()) for g in search(seed=5).candidates]
        for _ in range(2)
    )
    assert first
    assert first == again


def test_a_clockwise_outline_is_the_same_object() -> None:
    goals = [
        [tuple(np.round(g.base_goal, 9)) for g in search(shape=BodyShape(outline, 0.7775)).candidates]
        for outline in (TABLE.footprint, TABLE.footprint[::-1])
    ]
    assert goals[0] == goals[1]


def test_a_candidate_becomes_a_push_plans_grips() -> None:
    candidate = search(hands=[("left", "right")]).candidates[0]
    grips = candidate.grips()
    assert [grip.gripper for grip in grips] == ["left", "right"]
    np.testing.assert_allclose(grips[0].point, candidate.contacts["left"])


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"model": GraspModel("static")}, "static"),
        ({"shape": BodyShape(TABLE.footprint, 0.4)}, "above the floor, is at 0.388 m"),
        ({"settings": GraspSettings(edge_thickness=0.055)}, "0.049 m thick"),
        ({"shape": BodyShape(0.05 * TABLE.footprint, 0.7775)}, "of face on either side of the plates"),
        ({"base": np.array([0.2, 0.0, 0.0])}, "start: the robot would be in 'table'"),
        ({"floor": FloorMap.of(1.1 * TABLE.footprint, {"table": TABLE.footprint})}, "walls"),
    ],
)
def test_where_nothing_can_be_grasped_it_says_why(more: dict, why: str) -> None:
    found = search(**more)
    assert not found.candidates
    assert why in found.why()
    assert "\n" not in found.why()


def test_a_robot_that_finds_no_way_gives_up_after_some_dead_ends() -> None:
    walls = {"low": box(-1.5, -3.0, -1.3, -0.485), "high": box(-1.5, 0.485, -1.3, 3.0)}
    floor = FloorMap.of(ROOM, {"table": box(0.6, -0.75, 1.35, 0.75), **walls})
    pose, settings = np.array([0.975, 0.0, 0.0]), GraspSettings(dead_ends=2)
    found = sample_grasps(
        "table", TABLE, pose, FREE, np.array([-2.2, 0.3, 0.0]), floor, np.random.default_rng(1), settings=settings
    )
    assert not found.candidates
    reasons = [rejection.reason for rejection in found.rejected]
    assert sum("no path found" in reason for reason in reasons) == 2
    assert "way: not looked for after 2 dead ends" in reasons


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        ({"floor": FloorMap.of(ROOM, {})}, "expected it on the map"),
        ({"base": np.array([0.0, np.nan, 0.0])}, "pose of the base: expected a finite pose"),
        ({"hands": [("middle",)]}, "expected hands out of"),
    ],
)
def test_what_cannot_be_meant_raises(more: dict, complaint: str) -> None:
    floor = more.pop("floor", None) or table_room(POSE)
    with pytest.raises(ControlError, match=complaint):
        sample_grasps("table", TABLE, POSE, FREE, more.pop("base", BASE), floor, np.random.default_rng(1), **more)


def test_from_forty_poses_a_base_arrives_before_the_table_or_says_why() -> None:
    failures = []
    for draw in range(40):
        rng = np.random.default_rng(draw)
        pose = rng.uniform([-0.3, -0.3, -math.pi], [0.3, 0.3, math.pi])
        floor = table_room(pose)
        base = Unicycle(base_pose_off_the_table(floor, 1.5, rng))
        found = sample_grasps("table", TABLE, pose, FREE, base.pose, floor, rng)
        if not found.candidates:
            assert found.why()
            failures.append(found.why())
            continue
        path = found.candidates[0].path
        end = base.follow(PathTracker(path, BaseSettings(), checker=MotionChecker(floor, KRANG_STOWED)))
        position, yaw = base.error(path)
        if end.status is TrackStatus.ARRIVED:
            assert position <= 0.02
            assert yaw <= math.radians(1.0)
        else:
            assert end.reason
            failures.append(end.reason)
        assert all(floor.free.covers(Polygon(KRANG_STOWED.at(here))) for _, here, _ in base.trace[::5])
    assert len(failures) <= 2, failures
