"""A case: a state is waited for, a node struck, the robot seen to rest, the node brought back, the mission goes on."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.mcap_file import McapFile
from pbrl_bringup.errors import BringupError
from pbrl_bringup.kills.cases import BURY, CALLED_OFF, FREEZE, KILL, Case
from pbrl_bringup.kills.life import Life
from pbrl_bringup.kills.truth import WALL, Array, moves, read_truth, time_to_rest
from pbrl_namo.executive.table import ENDED, State

PATIENCE = 420.0
"""[s] of the wall clock in one state, after which a mission stands still; or to be on its way again."""
LONGEST = 900.0
"""[s] of the wall clock for a mission that does not stand still to get to a state."""
MISSES = 2
"""Graphs, each with a seed of its own, whose mission may not get to a state, because it ends before or takes too long;
one more is "state not met"."""
DEAD = 1.5
"""[s] for which who is killed stays dead: longer than it takes others to notice."""
ALONE = 1.5
"""[s] between a freeze and the death after it."""
HEARS_AGAIN = 2.0
"""[s] for which a graph goes on once its recorder is back: ended at once, it shows nothing of what comes after."""
ENDS_LATER = 4.0
"""[s] for which a graph goes on whose mission is over: a simulator that was started again is recorded by then."""
GOING = frozenset(
    {
        State.GET_GRASP_POINT,
        State.NAVIGATE,
        State.GRASP,
        State.CLEAR,
        State.UPDATE_MODEL,
        State.ASK_MISMATCH,
        State.DRIVE_TO_GOAL,
        State.DONE,
    }
)
"""Where a mission is under way again: it has looked, got ready and planned."""
NEVER = 1e9
"""Instead of infinity, which JSON does not have [s]."""
WATCHED_TOPIC = "/joint_states"
RESUMED, REPORTED, NEITHER, NOT_MET = "resumed", "reported", "neither", "state not met"


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes:
        number: of the case.
        wanted: state at which it was to be done.
        state: at which it was.
        node: that was struck.
        way: how.
        moved: whether the robot moved then.
        rest: until it was at rest, simulated [s], `NEVER` where it was not; None: it did not move, or need not stop.
        mission: `RESUMED`, `REPORTED`, `NEITHER` or `NOT_MET`.
        sentence: told last.
        recovery: of the wall clock, until the mission was under way again [s].
        lost: of recordings of the same graph, longest time for which the simulator ran and nothing is recorded [s],
            `NEVER` where one cannot be read; None: there is none.
        found: of the same recordings, longest time in which recorder and simulator, one of them just started, did not
            know of each other [s]; None: there is none.
        before: how missions ended or stood, with other seeds, that did not get to the state, none of them struck.
    """

    number: int
    wanted: str
    state: str
    node: str
    way: str
    moved: bool
    rest: float | None
    mission: str
    sentence: str
    recovery: float
    lost: float | None = None
    found: float | None = None
    before: tuple[str, ...] = ()


def live(folder: Path, cases: Sequence[Case], seed: int) -> list[Outcome]:
    """Do cases of one room in one graph; where it has ended before all are done, in another one.

    Args:
        folder: for what the graphs leave; new.
        cases: in the order in which a mission gets there.
        seed: of simulator and executive.
    """
    left, done, count, before = list(cases), list[Outcome](), 0, list[str]()
    while left:
        outcomes, sentence = _one_graph(folder / f"graph_{count}", left, seed + len(before))
        count += 1
        if not outcomes and len(before) < MISSES:  # a mission may not get to that state, and another one meet it
            before.append(sentence)
            continue
        if not outcomes:
            case = left[0]
            outcomes = [Outcome(case.number, case.state, "", case.node, case.way, False, None, NOT_MET, sentence, 0.0)]
        done += [replace(outcomes[0], before=tuple(before)), *outcomes[1:]]
        left = left[len(outcomes) :]
        before = []
    return done


def _one_graph(folder: Path, cases: Sequence[Case], seed: int) -> tuple[list[Outcome], str]:
    """Do as many of the cases as one graph lets, or none; return them, and how its mission ended, or stands."""
    folder.mkdir(parents=True)
    outcomes: list[Outcome] = []
    frozen: list[tuple[float, float]] = []
    with Life(folder, cases[0].room, seed) as life:
        for case in cases:
            try:
                met = life.reach(State.CLEAR if case.state == State.PAUSED else case.state, PATIENCE, LONGEST)
            except BringupError as error:
                if outcomes:
                    break
                outcomes.append(_ended(case, life, str(error)))
                break
            if not met:
                break
            try:
                outcomes.append(_strike(life, case, frozen))
            except BringupError as error:
                outcomes.append(_ended(case, life, str(error)))
                break
    lost, found = lost_of(life, frozen)
    end = f"{life.state}: {life.told[-1][2]}" if life.told else ""
    return [replace(each, lost=lost, found=found) for each in outcomes], end


def _ended(case: Case, life: Life, sentence: str) -> Outcome:
    state = str(life.state or "")
    return Outcome(case.number, case.state, state, case.node, case.way, False, None, NEITHER, sentence, PATIENCE)


