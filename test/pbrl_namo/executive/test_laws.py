"""Whatever happens, in whatever order: the laws of `check_laws` hold at every tick, and there is an end."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from office_of_fakes import DT, GOAL, SETTINGS, TABLE, Brain, Office, executive_in, office

from pbrl_control.kinematics import RobotKinematics
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_namo.executive import GraspJob, LearnJob, MismatchJob, NamoExecutive, PlanJob
from pbrl_namo.executive.table import ENDED

TROUBLED = 36.0  # [s] in which things happen
IMPATIENT = SETTINGS.model_copy(update={"time_limit": 60.0, "tries": 2, "plans": 6, "faults": 3})
NAN = np.full(3, math.nan)


class Trouble:
    """Makes things happen to a world and its executive."""

    def __init__(self, world: Office, executive: NamoExecutive, brain: Brain, rng: np.random.Generator) -> None:
        self.world, self.executive, self.brain, self.rng = world, executive, brain, rng
        self.hidden: set[str] = set()
        self.tampering: Callable[[Percept], Percept] = lambda percept: percept
        world.tamper = lambda _, percept: self.tampered(percept)

    def tampered(self, percept: Percept) -> Percept:
        tags = {name: each for name, each in percept.tags.items() if name not in self.hidden}
        return self.tampering(replace(percept, tags=tags))

    def mend(self) -> None:
        self.do_show()
        self.executive.resume()
        self.world.opens = self.world.closes = self.world.base_moves = True

    def strike(self) -> None:
        names = [name for name in dir(self) if name.startswith("do_")]
        getattr(self, names[int(self.rng.integers(len(names)))])()

    def do_cancel(self) -> None:
        if self.rng.random() < 0.3:
            self.executive.cancel("enough")

    def do_aim(self) -> None:
        self.executive.aim(np.array([*self.rng.uniform(-4.0, 3.5, 2), math.nan]))

    def do_pause(self) -> None:
        self.executive.pause("somebody is gone")

    def do_resume(self) -> None:
        self.executive.resume()

    def do_believe(self) -> None:
        self.executive.believe("table_a", self.rng.choice(["static", "free"]))

    def do_lose_thinkers(self) -> None:
        kind = (PlanJob, GraspJob, LearnJob, MismatchJob)[int(self.rng.integers(4))]
        self.brain.lost[kind] = int(self.rng.integers(4))

    def do_hide(self) -> None:
        self.hidden = set(self.rng.choice(["table_a", "table_b", "left_gripper", "right_gripper"], 1))

    def do_show(self) -> None:
        self.hidden = set()
        self.tampering = lambda percept: percept
        self.world.odometry = True

    def do_nan_tags(self) -> None:
        self.tampering = lambda percept: replace(
            percept, tags={name: Tag(each.time, NAN, each.quaternion) for name, each in percept.tags.items()}
        )

    def do_nan_wrenches(self) -> None:
        self.tampering = lambda percept: replace(
            percept, wrenches={side: np.full(6, math.nan) for side in percept.wrenches}
        )

    def do_no_posture(self) -> None:
        self.tampering = lambda percept: replace(percept, posture=None)

    def do_nothing_perceived(self) -> None:
        self.tampering = lambda percept: Percept()

    def do_nan_outline(self) -> None:
        self.tampering = lambda percept: replace(
            percept, bodies={**percept.bodies, "table_b": BodyShape(np.full((4, 2), math.nan), 0.7)}
        )

    def do_lose_odometry(self) -> None:
        self.world.odometry = False

    def do_drop(self) -> None:
        if self.world.grips:
            self.world.grips.pop(next(iter(self.world.grips)))

    def do_close_from_nowhere(self) -> None:
        self.world.hands.setdefault("left", np.array([0.0, 0.0, 0.0, 0.8]))
        self.world.grips["left"] = Grip(str(self.rng.choice(["table_a", "table_b"])), np.zeros(2))

    def do_stick_gripper(self) -> None:
        self.world.opens = not self.world.opens

    def do_refuse(self) -> None:
        self.world.closes = not self.world.closes

    def do_pin(self) -> None:
        self.world.pinned ^= {str(self.rng.choice(["table_a", "table_b"]))}

    def do_shove(self) -> None:
        name = str(self.rng.choice(["table_a", "table_b"]))
        self.world.things[name] = self.world.things[name] + self.rng.uniform(-0.4, 0.4, 3)

    def do_block_base(self) -> None:
        self.world.base_moves = not self.world.base_moves

    def do_set_clock(self) -> None:
        self.world.time = max(self.world.time + self.rng.uniform(-3.0, 3.0), 0.0)

    def do_bring_something(self) -> None:
        self.world.bodies = {**self.world.bodies, "chair": TABLE}
        self.world.things["chair"] = np.array([-2.5, 2.2, 0.0])


@pytest.mark.parametrize("seed", range(10))
def test_whatever_happens_the_laws_hold_and_it_ends(kinematics: RobotKinematics, seed: int) -> None:
    rng = np.random.default_rng([77, seed])
    world = office(kinematics)
    world.pinned = {"table_a"} if rng.integers(2) else set()
    brain = Brain(world, explains=bool(rng.integers(2)), ignorant=bool(rng.integers(2)))
    executive = executive_in(world, brain, settings=IMPATIENT, seed=seed)
    trouble = Trouble(world, executive, brain, rng)
    begin, rate = rng.uniform(0.0, 30.0), rng.choice([0.1, 0.5, 2.0])
    for k in range(round(TROUBLED / DT)):
        if k * DT > begin and rng.random() < rate * DT:
            trouble.strike()
        world.tick(executive)
        if executive.state in ENDED and k * DT < 0.5 * TROUBLED:
            trouble.mend()
            executive.aim(GOAL)
    limit = IMPATIENT.time_limit + SETTINGS.release.settle + SETTINGS.release.timeout + 5.0
    for _ in range(round(limit / DT)):
        if executive.state in ENDED:
            break
        world.tick(executive)
    assert executive.state in ENDED, f"{executive.state}: {executive.sentence}"
    assert executive.reason or executive.state == "Done"
    for change in executive.mission.account.log:
        assert "expected one of the events" not in change.sentence, change
        assert change.sentence
