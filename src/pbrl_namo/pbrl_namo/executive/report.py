"""What an executive tells people: where it is, what it has chosen, what it expects and feels, what it has done."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pbrl_control.planar import Array
from pbrl_namo.executive.executive import NamoExecutive
from pbrl_namo.executive.jobs import Choice
from pbrl_namo.executive.table import ENDED, State

AT_HAND = frozenset({State.GET_GRASP_POINT, State.NAVIGATE, State.GRASP, State.CLEAR, State.UPDATE_MODEL})


@dataclass(frozen=True)
class NamoStatus:
    """One moment of an executive; the fields of the message of that name.

    Attributes:
        state: where it is.
        sentence: what is being done, or why it has ended.
        finished, success: whether it has ended, and well.
        goal: (3,) in `world` [m, rad]; heading NaN: any.
        object: being moved, or about to be; empty: none.
        region, target: that the robot was in when it last planned, and that it is opening; -1: none.
        regions: how many there were then.
        cut_off: of those, the ones that nothing leads to.
        choices: openings that were thought of then.
        expected_force, force_limit, felt_force: [N] at any grip; NaN: not known, or nothing is moved.
        rows: counts and times, see `Account.rows`.
        seconds: in each state [s].
        notes: what a person should know beside the sentence.
    """

    state: State
    sentence: str
    finished: bool
    success: bool
    goal: Array
    object: str
    region: int
    target: int
    regions: int
    cut_off: tuple[int, ...]
    choices: tuple[Choice, ...]
    expected_force: float
    force_limit: float
    felt_force: float
    rows: Mapping[str, float]
    seconds: Mapping[State, float]
    notes: tuple[str, ...]


def status_of(executive: NamoExecutive) -> NamoStatus:
    """Return what an executive tells at this moment."""
    mission, state = executive.mission, executive.state
    planned, held = mission.planned, mission.manipulation
    moving = held is not None and state in (State.GRASP, State.CLEAR)
    move = planned.move if state in AT_HAND else None
    return NamoStatus(
        state,
        executive.reason or executive.sentence,
        state in ENDED,
        state == State.DONE,
        mission.goal,
        "" if move is None else move.object,
        planned.region,
        -1 if move is None else move.end,
        planned.regions,
        planned.cut_off,
        planned.choices,
        held.expected_force if held is not None and moving else math.nan,
        held.force_limit if held is not None and moving else math.nan,
        held.course.felt if held is not None and moving else math.nan,
        mission.account.rows(),
        dict(mission.account.seconds),
        tuple(mission.notes()),
    )
