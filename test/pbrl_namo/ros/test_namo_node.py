"""The node by itself, without its process for thoughts: what it takes in of what others say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Point
from pbrl_msgs.msg import Body, ObjectModel, ObjectModels, Scene
from std_msgs.msg import String

from pbrl_control.percept import Percept
from pbrl_model.parameters import KERNEL_COLUMNS
from pbrl_namo.beliefs.stops import Stop
from pbrl_namo.executive.mission import job_seed
from pbrl_namo.ros import namo_node

URDF = Path(__file__).resolve().parents[3] / "urdf/krang/krang.urdf"
MASS = KERNEL_COLUMNS.index("mass")
GOAL = np.array([2.0, 0.0, math.nan])


class NoThoughts:
    """In the place of the thinker's process."""

    floor = None

    def __init__(self, heard: object) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def node(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[namo_node.NamoNode]:
    monkeypatch.setattr(namo_node, "NodeThinker", NoThoughts)
    rclpy.init(domain_id=domain)
    node = namo_node.NamoNode()
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def scene(room: tuple[tuple[float, float], ...] = (), wide: float = 0.5) -> Scene:
    corners = [Point(x=x, y=y) for x, y in ((-wide, -0.4), (wide, -0.4), (wide, 0.4), (-wide, 0.4))]
    table = Body(name="table", footprint=corners, height=0.75, nominal_mass=33.0, movable=True)
    return Scene(bodies=[table], room=[Point(x=x, y=y) for x, y in room])


def models(mass: float) -> ObjectModels:
    told = ObjectModel(object="table", model_class="free", parameters=["mass"], units=["kg"])
    told.draws, told.samples, told.mean, told.sd = 2, [mass, mass], [mass], [0.0]
    return ObjectModels(models=[told])


def test_what_learners_say_again_takes_away_nothing_that_was_found_out_since(node: namo_node.NamoNode) -> None:
    node._on_description(String(data=URDF.read_text(encoding="utf-8")))
    node._on_scene(scene())
    node._on_models(models(20.0))
    node._aim(GOAL, 0)
    beliefs = node._executive.mission.beliefs
    assert beliefs["table"].rows[0, MASS] == 20.0
    wall = Stop(np.array([0.5, 0.0]), np.array([1.0, 0.0]), 0.1)
    repaired = replace(beliefs["table"], rows=1.5 * beliefs["table"].rows, stops=(wall,))
    node._executive.believe("table", repaired)  # as its own learning does
    node._on_models(models(20.0))
    assert beliefs["table"] is repaired, "it was said before"
    node._on_models(models(25.0))
    assert beliefs["table"].rows[0, MASS] == 25.0, "news"
    assert beliefs["table"].stops == (wall,), "it met something, whatever it weighs"
    node._on_scene(scene(wide=0.9))
    node._on_models(models(25.0))
    assert beliefs["table"].footprint[:, 0].max() == 0.9, "it is another table"


@pytest.mark.parametrize("room", [((0.0, 0.0),), ((0.0, 0.0), (1.0, math.nan), (0.0, 1.0))])
def test_a_scene_without_a_room_as_it_should_be_is_left_aside_whole(
    node: namo_node.NamoNode, room: tuple[tuple[float, float], ...]
) -> None:
    (hear,) = (each.callback for each in node.subscriptions if each.topic_name == "/scene")
    node._on_description(String(data=URDF.read_text(encoding="utf-8")))
    hear(scene(room))
    assert not node._hearing.percept(0.0).bodies
    node._aim(GOAL, 0)
    assert "the scene" in node._executive.view.blind(0.0)
    hear(scene(((-3.0, -3.0), (3.0, -3.0), (0.0, 3.0))))
    assert "the scene" not in node._executive.view.blind(0.0)
    assert list(node._hearing.percept(0.0).bodies) == ["table"]


def test_a_goal_under_way_takes_the_seed_of_the_next(node: namo_node.NamoNode) -> None:
    node._on_description(String(data=URDF.read_text(encoding="utf-8")))
    node._aim(GOAL, 3)
    first = node._executive.mission
    node._aim(-GOAL, 8)
    node._executive.tick(1.0, Percept(None, {}, {}, {}, {}))
    second = node._executive.mission
    assert second is not first
    assert second._draw() == job_seed(8, 1)
