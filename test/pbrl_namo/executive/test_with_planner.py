"""The executive with the planner that it is meant for; only what is learned is told by somebody who knows."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from office_of_fakes import CONTROLLER, GOAL, SETTINGS, TABLE, Brain, Office, executive_in, office

from pbrl_bag.types import Recording
from pbrl_control.kinematics import RobotKinematics
from pbrl_namo.beliefs.belief import ObjectBelief, belief_of_draws
from pbrl_namo.executive import Answer, ImmediateThinker, LearnAnswer, LearnJob, OpenByFreeSpace, State
from pbrl_namo.executive.ways import find_grasp
from pbrl_namo.scene import Movable
from pbrl_namo.thinking import Thoughts


def believed(mu: float) -> ObjectBelief:
    return belief_of_draws(Movable(TABLE.footprint, mass=33.0), ["mass", "mu_ground"], np.tile([33.0, mu], (20, 1)))


class Told(Thoughts):
    """Plans in earnest; learns by looking into the world."""

    def __init__(self, world: Office) -> None:
        super().__init__(self.nothing)
        self._world = world

    def nothing(self, begin: float, end: float) -> Recording:
        raise AssertionError("nobody records here")

    def learn(self, job: LearnJob) -> Answer:
        return LearnAnswer(believed(1.5 if job.object in self._world.pinned else 0.02))


@pytest.fixture
def world(kinematics: RobotKinematics) -> Office:
    return office(kinematics)


def test_experiment_1_with_plans_in_earnest(world: Office) -> None:
    world.pinned = {"table_b"}  # the one that is chosen first
    executive = executive_in(
        world, thinker=ImmediateThinker(Told(world)), opening=OpenByFreeSpace(), controller=CONTROLLER
    )
    order = world.run(executive)
    assert order.state == State.DONE, order.status
    assert np.hypot(*(world.base - GOAL)[:2]) < 0.05
    rows = executive.mission.account.rows()
    assert rows["surprises"] == rows["calls to UpdateModel"] == 1.0
    assert rows["openings"] == 1.0
    assert set(executive.mission.beliefs) == {"table_b"}
    assert world.things["table_b"].tolist() == [0.3, -1.55, 0.0]
    choices = executive.mission.account.log
    assert [change.object for change in choices if change.after == State.NAVIGATE] == ["table_b", "table_a"]


def test_where_both_are_known_to_be_stuck_there_is_no_way(world: Office) -> None:
    beliefs = {name: believed(1.5) for name in world.things}
    executive = executive_in(
        world, thinker=ImmediateThinker(Told(world)), opening=OpenByFreeSpace(), beliefs=beliefs, settings=SETTINGS
    )
    order = world.run(executive)
    assert order.state == State.FAILED
    assert order.status.startswith("no way from region 0 to the goal's region 1")
    for name in world.things:
        assert f"'{name}'" in order.status
    assert world.time < 1.0


def test_jobs_and_answers_travel_to_another_process(world: Office) -> None:
    brain = Brain(world)
    executive = executive_in(world, brain)
    executive.believe("table_b", believed(0.02))
    world.run(executive, to=State.NAVIGATE)
    plan, grasp = brain.jobs
    for thing in (plan, grasp, brain(plan), brain(grasp), Told(world)(plan)):
        again = pickle.loads(pickle.dumps(thing))
        assert type(again) is type(thing)
    moved = pickle.loads(pickle.dumps(grasp))
    assert find_grasp(moved, SETTINGS.fetch.grasps).candidate.contacts.keys() == {"left", "right"}
    assert pickle.loads(pickle.dumps(plan)).scene.outlines.keys() == plan.scene.outlines.keys()
