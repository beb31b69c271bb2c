"""The executive's states, what can happen in them, and where that leads: thesis figure 42 as one table.

Nothing is remembered beside the state, so that the table says all there is: letting go in order to plan anew, to fail
and to end on a person's word are three states. Nothing here drives, asks or waits; see `NamoExecutive`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum

from pbrl_namo.errors import NamoError


class State(StrEnum):
    """What the executive is at; names are those of figure 42 where it has them."""

    LOOK = "Look"
    GET_READY = "GetReady"
    PLANNING = "Planning"
    GET_GRASP_POINT = "GetGraspPoint"
    NAVIGATE = "NavigateToPoint"
    GRASP = "Grasp"
    CLEAR = "ClearObstacle"
    UPDATE_MODEL = "UpdateModel"
    ASK_MISMATCH = "AskMismatch"
    RELEASE = "Release"
    RELEASE_AND_FAIL = "ReleaseAndFail"
    RELEASE_AND_CANCEL = "ReleaseAndCancel"
    DRIVE_TO_GOAL = "DriveToGoal"
    PAUSED = "Paused"
    DONE = "Done"
    FAILED = "Failed"
    CANCELLED = "Cancelled"


class Event(StrEnum):
    """What can happen; the value is how it is told."""

    SEEN = "everything needed is seen"
    NOT_SEEN = "not seen"
    STILL_HELD = "something is held"
    READY = "ready to drive"
    BLOCKED = "cannot get ready"
    PLANNED = "planned"
    NOTHING_TO_DO = "nothing in the way"
    NO_WAY = "no way"
    DOUBTED = "no way past what nobody sees"
    GRASP_FOUND = "grasp found"
    NO_GRASP = "no grasp found"
    ARRIVED = "arrived"
    WAY_LOST = "way lost"
    VANISHED = "object vanished"
    HELD = "held"
    MISSED = "missed"
    OPENED = "opening found"
    MOVED = "moved, no opening"
    STEPPED = "moved, one step of several"
    UNEXPECTED_FORCE = "unexpected force"
    STALLED = "stalled"
    TIMED_OUT = "timed out"
    TAG_LOST = "tag lost"
    GRIP_LOST = "grip lost"
    GRIP_SLIPPED = "grip slipped"
    UPDATED = "model updated"
    UNEXPLAINED = "model does not explain it"
    NOT_LEARNED = "nothing learned"
    REPAIRED = "mismatch found"
    UNKNOWN = "mismatch unknown"
    RELEASED = "released"
    STUCK = "gripper stuck"
    JOB_LOST = "no answer"
    LINK_BACK = "link back"
    PAUSED_TOO_LONG = "paused too long"
    CANCELLED = "cancelled"
    LINK_LOST = "link lost"
    GOAL_CHANGED = "goal changed"
    GAVE_UP = "gave up"
    FAULT = "fault"


TABLE: Mapping[tuple[State, Event], State] = {
    (State.LOOK, Event.SEEN): State.GET_READY,
    (State.LOOK, Event.NOT_SEEN): State.FAILED,
    (State.LOOK, Event.STILL_HELD): State.RELEASE,
    # Arms up and clear of furniture: whoever plans after this plans for a robot that can drive.
    (State.GET_READY, Event.READY): State.PLANNING,
    (State.GET_READY, Event.BLOCKED): State.FAILED,
    (State.GET_READY, Event.STILL_HELD): State.RELEASE,
    (State.PLANNING, Event.PLANNED): State.GET_GRASP_POINT,
    (State.PLANNING, Event.NOTHING_TO_DO): State.DRIVE_TO_GOAL,
    (State.PLANNING, Event.NO_WAY): State.FAILED,
    # What the base was held up by once need not be a thing: it is looked for without, once a goal.
    (State.PLANNING, Event.DOUBTED): State.LOOK,
    (State.PLANNING, Event.JOB_LOST): State.FAILED,
    (State.GET_GRASP_POINT, Event.GRASP_FOUND): State.NAVIGATE,
    (State.GET_GRASP_POINT, Event.NO_GRASP): State.LOOK,
    (State.GET_GRASP_POINT, Event.JOB_LOST): State.FAILED,
    (State.NAVIGATE, Event.ARRIVED): State.GRASP,
    (State.NAVIGATE, Event.WAY_LOST): State.LOOK,
    (State.NAVIGATE, Event.VANISHED): State.LOOK,
    (State.NAVIGATE, Event.STILL_HELD): State.RELEASE,
    (State.GRASP, Event.HELD): State.CLEAR,
    (State.GRASP, Event.MISSED): State.RELEASE,
    (State.GRASP, Event.VANISHED): State.RELEASE,
    (State.GRASP, Event.UNEXPECTED_FORCE): State.UPDATE_MODEL,
    (State.CLEAR, Event.OPENED): State.RELEASE,
    (State.CLEAR, Event.MOVED): State.RELEASE,
    (State.CLEAR, Event.STEPPED): State.RELEASE,
    (State.CLEAR, Event.UNEXPECTED_FORCE): State.UPDATE_MODEL,
    (State.CLEAR, Event.STALLED): State.UPDATE_MODEL,
    (State.CLEAR, Event.TIMED_OUT): State.UPDATE_MODEL,
    # What is stuck may slip out of the plates at a force that is not unexpected yet, each time it is tried.
    (State.CLEAR, Event.GRIP_SLIPPED): State.UPDATE_MODEL,
    (State.CLEAR, Event.TAG_LOST): State.RELEASE,
    (State.CLEAR, Event.GRIP_LOST): State.RELEASE,
    # Thesis 6.4: the object is let go after the model has been updated, and the policy recomputed.
    (State.UPDATE_MODEL, Event.UPDATED): State.RELEASE,
    (State.UPDATE_MODEL, Event.UNEXPLAINED): State.ASK_MISMATCH,
    (State.UPDATE_MODEL, Event.NOT_LEARNED): State.RELEASE,
    (State.UPDATE_MODEL, Event.JOB_LOST): State.RELEASE_AND_FAIL,
    (State.ASK_MISMATCH, Event.REPAIRED): State.RELEASE,
    (State.ASK_MISMATCH, Event.UNKNOWN): State.RELEASE,
    (State.ASK_MISMATCH, Event.JOB_LOST): State.RELEASE_AND_FAIL,
    (State.RELEASE, Event.RELEASED): State.LOOK,
    (State.RELEASE, Event.STUCK): State.FAILED,
    (State.RELEASE_AND_FAIL, Event.RELEASED): State.FAILED,
    (State.RELEASE_AND_FAIL, Event.STUCK): State.FAILED,
    (State.RELEASE_AND_CANCEL, Event.RELEASED): State.CANCELLED,
    (State.RELEASE_AND_CANCEL, Event.STUCK): State.FAILED,
    (State.DRIVE_TO_GOAL, Event.ARRIVED): State.DONE,
    (State.DRIVE_TO_GOAL, Event.WAY_LOST): State.LOOK,
    (State.DRIVE_TO_GOAL, Event.STILL_HELD): State.RELEASE,
    (State.PAUSED, Event.LINK_BACK): State.LOOK,
    (State.PAUSED, Event.STILL_HELD): State.RELEASE,
    (State.PAUSED, Event.PAUSED_TOO_LONG): State.FAILED,
}
"""Where a state's own events lead; `INTERRUPTS` can come on top of them anywhere, see `interrupted`."""

