"""What was planned in last is kept; the answer is that of whoever answers."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_namo.errors import NamoError
from pbrl_namo.executive import Answer, Job, LearnAnswer, LearnJob, PlanAnswer, PlanJob
from pbrl_namo.regions import free_space
from pbrl_namo.ros.planned import Planned
from pbrl_namo.scene import Movable, NamoScene

SHAPE = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SCENE = NamoScene.of(
    6.0 * SHAPE, {}, {"table": Movable(SHAPE)}, {"table": np.zeros(3)}, np.array([-2.0, 0.0, 0.0]), np.zeros(3)
)


def test_a_plan_leaves_its_floor_and_nothing_else_does() -> None:
    answer = PlanAnswer(reason="none")
    planned = Planned(lambda job: answer)
    assert planned(LearnJob("table", 0.0, 1.0, None, 1)) is answer
    assert planned.floor is None
    assert planned(PlanJob(SCENE, {}, {}, 1)) is answer
    assert planned.floor is not None
    assert planned.floor.scene is SCENE
    assert planned.floor.regions == free_space(SCENE).regions


def test_he_is_busy_while_the_other_works_even_if_that_comes_to_nothing() -> None:
    seen = []

    def work(job: Job) -> Answer:
        seen.append(planned.busy)
        if isinstance(job, PlanJob):
            raise NamoError("no plan")
        return LearnAnswer(None)

    planned = Planned(work)
    planned(LearnJob("table", 0.0, 1.0, None, 1))
    with pytest.raises(NamoError, match="no plan"):
        planned(PlanJob(SCENE, {}, {}, 1))
    assert seen == [True, True]
    assert not planned.busy
    assert planned.floor is None
