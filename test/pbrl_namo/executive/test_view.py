"""What is seen of robot and room, and getting ready to drive in it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from office_of_fakes import CONTROLLER, GOAL, SETTINGS, STOWED, TABLE, Office, office, tag, view_of

from pbrl_control.errors import ControlError
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.percept import Grip, Percept
from pbrl_namo.executive.readying import GetReady
from pbrl_namo.executive.table import Event
from pbrl_namo.executive.view import Look, RoomView


def test_the_scene_is_what_is_seen(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    view = view_of(world)
    scene = view.scene(world.time, GOAL, ())
    assert set(scene.movable) == {"table_a", "table_b"}
    assert set(scene.fixed) == set(world.fixed)
    assert scene.movable["table_a"].mass == 33.0
    assert math.isnan(scene.movable["table_b"].mass)
    assert scene.start == pytest.approx(world.base, abs=1e-6)
    for name, pose in world.things.items():
        assert scene.poses[name] == pytest.approx(pose, abs=1e-9)
    left = view.scene(world.time, GOAL, ("table_a",))
    assert set(left.movable) == {"table_b"}
    assert left.fixed["table_a"].equals_exact(scene.outline("table_a"), 1e-9)


def test_what_is_held_is_where_its_tag_is_now(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    view = view_of(world)
    world.things["table_a"] = np.array([-1.0, 1.5, 0.3])
    scene = view.held_scene(world.percept(), "table_a", GOAL)
    assert scene is not None
    assert scene.poses["table_a"] == pytest.approx([-1.0, 1.5, 0.3])
    assert view.held_scene(Percept(), "table_a", GOAL) is None
    bad = replace(world.percept(), tags={"table_a": tag(0.0, np.full(3, np.nan), 0.0)})
    assert view.held_scene(bad, "table_a", GOAL) is None


def test_no_scene_without_a_base(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    view = view_of(world)
    with pytest.raises(ControlError, match="odometry: expected one"):
        view.scene(world.time + 5.0, GOAL, ())


def looked(view: RoomView, world: Office, seconds: float = 8.0) -> tuple[Event | None, str, Look]:
    look = Look(view, SETTINGS)
    for now in np.arange(world.time, world.time + seconds, 0.05):
        world.time = float(now)
        if world.odometry:
            view.odometry(world.time, world.base)
        percept = world.percept()
        view.take(world.time, percept)
        step = look.step(world.time, percept)
        if step.event is not None:
            return step.event, step.status, look
    return None, "", look


def test_it_looks_before_it_says_so(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    event, _, look = looked(view_of(world), world)
    assert event == Event.SEEN
    assert look.vanished == ()


def test_what_has_vanished_is_waited_for_then_left_where_it_was(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    view, gone = view_of(world), world.time
    world.tamper = lambda _, percept: replace(
        percept, tags={name: each for name, each in percept.tags.items() if name != "table_a"}
    )
    world.time += 2.0
    event, sentence, look = looked(view, world)
    assert event == Event.SEEN
    assert look.vanished == ("table_a",)
    assert "table_a" in sentence
    assert world.time - gone > SETTINGS.patience
    assert "table_a" in view.scene(world.time, GOAL, look.vanished).fixed


HIDDEN = {
    "a table": ("table_b", "tag 'table_b'"),
    "both grippers": ("gripper", "gripper tags: expected a plausible one"),
}


@pytest.mark.parametrize("case", HIDDEN)
def test_what_was_never_seen_is_said_to_be_missing(kinematics: RobotKinematics, case: str) -> None:
    hidden, sentence = HIDDEN[case]
    world = office(kinematics)
    world.tamper = lambda _, percept: replace(
        percept, tags={name: each for name, each in percept.tags.items() if hidden not in name}
    )
    event, said, _ = looked(view_of(world), world)
    assert event == Event.NOT_SEEN
    assert sentence in said
    assert said.endswith("is its source running?")


def test_an_outline_that_is_none_is_said_to_be(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    world.bodies["table_a"] = replace(TABLE, footprint=np.full((4, 2), np.nan))
    event, said, _ = looked(view_of(world), world)
    assert event == Event.NOT_SEEN
    assert "outline of 'table_a': expected finite corners" in said


def readied(world: Office, seconds: float = 40.0) -> tuple[Event | None, str]:
    view = view_of(world)
    part = GetReady(view, CONTROLLER, SETTINGS)
    for now in np.arange(world.time, world.time + seconds, 0.05):
        world.time = float(now)
        view.odometry(world.time, world.base)
        percept = world.percept()
        view.take(world.time, percept)
        step = part.step(world.time, percept)
        if step.event is not None:
            return step.event, step.status
        for name, twist in step.twists.items():
            if name == "base":
                world.base = world.base + 0.05 * twist.vx * np.array([math.cos(world.base[2]), 0.0, 0.0])
            elif world.arms_move:
                world.joints = world.joints + np.clip(STOWED - world.joints, -0.05, 0.05)
    return None, ""


def test_low_arms_are_drawn_out_of_a_table_and_stowed(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    world.joints = np.array(CONTROLLER.nominal)
    world.base = np.array([0.3 - 0.375 - 0.70, 1.55, 0.0])  # grippers above the border of table_a
    before = world.base[0]
    assert readied(world)[0] == Event.READY
    assert world.base[0] < before - 0.1
    assert world.joints == pytest.approx(STOWED, abs=0.05)


@pytest.mark.parametrize(("room", "event"), [(0.08, Event.READY), (0.02, Event.BLOCKED)])
def test_little_room_behind_is_used(kinematics: RobotKinematics, room: float, event: Event) -> None:
    world = office(kinematics)
    world.joints = np.array(CONTROLLER.nominal)
    world.base = np.array([0.3 - 0.375 - 0.76, 1.55, 0.0])  # grippers just above the border of table_a
    behind = world.base[0] - 0.67 - room  # the robot reaches 0.67 m back
    world.fixed["wall_north"] = np.array([behind - 0.05, 1.55, 0.0])
    found, sentence = readied(world)
    assert found == event, sentence
    assert world.base[0] - 0.67 >= behind - 1e-6 if event == Event.READY else "make room" in sentence


def test_stowed_arms_are_ready_at_once(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    assert readied(world) == (Event.READY, "arms are stowed")


def test_why_it_cannot_get_ready_is_said(kinematics: RobotKinematics) -> None:
    stuck = office(kinematics, arms_move=False)
    stuck.joints = np.array(CONTROLLER.nominal)
    event, sentence = readied(stuck)
    assert event == Event.BLOCKED
    assert "stow: expected the arms within" in sentence
    bent = office(kinematics, waist=2.2)
    event, sentence = readied(bent)
    assert event == Event.BLOCKED
    assert sentence.startswith("waist: expected within 0.1 rad")
    holding = office(kinematics)
    holding.grips = {"left": Grip("table_a", np.zeros(2))}
    assert readied(holding) == (Event.STILL_HELD, "left holds 'table_a'")