INTERRUPTS = (Event.CANCELLED, Event.LINK_LOST, Event.GOAL_CHANGED, Event.GAVE_UP, Event.FAULT)
"""What can happen in every state."""

ENDED = frozenset({State.DONE, State.FAILED, State.CANCELLED})
"""Where nothing more is done."""

DRIVING = frozenset({State.GET_READY, State.NAVIGATE, State.DRIVE_TO_GOAL})
"""Where the base goes about the room: never with anything in the grippers."""

RELEASING = frozenset({State.RELEASE, State.RELEASE_AND_FAIL, State.RELEASE_AND_CANCEL})
"""Where grippers open and back off."""

MOVING = DRIVING | RELEASING | {State.GRASP, State.CLEAR}
"""Shaded in figure 42: the robot moves. Everywhere else it is told to rest."""

THINKING = frozenset({State.PLANNING, State.GET_GRASP_POINT, State.UPDATE_MODEL, State.ASK_MISMATCH})
"""Where somebody else computes, see `Thinker`."""

MAY_HOLD = RELEASING | {State.GRASP, State.CLEAR, State.UPDATE_MODEL, State.ASK_MISMATCH, State.PAUSED}
"""Where something may be held."""

MEANING: Mapping[State, str] = {
    State.LOOK: "stands until robot and furniture are seen",
    State.GET_READY: "backs grippers out of furniture, stows the arms",
    State.PLANNING: "asks for a plan: what to move, or the way to the goal",
    State.GET_GRASP_POINT: "asks for a grasp and the way to it",
    State.NAVIGATE: "drives before the object",
    State.GRASP: "lowers the arms, closes, pulls slightly to be sure of the grip",
    State.CLEAR: "moves the object, looks for the opening, compares forces with those expected",
    State.UPDATE_MODEL: "holds still; asks what is learned from what was just felt and seen",
    State.ASK_MISMATCH: "holds still; asks what the model leaves out",
    State.RELEASE: "rests, opens, backs the grippers off; then plans anew",
    State.RELEASE_AND_FAIL: "the same, then fails",
    State.RELEASE_AND_CANCEL: "the same, then ends as it was told to",
    State.DRIVE_TO_GOAL: "drives to the goal",
    State.PAUSED: "rests until whoever is gone is back",
    State.DONE: "rests at the goal",
    State.FAILED: "rests, and says why",
    State.CANCELLED: "rests, as it was told to",
}


