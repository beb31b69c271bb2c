"""Who is asked: answers, refusals, deaths; asked again, and given up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from office_of_fakes import office

from pbrl_control.kinematics import RobotKinematics
from pbrl_namo.errors import NamoError
from pbrl_namo.executive import Answer, ImmediateThinker, Job, LearnAnswer, LearnJob, Lost, Move, Refused
from pbrl_namo.executive.jobs import finite
from pbrl_namo.executive.settings import JobSettings
from pbrl_namo.executive.thinker import Question

JOB = LearnJob("table", 0.0, 1.0, None, 1)
SETTINGS = JobSettings(tries=3, wait=1.0)


class Scripted:
    """Answers what it is told to, one after the other; "raise" raises, None says nothing."""

    def __init__(self, *answers: object) -> None:
        self.answers, self.begun, self.dropped = list(answers), 0, 0

    def begin(self, job: Job) -> None:
        self.begun += 1
        if self.answers and self.answers[0] == "begin raises":
            self.answers.pop(0)
            raise OSError("no route to host")

    def poll(self) -> Answer | None:
        answer = self.answers.pop(0) if self.answers else None
        if answer == "poll raises":
            raise ValueError("what\nis this")
        return answer  # type: ignore[return-value]

    def drop(self) -> None:
        self.dropped += 1


def asked(thinker: Scripted, until: float = 60.0, timeout: float = 5.0) -> tuple[Answer | None, float, Question]:
    question = Question(thinker, JOB, timeout, SETTINGS)
    for now in np.arange(0.0, until, 0.1):
        answer = question.step(float(now))
        if answer is not None:
            return answer, float(now), question
    return None, until, question


def test_an_answer_is_given_once() -> None:
    found = LearnAnswer("belief")
    answer, now, question = asked(Scripted(None, None, found))
    assert answer is found
    assert now == pytest.approx(0.2)
    assert question.lost == []


def test_who_is_lost_is_asked_again_after_a_while() -> None:
    thinker = Scripted(Lost("died"), LearnAnswer("belief"))
    answer, now, question = asked(thinker)
    assert isinstance(answer, LearnAnswer)
    assert now == pytest.approx(1.0)
    assert question.lost == ["died"]
    assert thinker.begun == 2


@pytest.mark.parametrize("trouble", ["begin raises", "poll raises", Lost("died")])
def test_after_the_last_asking_it_is_said(trouble: object) -> None:
    answer, now, question = asked(Scripted(*3 * [trouble]))
    assert isinstance(answer, Lost)
    assert answer.reason.startswith("asked 3 times, the last time: ")
    assert "\n" not in answer.reason
    assert now == pytest.approx(2.0, abs=0.2)
    assert len(question.lost) == 3


def test_silence_is_a_loss_too() -> None:
    thinker = Scripted()
    answer, now, _ = asked(thinker, timeout=2.0)
    assert isinstance(answer, Lost)
    assert "no answer within 2 s" in answer.reason
    assert thinker.dropped == 3
    assert now == pytest.approx(3 * 2.1 + 2 * 1.0, abs=0.3)


def test_a_refusal_is_not_asked_again() -> None:
    def refuse(job: Job) -> Answer:
        raise NamoError("start: in\ncollision")

    thinker = ImmediateThinker(refuse)
    thinker.begin(JOB)
    answer = thinker.poll()
    assert answer == Refused("start: in collision")
    assert thinker.poll() is None


def test_an_unforeseen_error_is_a_loss() -> None:
    thinker = ImmediateThinker(lambda job: 1 / 0)  # type: ignore[arg-type,return-value]
    thinker.begin(JOB)
    assert thinker.poll() == Lost("ZeroDivisionError: division by zero")


def test_what_is_dropped_is_not_answered() -> None:
    thinker = ImmediateThinker(lambda job: LearnAnswer("belief"))
    thinker.begin(JOB)
    thinker.drop()
    assert thinker.poll() is None


def move(**more: object) -> Move:
    told = {"segments": ((np.array([0.1, 0.0, 0.0]), 2.0),), "contact": np.zeros(2)} | more
    return Move("table", start=0, end=1, targets=np.zeros((1, 2)), **told)  # type: ignore[arg-type]


BAD = {
    "no segment": {"segments": ()},
    "NaN": {"segments": ((np.array([0.1, math.nan, 0.0]), 2.0),)},
    "no motion": {"segments": ((np.zeros(3), 2.0),)},
    "no time": {"segments": ((np.array([0.1, 0.0, 0.0]), 0.0),)},
    "back in time": {"segments": ((np.array([0.1, 0.0, 0.0]), -1.0),)},
    "for ever": {"segments": ((np.array([0.1, 0.0, 0.0]), math.inf),)},
    "two numbers": {"segments": ((np.array([0.1, 0.0]), 2.0),)},
    "contact": {"contact": np.array([math.nan, 0.0])},
    "contact of three": {"contact": np.zeros(3)},
}


@pytest.mark.parametrize("case", BAD)
def test_moves_that_are_none_are_found_out(case: str) -> None:
    assert finite(move()) == ""
    assert finite(move(**BAD[case])).startswith("move of 'table': expected ")


def test_the_fakes_are_sound(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    assert set(world.percept().tags) == {"table_a", "table_b", "left_gripper", "right_gripper"}
