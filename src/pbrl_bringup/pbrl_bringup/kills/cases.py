"""What is done to which node, and when: drawn so that every state of the executive has its share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbrl_namo.executive.table import State

KILL, FREEZE, BURY = "killed", "frozen", "frozen, then killed"
WAYS = (KILL, FREEZE, BURY)
NODES = ("controller", "namo", "sim", "recorder")
FREE, STUCK, TETHERED, CALLED_OFF = "free", "stuck", "tethered", "called off"

ROOM = """
name: {name}
room: {{outline: [[-0.5, -1.5], [5.0, -1.5], [5.0, 1.5], [-0.5, 1.5]]}}
robot: {{pose: [0.6, 0.3, 0.0]}}
bodies:
  table: {{kind: office_table, size: [1.0, 1.0], height: 0.7775, nominal_mass: 33.0, pose: [2.2, 0.75, 0.0]}}
  cupboard: {{kind: fixture, polygon: [[1.9, -1.4], [2.6, -1.4], [2.6, -0.4], [1.9, -0.4]], height: 1.0}}
"""
"""A table and a cupboard that leave no gap that the robot fits through; one goal, and one thing that can be moved."""
LOCKED = """
concealed:
  locked_casters: {table: [front_left, front_right, rear_left, rear_right]}
"""
TETHER = """
concealed:
  tether: {table: {anchor: [2.2, 0.75, 0.7], point: [0.0, 0.0, -0.0775], slack_length: 0.2, stiffness: 3000.0}}
"""
"""Its cord hangs from the middle of the table's underside: wherever the table goes, it goes freely, and not far."""
SCENES: Mapping[str, str] = {FREE: "", STUCK: LOCKED, TETHERED: TETHER, CALLED_OFF: ""}
"""By room what is concealed in it: a table that does not move is learned from, a cord is not explained by that."""

ORDER: Mapping[str, Sequence[State]] = {
    FREE: (
        State.LOOK,
        State.GET_READY,
        State.PLANNING,
        State.GET_GRASP_POINT,
        State.NAVIGATE,
        State.PAUSED,
        State.GRASP,
        State.CLEAR,
        State.RELEASE,
        State.DRIVE_TO_GOAL,
        State.DONE,
    ),
    STUCK: (State.UPDATE_MODEL, State.FAILED),
    TETHERED: (State.ASK_MISMATCH,),
    CALLED_OFF: (State.RELEASE_AND_CANCEL, State.CANCELLED),
}
"""Which states are met in which room, in their order. To let go in order to fail, an answer has to be lost five times:
that takes minutes of waiting, and the part that does it is the one that lets go in order to be cancelled."""
SOON_OVER = frozenset(
    {
        State.LOOK,
        State.PLANNING,
        State.UPDATE_MODEL,
        State.ASK_MISMATCH,
        State.RELEASE,
        State.RELEASE_AND_CANCEL,
    }
)
BRIEF, LASTING = 0.3, 6.0
"""[s] of the wall clock into a state, at most, before a node is struck: into those that are soon over, and others.
`GetGraspPoint` is over before anything could be waited for."""
STATES = tuple((room, state) for room, states in ORDER.items() for state in states)
TOGETHER = {FREE: 8, STUCK: 2, TETHERED: 1, CALLED_OFF: 2}
"""At most so many cases share one graph."""


@dataclass(frozen=True)
class Case:
    """One thing that is done to a node.

    Attributes:
        number: of the case; with the seed it makes it again.
        room: one of `SCENES`.
        state: of the executive, at which it is done.
        node: of the graph.
        way: one of `WAYS`.
        delay: after the state was entered [s of the wall clock], unless the state ends before.
        frozen: for how long, where it is [s of the wall clock].
    """

    number: int
    room: str
    state: State
    node: str
    way: str
    delay: float
    frozen: float


def draw_cases(seed: int, count: int) -> list[Case]:
    """Return so many cases: states and nodes in turn, so that none is met seldom; ways and moments at random."""
    return [_case(seed, number) for number in range(count)]


def _case(seed: int, number: int) -> Case:
    rng = np.random.default_rng([seed, number])
    room, state = STATES[(7 * number) % len(STATES)]  # 7 and their number share no factor: a few cases are spread
    turn = number // len(STATES)
    node = NODES[(turn + number) % len(NODES)]
    return Case(
        number,
        room,
        state,
        node,
        WAYS[int(rng.integers(len(WAYS)))],
        float(rng.uniform(0.0, _latest(state))),
        float(rng.uniform(1.5, 4.0)),
    )


def _latest(state: State) -> float:
    """Return how long after a state was entered something is done, at most [s]."""
    if state == State.GET_GRASP_POINT:
        return 0.0
    return BRIEF if state in SOON_OVER else LASTING


def lives_of(cases: Sequence[Case]) -> list[tuple[Case, ...]]:
    """Return which cases share a graph: of one room, in the order in which a mission gets there."""
    lives: list[tuple[Case, ...]] = []
    for room, states in ORDER.items():
        waiting: dict[State, list[Case]] = {state: [] for state in states}
        for case in cases:
            if case.room == room:
                waiting[case.state].append(case)
        while any(waiting.values()):
            queues = [queue for queue in waiting.values() if queue][: TOGETHER[room]]
            lives.append(tuple(queue.pop(0) for queue in queues))
    return sorted(lives, key=lambda life: min(case.number for case in life))


def scene_text(room: str) -> str:
    """Return the text of a room's scene."""
    return ROOM.format(name=room.replace(" ", "_")) + SCENES[room]