def _strike(life: Life, case: Case, frozen: list[tuple[float, float]]) -> Outcome:
    """Do one case; its state is met."""
    helper = ""
    if case.state == State.PAUSED:  # somebody else is gone first
        helper = "controller" if case.node != "controller" else "sim"
        life.programs.strike(helper, signal.SIGSTOP)
        since = len(life.told)
        life.until(lambda: State.PAUSED in [each[1] for each in life.told[since:]], PATIENCE, "not paused")
    else:
        entered = life.state
        end = time.time() + case.delay
        life.until(lambda: time.time() >= end or life.state != entered, PATIENCE, "the clock stands still")
    state, told = life.state, len(life.told)
    truth = life.truths[-1][0]
    struck = _blow(life, case, frozen)
    back = time.time()
    if helper:
        life.programs.strike(helper, signal.SIGCONT)
    if case.node == "recorder":
        life.wait(HEARS_AGAIN)
    rows = read_truth(truth)
    must_rest = case.node != "recorder" and not (case.node == "sim" and case.way != FREEZE)
    moved = must_rest and moves(rows, struck)
    mission, sentence = _goes_on(life, case, state, told)
    if case.node == "sim" and case.way == FREEZE:
        rows = read_truth(truth)  # its time stood still meanwhile: what counts comes after
    rest = time_to_rest(rows, struck, back if case.node != "sim" else math.inf) if moved else None
    rest = rest if rest is None or math.isfinite(rest) else NEVER
    return Outcome(
        case.number, case.state, str(state), case.node, case.way, moved, rest, mission, sentence, time.time() - back
    )


def _blow(life: Life, case: Case, frozen: list[tuple[float, float]]) -> float:
    """Strike a node and bring it back; return when it was struck [s of the wall clock]."""
    if case.way == KILL:
        struck = life.bury(case.node)
        life.wait(DEAD)
    else:
        struck = life.programs.strike(case.node, signal.SIGSTOP)
        life.wait(case.frozen if case.way == FREEZE else ALONE)
        if case.way == BURY:
            life.bury(case.node)
            life.wait(DEAD)
    if case.way == FREEZE:
        life.programs.strike(case.node, signal.SIGCONT)
    if case.node in ("recorder", "sim"):
        frozen.append((struck, time.time()))
    if case.way != FREEZE:
        life.start(case.node)
        if case.node == "recorder":
            life.under_way()
    return struck


def _goes_on(life: Life, case: Case, state: State | None, told: int) -> tuple[str, str]:
    """Wait until the mission is under way again or its end is told; return which, and the last sentence."""
    if case.room == CALLED_OFF and case.node == "namo" and case.way != FREEZE:
        life.send_goal()  # who died had heard of it, and who came does not know it
    since = len(life.told) if case.node != "recorder" else told
    if state in ENDED and (case.node != "namo" or case.way == FREEZE):
        life.wait(ENDS_LATER)  # nothing goes on; it is still told, to whoever comes later too
        return REPORTED, life.told[-1][2]

    def decided() -> bool:
        return any(each[1] in GOING or each[1] in ENDED for each in life.told[since:])

    try:
        life.until(decided, PATIENCE, "the mission does not go on")
    except BringupError as error:
        return NEITHER, str(error)
    last = life.told[-1]
    if last[1] in ENDED and last[1] != State.DONE:
        return (REPORTED if last[2] else NEITHER), f"{last[1]}: {last[2]}"
    return RESUMED, f"{last[1]}: {last[2]}"


def lost_of(life: Life, frozen: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the longest time that a recording of a graph lacks though its simulator ran, and `Outcome.found` [s].

    What counts is when a message was sent: one that was sent while the recorder was behind is late, and not lost.

    Args:
        life: the graph, ended.
        frozen: from when to when a recorder or simulator was frozen or away [s of the wall clock].
    """
    walls = [read_truth(path)[:, WALL] for path, _ in life.truths]
    lost, found = 0.0, 0.0
    for bag, begun, ended in life.bags:
        try:
            heard = _sent(bag)
        except BagError:
            return NEVER, NEVER
        for truth in walls:
            both = truth[(truth > begun) & (truth < ended)]
            met = _met(both, heard)
            found = max(found, met - both[0]) if len(both) and math.isfinite(met) else found
            lost = max(lost, _missing(both[both >= met] if math.isfinite(met) else both, heard, frozen))
    return lost, found


def _met(truth: Array, heard: Array) -> float:
    """Return when a recording first heard of a simulator that ran at some times; infinite where it never did."""
    after = np.searchsorted(heard, truth[0]) if len(truth) else len(heard)
    return float(heard[after]) if after < len(heard) and heard[after] <= truth[-1] else math.inf


def _sent(bag: Path) -> Array:
    """Return when the simulator sent what a recording has of it, by the wall clock [s]."""
    file = McapFile(next(iter(bag.glob("*.mcap")), bag))
    return np.sort([message.publish_time / 1e9 for message in file.messages() if message.topic == WATCHED_TOPIC])


def _missing(truth: Array, heard: Array, frozen: Sequence[tuple[float, float]]) -> float:
    """Return the longest time [s] for which the simulator ran between two recorded messages, or after the last."""
    for begin, end in frozen:
        truth = truth[(truth < begin) | (truth > end)]
    if not len(truth):
        return 0.0
    if not len(heard):
        return NEVER
    gap = np.searchsorted(heard, truth)
    piece = np.searchsorted(np.sort([end for _, end in frozen]), truth)  # a freeze amid a gap is no part of it
    first = np.concatenate([[0], np.flatnonzero(np.diff(gap) | np.diff(piece)) + 1])
    last = np.concatenate([first[1:], [len(truth)]]) - 1
    return float(np.bincount(gap[first], truth[last] - truth[first]).max())