def interrupted(state: State, event: Event) -> State:
    """Return where one of `INTERRUPTS` leads: the same rule for every state.

    What may be held is let go before anything else, what is learned from is learned to the end, and what is lost is
    waited for at rest. An end stays one unless there is a new goal.

    Raises:
        NamoError: the event is none of them.
    """
    if event not in INTERRUPTS:
        raise NamoError(f"interrupt: expected one of {', '.join(INTERRUPTS)}, got {str(event)!r}")
    if state in ENDED:
        return State.LOOK if event == Event.GOAL_CHANGED else state
    return _RULES[event](state)


def _cancelled(state: State) -> State:
    # While paused nobody would open a gripper: what is still held is said instead.
    return State.RELEASE_AND_CANCEL if state in MAY_HOLD and state != State.PAUSED else State.CANCELLED


def _link_lost(state: State) -> State:
    if state == State.RELEASE_AND_FAIL:
        return State.FAILED
    return State.CANCELLED if state == State.RELEASE_AND_CANCEL else State.PAUSED


def _goal_changed(state: State) -> State:
    if state in (State.UPDATE_MODEL, State.ASK_MISMATCH, State.PAUSED):
        return state
    return State.RELEASE if state in MAY_HOLD else State.LOOK


def _gave_up(state: State) -> State:
    if state == State.RELEASE_AND_CANCEL:
        return state
    return State.RELEASE_AND_FAIL if state in MAY_HOLD and state != State.PAUSED else State.FAILED


def _fault(state: State) -> State:
    if state in RELEASING or state in (State.LOOK, State.PAUSED):
        return State.FAILED
    return State.RELEASE if state in MAY_HOLD else State.LOOK


_RULES = {
    Event.CANCELLED: _cancelled,
    Event.LINK_LOST: _link_lost,
    Event.GOAL_CHANGED: _goal_changed,
    Event.GAVE_UP: _gave_up,
    Event.FAULT: _fault,
}


def next_state(state: State, event: Event) -> State:
    """Return where an event leads.

    Raises:
        NamoError: it cannot happen in that state.
    """
    if event in INTERRUPTS:
        return interrupted(state, event)
    after = TABLE.get((state, event))
    if after is None:
        known = ", ".join(repr(str(each)) for each in own_events(state)) or "none of its own"
        raise NamoError(f"{state}: expected one of the events {known}, got {str(event)!r}")
    return after


def own_events(state: State) -> tuple[Event, ...]:
    """Return which events a state has of its own, in the table's order."""
    return tuple(event for before, event in TABLE if before == state)


def successors(state: State) -> Iterator[tuple[Event, State]]:
    """Yield everything that can happen in a state, and where it leads."""
    for event in (*own_events(state), *INTERRUPTS):
        yield event, next_state(state, event)


def markdown() -> str:
    """Return both parts of the table as markdown."""
    lines = ["| state | what it does | when | then |", "|---|---|---|---|"]
    for state in State:
        moves = "" if state in MOVING or state in ENDED else " (at rest)"
        for k, event in enumerate(own_events(state)):
            head = f"**{state}** | {MEANING[state]}{moves}" if k == 0 else " | "
            lines.append(f"| {head} | {event} | {TABLE[state, event]} |")
        if not own_events(state):
            lines.append(f"| **{state}** | {MEANING[state]} | | |")
    lines += ["", f"| in any state | {' | '.join(INTERRUPTS)} |", f"|---|{'---|' * len(INTERRUPTS)}"]
    lines += [f"| {state} | {' | '.join(interrupted(state, event) for event in INTERRUPTS)} |" for state in State]
    return "\n".join(lines) + "\n"
