"""The controller's fence: what leads in is refused, what leads away is not, and who knows not where he is rests."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from pbrl_control.errors import ControlError
from pbrl_control.fence import Fence
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.percept import BodyShape, Grip, Percept, Tag, gripper_tag
from pbrl_control.planar import compose
from pbrl_control.settings import FenceSettings
from pbrl_control.types import BodyCommand

BASE = np.array([1.0, -2.0, 2.0])
AHEAD = compose(BASE, np.array([1.5, 0.0, 0.0]))[:2]  # the grippers reach about a metre ahead of the axle
ON, BACK, REST = BodyCommand(base_v=0.17), BodyCommand(base_v=-0.3), BodyCommand()


def square(middle: np.ndarray, half: float) -> tuple[tuple[float, float], ...]:
    x, y = middle
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))


def seen(kinematics: RobotKinematics, posture: Posture, base: np.ndarray = BASE, time: float = 0.0) -> Percept:
    """Return a percept in which the grippers' tags tell where the base is."""
    turn = np.array([0.0, 0.0, math.sin(base[2] / 2), math.cos(base[2] / 2)])
    tags = {}
    for side in SIDES:
        frame = kinematics.frame(posture, f"{side}_ft")
        place = compose(base, np.array([*frame.position[:2], 0.0]))
        q = frame.quaternion()
        vector = turn[3] * q[:3] + q[3] * turn[:3] + np.cross(turn[:3], q[:3])
        tags[gripper_tag(side)] = Tag(
            time, np.array([*place[:2], frame.position[2]]), np.array([*vector, turn[3] * q[3] - turn[:3] @ q[:3]])
        )
    return Percept(posture, tags)


def gap(kinematics: RobotKinematics, posture: Posture) -> float:
    """Return the least distance of a square ahead from which driving on is not refused [m, from the axle]."""
    percept = seen(kinematics, posture)
    for off in np.arange(0.6, 2.0, 0.01):
        place = square(compose(BASE, np.array([off + 0.1, 0.0, 0.0]))[:2], 0.02)
        if not Fence(kinematics.urdf, FenceSettings(keep_out=(place,))).fault(0.0, percept, ON):
            return float(off + 0.08)
    raise AssertionError("it is always refused")


def test_what_leads_in_is_refused_before_it_does(kinematics: RobotKinematics, push_posture: Posture) -> None:
    tip = max(kinematics.tip(push_posture, side)[0] for side in SIDES)
    settings = FenceSettings()
    assert tip < gap(kinematics, push_posture) < tip + 0.17 * settings.ahead + settings.clear + 0.06


def test_near_by_what_leads_away_is_done_and_rest_always_is(kinematics: RobotKinematics, push_posture: Posture) -> None:
    tip = max(kinematics.tip(push_posture, side)[0] for side in SIDES)
    place = square(compose(BASE, np.array([tip + 0.06, 0.0, 0.0]))[:2], 0.05)
    fence = Fence(kinematics.urdf, FenceSettings(keep_out=(place,)))
    percept = seen(kinematics, push_posture)
    assert "fence: expected to stay 0.02 m off, would come within" in fence.fault(0.0, percept, ON)
    assert fence.fault(0.01, percept, BACK) == ""
    assert fence.fault(0.02, percept, REST) == ""


def test_a_load_is_a_part_of_the_robot(kinematics: RobotKinematics, push_posture: Posture) -> None:
    percept = seen(kinematics, push_posture)
    outline = np.array([[0.0, -0.5], [1.5, -0.5], [1.5, 0.5], [0.0, 0.5]])
    thing = compose(BASE, np.array([0.8, 0.0, 0.0]))
    half = np.array([0.0, 0.0, math.sin(BASE[2] / 2), math.cos(BASE[2] / 2)])
    tags = {**percept.tags, "table": Tag(0.0, np.array([*thing[:2], 0.8]), half)}
    bodies = {"table": BodyShape(outline, 0.8)}
    far = square(compose(BASE, np.array([2.42, 0.0, 0.0]))[:2], 0.04)
    fence = Fence(kinematics.urdf, FenceSettings(keep_out=(far,)))
    free = replace(percept, tags=tags, bodies=bodies)
    held = replace(free, grips={"left": Grip("table", np.zeros(2))})
    assert fence.fault(0.0, free, ON) == ""
    assert fence.fault(0.01, held, ON).startswith("fence: ")
    assert fence.fault(0.02, held, BACK) == ""


def test_who_does_not_know_where_he_is_rests_if_there_is_anything_to_keep_out_of(
    kinematics: RobotKinematics, push_posture: Posture
) -> None:
    blind = Percept(push_posture)
    fence = Fence(kinematics.urdf, FenceSettings(keep_out=(square(AHEAD, 0.1),)))
    assert "expected to know where the base is" in fence.fault(0.0, blind, ON)
    assert Fence(kinematics.urdf, FenceSettings()).fault(0.0, blind, ON) == ""


def test_places_of_the_scene_may_be_grazed_as_they_are_told_wider(
    kinematics: RobotKinematics, push_posture: Posture
) -> None:
    fence = Fence(kinematics.urdf, FenceSettings(graze=0.05))
    middle = compose(BASE, np.array([1.02, 0.0, 0.0]))[:2]
    bodies = {name: BodyShape(np.array(square(middle, 0.3)), 3.0) for name in ("keep_out_0", "cupboard")}
    percept = seen(kinematics, push_posture)
    fence.told({"cupboard": bodies["cupboard"]}, {"cupboard": np.zeros(3)})
    assert not fence.stands, "what is built in is no place that is kept out of"
    fence.told(bodies, dict.fromkeys(bodies, np.zeros(3)))
    assert fence.stands and fence.fault(0.0, percept, ON).startswith("fence: ")


def test_a_clock_that_is_set_back_is_a_new_beginning(kinematics: RobotKinematics, push_posture: Posture) -> None:
    fence = Fence(kinematics.urdf, FenceSettings(keep_out=(square(AHEAD, 0.1),)))
    away = np.array([-5.0, 5.0, 0.0])
    fence.fault(100.0, seen(kinematics, push_posture, time=100.0), ON)
    assert fence.fault(1.0, seen(kinematics, push_posture, away, time=1.0), ON) == ""


@pytest.mark.parametrize("corners", [0, 1, 2])
def test_corners_that_make_no_polygon_are_refused_where_they_are_read(corners: int) -> None:
    with pytest.raises(ValidationError, match="keep_out"):
        FenceSettings(keep_out=(square(AHEAD, 0.1)[:corners],))


def test_a_polygon_that_is_none_is_refused(kinematics: RobotKinematics) -> None:
    crossed = ((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0))
    with pytest.raises(ControlError, match="does not cross itself"):
        Fence(kinematics.urdf, FenceSettings(keep_out=(crossed,)))
