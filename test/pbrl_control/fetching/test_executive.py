"""Fetching in a room without physics: the way it goes, and each way in which it goes wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from room_of_fakes import NOMINAL, SETTINGS, STOWED, TABLE, World, fetching, plan_for
from shapely import Point

from pbrl_control.course import CourseStep
from pbrl_control.errors import ControlError
from pbrl_control.fetching import FetchExecutive, GivenGrips
from pbrl_control.kinematics import Posture, RobotKinematics
from pbrl_control.loop import ControlLoop
from pbrl_control.navigation import Struck
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.push import GripperAnswer, Phase
from pbrl_control.settings import ControllerSettings
from pbrl_control.types import PlanarTwist

AWAY = np.array([-1.9, 0.3, 2.0])


@pytest.fixture
def world(kinematics: RobotKinematics) -> World:
    return World(kinematics, AWAY.copy(), joints=STOWED.copy())


def without(*names: str) -> Callable[[World, Percept], Percept]:
    return lambda _, percept: replace(percept, tags={k: v for k, v in percept.tags.items() if k not in names})


def freeze(world: World, *names: str) -> None:
    """Show these tags as they are now for ever."""
    old = {name: world.percept().tags[name] for name in names}
    world.tamper = lambda _, percept: replace(percept, tags={**percept.tags, **old})


def on_the_way(act: Callable[[World], None]) -> Callable[[World], None]:
    """Return what acts once, a second into the drive."""
    since: list[float] = []

    def happens(world: World) -> None:
        if world.phases[-1] == Phase.DRIVE and not since:
            since.append(world.time)
        if since and world.time > since[0] + 1.0:
            act(world)
            world.happens = lambda world: None

    return happens


def test_it_drives_grasps_tests_the_grip_and_lets_go(world: World) -> None:
    world.joints = NOMINAL.copy()
    fetch = fetching(world.kinematics)
    command = world.run(fetch)
    assert command.phase == Phase.DONE, command.status
    assert world.phases == [
        *("locate", "stow", "locate", "drive", "approach", "grasp", "settle", "push", "release", "retreat", "done")
    ]
    assert fetch.confirmed
    assert all(reading.force > 2.0 for reading in fetch.readings.values())
    assert np.hypot(*world.table[:2]) < 1e-3, "pulled slightly, and put back"


def test_one_hand_will_do(world: World) -> None:
    fetch = fetching(world.kinematics, "right")
    assert world.run(fetch).phase == Phase.DONE
    assert set(fetch.readings) == {"right"}


def test_the_grips_of_a_plan_are_those_that_close(world: World) -> None:
    plan = plan_for("left", "right")
    fetch = fetching(world.kinematics, choice=GivenGrips(plan))
    held: dict[str, Grip] = {}
    world.happens = lambda world: held.update(world.grips)
    assert world.run(fetch).phase == Phase.DONE
    assert {grip.gripper: grip.point for grip in plan.grips} == {
        side: pytest.approx((grip.contact - [0.02, 0.0]).tolist(), abs=0.03) for side, grip in held.items()
    }


def test_the_course_begins_when_the_grip_is_sure(world: World) -> None:
    class Onwards:
        began = False

        def step(self, *_: object) -> CourseStep:
            self.began = True
            assert fetch.confirmed
            return CourseStep(PlanarTwist(0.1), "onwards", finished=world.table[0] > 0.3)

    course = Onwards()
    fetch = fetching(world.kinematics, course=course)
    assert world.run(fetch).phase == Phase.DONE
    assert course.began
    assert world.table[0] > 0.29


def test_arms_among_furniture_are_drawn_out_before_they_are_stowed(world: World) -> None:
    world.base, world.joints = np.array([-1.1, 0.0, 0.0]), NOMINAL.copy()
    assert world.run(fetching(world.kinematics)).phase == Phase.DONE
    assert world.phases[:4] == ["locate", "retreat", "locate", "stow"]


MISSING = {
    "joint positions": lambda world: setattr(world, "tamper", lambda _, percept: replace(percept, posture=None)),
    "body 'table' in the scene": lambda world: setattr(world, "bodies", {}),
    "tag 'table'": lambda world: setattr(world, "tamper", without("table")),
    "gripper tags": lambda world: setattr(world, "tamper", without("left_gripper", "right_gripper")),
    "odometry": lambda world: setattr(world, "odometry", False),
    "tag 'chair'": lambda world: world.bodies.update(chair=BodyShape(TABLE.footprint / 2, 0.5)),
}


@pytest.mark.parametrize("what", MISSING)
def test_what_is_not_seen_is_named(world: World, what: str) -> None:
    MISSING[what](world)
    command = world.run(fetching(world.kinematics), until=8.0)
    assert command.phase == Phase.FAILED
    assert what in command.status
    assert "is its source running?" in command.status


LOST = {
    "gripper tags: expected": lambda world: freeze(world, "left_gripper", "right_gripper"),
    "see tag 'table'": lambda world: freeze(world, "table"),
    "odometry: expected": lambda world: setattr(world, "odometry", False),
}


@pytest.mark.parametrize("what", LOST)
def test_what_is_lost_on_the_way_stops_it_and_is_named(world: World, what: str) -> None:
    world.happens = on_the_way(LOST[what])
    command = world.run(fetching(world.kinematics))
    assert command.phase == Phase.FAILED
    assert what in command.status
    before = world.base.copy()
    assert not any(twist.moves() for twist in command.twists.values())
    assert np.array_equal(before, world.base)


def test_a_tag_that_comes_back_lets_it_go_on(world: World) -> None:
    def hide(world: World) -> None:
        back = world.time + 3.0
        freeze(world, "table")
        frozen = world.tamper
        world.tamper = lambda it, percept: frozen(it, percept) if it.time < back else percept

    world.happens = on_the_way(hide)
    assert world.run(fetching(world.kinematics)).phase == Phase.DONE
    assert world.phases.count("drive") == 1


def test_an_object_that_moves_is_driven_to_anew(world: World) -> None:
    world.happens = on_the_way(lambda world: world.table.__setitem__(slice(None), [0.3, -0.4, 0.5]))
    fetch = fetching(world.kinematics)
    assert world.run(fetch).phase == Phase.DONE
    assert "it moved by" in fetch.troubles[0]


def test_an_object_that_will_not_stay_is_given_up(world: World) -> None:
    def flee(world: World) -> None:
        if world.phases[-1] == Phase.APPROACH:
            world.table[1] += 0.005

    world.happens = flee
    command = world.run(fetching(world.kinematics))
    assert command.phase == Phase.FAILED
    assert "expected it to stay where the way leads, it moved by 0.1" in command.status
    assert "gave up after 3 attempts" in command.status


def test_a_refused_grasp_is_tried_elsewhere_before_it_is_given_up(world: World) -> None:
    world.refuses = "the plates do not move"
    fetch = fetching(world.kinematics)
    stands = []
    world.happens = lambda world: stands.append(fetch.candidate) if world.phases[-1] == Phase.GRASP else None
    command = world.run(fetch)
    assert command.phase == Phase.FAILED
    assert "the plates do not move" in command.status
    assert len({id(candidate) for candidate in stands}) == 3


def test_hands_that_hold_nothing_are_found_out(world: World) -> None:
    world.grips_hold = False
    fetch = fetching(world.kinematics)
    command = world.run(fetch)
    assert command.phase == Phase.FAILED
    assert "it holds nothing" in command.status
    assert not fetch.confirmed
    assert not world.grips, "opened again"


def test_hands_that_slip_are_found_out(world: World) -> None:
    world.slips = 1.0
    command = world.run(fetching(world.kinematics))
    assert command.phase == Phase.FAILED
    assert "they slip" in command.status


def test_a_grip_that_slips_later_ends_the_course(world: World) -> None:
    class Onwards:
        def step(self, *_: object) -> CourseStep:
            world.slips = 0.5
            return CourseStep(PlanarTwist(0.1), "onwards")

    command = world.run(fetching(world.kinematics, course=Onwards()))
    assert command.phase == Phase.FAILED
    assert "it slips; go slower" in command.status
    assert world.phases.count("push") == 1, "what was moved is not tried again"


def test_closed_hands_are_not_driven_about(world: World) -> None:
    world.grips = {"left": Grip("table", np.zeros(2))}
    assert "left holds 'table'; release first" in world.run(fetching(world.kinematics)).status


def test_a_waist_of_which_no_footprint_is_known_is_refused(world: World) -> None:
    world.waist = 2.4
    assert "waist: expected within 0.1 rad of 2.732" in world.run(fetching(world.kinematics)).status


def test_an_object_behind_a_wall_is_said_to_be(world: World) -> None:
    world.base = np.array([-2.3, 0.3, 2.0])
    world.bodies["wall"] = BodyShape(np.array([[-0.05, -2.9], [0.05, -2.9], [0.05, 2.9], [-0.05, 2.9]]), 2.0)
    world.fixed["wall"] = np.array([-1.4, 0.0, 0.0])
    command = world.run(fetching(world.kinematics))
    assert command.phase == Phase.FAILED
    assert "every gap between start and goal is narrower than the robot" in command.status
    assert "move what is in the way" in command.status


def test_a_table_too_high_is_said_to_be(world: World) -> None:
    world.bodies = {"table": BodyShape(TABLE.footprint, 1.1)}
    assert "0.6 to 0.92 m above the floor" in world.run(fetching(world.kinematics)).status


def test_arms_that_do_not_stow_are_said_to(world: World) -> None:
    world.joints, world.arms_move = NOMINAL.copy(), False
    command = world.run(fetching(world.kinematics))
    assert command.status.startswith("stow: expected the arms within")
    assert "LJ1" in command.status


def test_a_base_that_is_stuck_is_said_to_be(world: World) -> None:
    world.base_moves = False
    command = world.run(fetching(world.kinematics))
    assert "expected to move as commanded, has stood" in command.status
    assert "gave up after 3 attempts" in command.status


def test_what_nobody_sees_is_gone_round_once_it_was_struck(world: World) -> None:
    free = world.kinematics, AWAY.copy()
    plain = fetching(world.kinematics)
    World(*free, joints=STOWED.copy()).run(plain)
    assert plain.candidate is not None
    leg = max(plain.candidate.path.legs, key=lambda leg: leg.length)
    ahead = (leg.end - leg.start) / leg.length
    world.unseen = Point(leg.start + 0.8 * ahead).buffer(0.05)  # beyond what the robot covers while it turns
    struck = Struck()
    fetch = fetching(world.kinematics, struck=struck)
    command = world.run(fetch)
    assert command.phase == Phase.DONE, command.status
    assert "it is remembered as 'something unseen 1'" in fetch.troubles[0]
    assert struck.outlines["something unseen 1"].distance(world.unseen) < 0.2


BROKEN = ("tag", "posture", "odometry", "wrench", "scene")


@pytest.mark.parametrize("what", BROKEN)
@pytest.mark.parametrize("phase", [Phase.LOCATE, Phase.DRIVE, Phase.APPROACH, Phase.PUSH])
def test_numbers_that_are_none_never_move_it_nor_raise(world: World, what: str, phase: Phase) -> None:
    nan = np.full(3, np.nan)

    def tamper(_: World, percept: Percept) -> Percept:
        if phase not in world.phases:
            return percept
        if what == "tag":
            return replace(
                percept, tags={name: Tag(tag.time, nan, tag.quaternion) for name, tag in percept.tags.items()}
            )
        if what == "posture":
            return replace(percept, posture=Posture(np.nan, 0.0, np.full(7, np.nan), np.full(7, np.inf)))
        if what == "wrench":
            return replace(percept, wrenches={side: np.full(6, np.nan) for side in percept.wrenches})
        if what == "scene":
            return replace(percept, bodies={"table": BodyShape(np.full((4, 2), np.nan), 0.7775)})
        return percept

    world.tamper = tamper
    fetch = fetching(world.kinematics)
    if what == "odometry":
        take, fetch.odometry = fetch.odometry, lambda time, pose: take(time, pose if phase not in world.phases else nan)
    command = world.run(fetch)
    assert command.finished
    for twist in world.last.twists.values():
        assert twist.finite()
    if command.phase == Phase.FAILED:
        assert len(command.status) > 20
    else:
        assert fetch.confirmed


def test_same_percepts_same_commands(kinematics: RobotKinematics) -> None:
    ends = []
    for _ in range(2):
        world = World(kinematics, AWAY.copy(), joints=STOWED.copy())
        world.run(fetching(kinematics, seed=4))
        ends.append((world.time, *world.base, *world.table))
    assert ends[0] == ends[1]


def test_after_the_end_nothing_is_commanded(world: World) -> None:
    fetch = fetching(world.kinematics)
    world.run(fetch)
    fetch.answer(GripperAnswer("grasp", "left", True))
    command = fetch.tick(world.time + 1.0, Percept())
    assert command.finished
    assert not command.twists


def test_a_controller_that_never_stows_is_refused(kinematics: RobotKinematics) -> None:
    with pytest.raises(ControlError, match="stow_idle_arm"):
        FetchExecutive(plan_for("left"), kinematics, ControllerSettings(stow_idle_arm=False), SETTINGS)


def test_the_loop_takes_any_executive_but_no_course_beside_it(kinematics: RobotKinematics) -> None:
    fetch = fetching(kinematics)
    assert ControlLoop(kinematics, fetch).executive is fetch
    with pytest.raises(ControlError, match="tell it that"):
        ControlLoop(kinematics, fetch, course=fetch._course or object())  # type: ignore[arg-type]
