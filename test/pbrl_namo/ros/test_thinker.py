"""The node's thinker: a plan leaves the floor it was planned on, and learning is given what was heard."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from pbrl_msgs.msg import Scene

from pbrl_model.ros.heard import Message
from pbrl_namo.executive import Answer, LearnJob, Lost, PlanAnswer, PlanJob, Refused
from pbrl_namo.regions import free_space
from pbrl_namo.ros.thinker import Asked, NodeThinker, think
from pbrl_namo.scene import Movable, NamoScene

SHAPE = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SCENE = NamoScene.of(
    6.0 * SHAPE, {}, {"table": Movable(SHAPE)}, {"table": np.zeros(3)}, np.array([-2.0, 0.0, 0.0]), np.zeros(3)
)
NO_SCENE = Message("/scene", Scene, bytes(2))


@pytest.fixture(scope="module")
def thinker() -> Iterator[NodeThinker]:
    thinker = NodeThinker(lambda: [NO_SCENE])
    yield thinker
    thinker.close()


def test_learning_is_given_what_was_heard_and_a_plan_leaves_its_floor(
    thinker: NodeThinker, polled: Callable[[NodeThinker], Answer]
) -> None:
    thinker.begin(LearnJob("table", 0.0, 1.0, None, 1))
    refused = polled(thinker)
    assert isinstance(refused, Refused)
    assert "/scene: expected a Scene, got 2 bytes" in refused.reason
    assert thinker.floor is None
    thinker.begin(PlanJob(SCENE, {}, {}, 1))
    assert isinstance(polled(thinker), PlanAnswer)
    floor = thinker.floor
    assert floor is not None
    assert floor.regions == free_space(SCENE).regions
    thinker.begin(LearnJob("table", 0.0, 1.0, None, 1))
    assert isinstance(polled(thinker), Refused)
    assert thinker.floor is floor


def test_a_job_that_is_lost_leaves_no_floor() -> None:
    no_robot = replace(SCENE, robot=None)  # type: ignore[arg-type]
    thought = think(Asked(PlanJob(no_robot, {}, {}, 1), []))
    assert isinstance(thought.answer, Lost)
    assert thought.floor is None
