"""A desk is tidied over DDS: the simulator as a user starts it, the node, and somebody who asks for it."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Point
from pbrl_msgs.action import Tidy
from pbrl_msgs.msg import Body, Scene
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from pbrl_bag.liveness import Liveness
from pbrl_bringup.graph import node_environment
from pbrl_bringup.paths import node_executable
from pbrl_control.ball_arm import BallArm, Strokes
from pbrl_control.ros.qos import LATCHED
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.desk_hearing import desk_from_msg
from pbrl_planner.ros.tabletop_node import TabletopNode, objective_of
from pbrl_planner.tabletop import Desk, Ending, Item, Table

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tabletop"))

from desk_cases import model_of

URDF = (Path(__file__).resolve().parents[3] / "urdf" / "ball_arm" / "ball_arm.urdf").read_text(encoding="utf-8")
ERASER = {"kind": "eraser", "pose": [0.1, 0.05, 0.4]}
TEXT = "terms:\n  - {term: near, items: [eraser], point: [-0.05, 0.05]}\n"


@pytest.fixture
def known(tmp_path: Path) -> Path:
    """What pushes do to an eraser."""
    path = tmp_path / "model.json"
    path.write_text(json.dumps(model_of(Desk(Table.of(0.8, 0.5), (Item("eraser", 0.13, 0.05),))).as_dict()))
    return path


@pytest.fixture
def simulator(tmp_path: Path, stage: Any) -> Iterator[subprocess.Popen]:
    """An eraser on a table, seen with noise, faster than real time, but so that a busy machine keeps up."""
    path = tmp_path / "one.yaml"
    path.write_text(yaml.safe_dump({"items": {"eraser": ERASER}, "vision": {"source": "noise", "rate": 10.0}}))
    words = ["--ros-args", "-p", f"scene:={path}", "-p", "rate:=1.5"]
    domain = stage.node.context.get_domain_id()
    process = subprocess.Popen([str(node_executable("tabletop_sim", "sim_node")), *words], env=node_environment(domain))
    yield process
    process.terminate()
    process.wait(timeout=20.0)


class FakeHearing:
    """All that the node wants to hear of an eraser on a table, and an arm that stands in the picture."""

    def __init__(self) -> None:
        self._strokes = Strokes(BallArm(URDF, np.array([0.0, -0.45, math.pi / 2])))
        self.joints = self._strokes.arm.joints(self._strokes.stowed)
        self.live = Liveness(("/joint_states",), 2.0)

    def missing(self) -> str:
        return ""

    def desk(self) -> Desk:
        return Desk(Table.of(0.8, 0.5), (Item("eraser", 0.13, 0.05),))

    def arm(self) -> Strokes:
        return self._strokes


def test_an_eraser_is_pushed_to_where_it_is_wanted(stage: Any, simulator: subprocess.Popen, known: Path) -> None:
    node = stage.add(TabletopNode, camera="", model=str(known), think=0.3)
    said, drawn = stage.hear(String, "/tabletop/status", LATCHED), stage.hear(MarkerArray, "/markers")
    stage.until(lambda: not node._hearing.missing())
    told: list[Tidy.Feedback] = []
    results = stage.ask(Tidy, "/tidy", Tidy.Goal(objective=TEXT, enough=0.03, seed=1), told.append)
    stage.until(lambda: results)
    assert results[0].success, results[0].message
    assert results[0].cost <= 0.03
    assert results[0].pushes >= 2
    stage.until(lambda: any("the objective is reached" in each.data for each in said))
    assert told
    assert drawn
    assert simulator.poll() is None


def test_a_robot_that_falls_silent_in_a_push_ends_it_in_words(
    stage: Any, simulator: subprocess.Popen, known: Path
) -> None:
    node = stage.add(TabletopNode, camera="", model=str(known), think=0.3)
    stage.until(lambda: not node._hearing.missing())
    told: list[Tidy.Feedback] = []
    results = stage.ask(Tidy, "/tidy", Tidy.Goal(objective=TEXT, enough=0.03, seed=1), told.append)
    stage.until(lambda: any(each.pushes == 1 for each in told))
    simulator.send_signal(signal.SIGSTOP)
    stage.time = begun = node._now()
    try:
        while not results:  # somebody else's clock goes on
            stage.pass_time(node, 0.1)
            assert stage.time < begun + 120.0
    finally:
        simulator.send_signal(signal.SIGCONT)
    assert not results[0].success
    assert "nothing of /joint_states for 2 s" in results[0].message
    again = stage.ask(Tidy, "/tidy", Tidy.Goal(objective=TEXT, enough=0.03, seed=1))
    stage.until(lambda: again)
    assert again[0].success, again[0].message


def test_goals_that_make_no_sense_are_refused_in_words(stage: Any, simulator: subprocess.Popen, known: Path) -> None:
    node = stage.add(TabletopNode, camera="", model=str(known))
    early = stage.ask(Tidy, "/tidy", Tidy.Goal(objective="straighten", enough=math.nan))
    stage.until(lambda: early)
    if early[0].message.startswith("expected to have heard"):
        assert not early[0].success
    stage.until(lambda: not node._hearing.missing())
    for objective, words in (
        ("nowhere", "expected a file, YAML text, or one of"),
        ("straighten", "expected one of the items eraser, got 'remote'"),
        ("terms: [{term: near, items: [eraser], weight: .inf}]", "weight"),
    ):
        results = stage.ask(Tidy, "/tidy", Tidy.Goal(objective=objective, enough=math.nan))
        stage.until(lambda results=results: results)
        assert not results[0].success
        assert words in results[0].message


def test_a_goal_that_is_refused_ends_what_was_done_for_the_one_before(stage: Any, known: Path) -> None:
    node = stage.add(TabletopNode, camera="", model=str(known))
    node._hearing = FakeHearing()  # and no clock: no tick takes the first goal any further
    first = stage.ask(Tidy, "/tidy", Tidy.Goal(objective=TEXT, enough=0.03, seed=1))
    assert node._executive is not None
    assert node._executive.task is not None
    second = stage.ask(Tidy, "/tidy", Tidy.Goal(objective="nowhere", enough=math.nan))
    stage.until(lambda: first and second)
    assert not first[0].success
    assert "expected a file" in second[0].message
    assert node._executive.task is None, "nobody waits for it any more"
    assert node._executive.ended.ending is Ending.CANCELLED


def test_a_thought_that_nobody_wants_any_more_is_still_thought(stage: Any, known: Path) -> None:
    node = stage.add(TabletopNode, camera="", model=str(known))
    node._hearing = FakeHearing()
    stage.ask(Tidy, "/tidy", Tidy.Goal(objective=TEXT, enough=0.03, seed=1))
    enough = threading.Event()
    executive = SimpleNamespace(question={}, task=SimpleNamespace(next=lambda _: enough.wait(60.0)))
    try:
        node._think_or_answer(executive, 0.0, node._hearing.joints)
        assert node.thinking
        stage.ask(Tidy, "/tidy", Tidy.Goal(objective=TEXT, enough=0.03, seed=1))
        assert node.thinking, "Python would wait for its thread"
    finally:
        enough.set()
    stage.until(lambda: not node.thinking)


def test_a_scene_that_is_told_again_is_not_heard_twice(stage: Any, known: Path) -> None:
    node = stage.add(TabletopNode, camera="", model=str(known))
    corners = [Point(x=x, y=y) for x, y in ((-0.065, -0.025), (0.065, -0.025), (0.065, 0.025), (-0.065, 0.025))]
    body = Body(name="eraser", footprint=corners, movable=True, height=0.02)
    for height in (0.02, 0.03):
        body.height = height
        stage.send("/scene", Scene(bodies=[body]), LATCHED)
        stage.until(lambda height=height: node._hearing._scene and node._hearing._scene.bodies[0].height == height)
    assert [each.topic for each in node.subscriptions].count("ar_tags/eraser/pose") == 1


def test_a_file_that_is_no_model_is_refused(stage: Any, tmp_path: Path) -> None:
    path = tmp_path / "bad.json"
    path.write_text("[1, 2]")
    with pytest.raises(PlannerError, match="expected a JSON file of displacement models"):
        stage.add(TabletopNode, model=str(path))


def test_scenes_that_are_no_desks_are_refused() -> None:
    ring = (0.0, 0.0, 0.1, 0.8)
    with pytest.raises(PlannerError, match="a table with 4 corners"):
        desk_from_msg(Scene(), ring)
    corners = Scene()
    for x, y in ((-0.4, -0.25), (0.4, -0.25), (0.4, 0.25), (-0.4, 0.25)):
        corners.room.append(Point(x=x, y=y))
    corners.bodies.append(Body(name="blob", footprint=[Point()] * 4, movable=True, height=0.02))
    with pytest.raises(PlannerError, match="blob"):
        desk_from_msg(corners, ring)
    with pytest.raises(PlannerError, match="expected a file"):
        objective_of(Desk(Table.of(1, 1), (Item("eraser", 0.13, 0.05),)), "no such thing")
