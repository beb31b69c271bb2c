"""The table of figure 42: nothing undefined, nothing without an end, nothing driven about that is held."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrl_namo.errors import NamoError
from pbrl_namo.executive.table import (
    DRIVING,
    ENDED,
    INTERRUPTS,
    MAY_HOLD,
    MEANING,
    MOVING,
    RELEASING,
    TABLE,
    THINKING,
    Event,
    State,
    interrupted,
    markdown,
    next_state,
    own_events,
    successors,
)

RUNNING = [state for state in State if state not in ENDED]


def reached(start: State, *, without: frozenset[Event] = frozenset()) -> set[State]:
    found, waiting = {start}, [start]
    while waiting:
        for event, after in successors(waiting.pop()):
            if event not in without and after not in found:
                found.add(after)
                waiting.append(after)
    return found


@pytest.mark.parametrize("state", State)
def test_every_event_is_handled_or_refused_by_name(state: State) -> None:
    for event in Event:
        if event in INTERRUPTS or (state, event) in TABLE:
            assert next_state(state, event) in State
            continue
        with pytest.raises(NamoError, match=rf"^{state}: expected one of the events .*, got '{event}'$"):
            next_state(state, event)


def test_only_interrupts_are_interrupts() -> None:
    with pytest.raises(NamoError, match="got 'planned'"):
        interrupted(State.PLANNING, Event.PLANNED)
    assert not {event for _, event in TABLE} & set(INTERRUPTS)


def test_every_event_can_happen_somewhere() -> None:
    assert {event for _, event in TABLE} | set(INTERRUPTS) == set(Event)


def test_no_state_is_unreachable() -> None:
    assert reached(State.LOOK) == set(State)


@pytest.mark.parametrize("state", RUNNING)
def test_from_everywhere_it_can_come_to_an_end_by_itself(state: State) -> None:
    found = reached(state, without=frozenset({Event.CANCELLED, Event.GOAL_CHANGED, Event.FAULT}))
    assert found & {State.DONE, State.FAILED}


@pytest.mark.parametrize("state", RUNNING)
def test_done_can_still_be_reached_unless_it_is_ending(state: State) -> None:
    own = frozenset(INTERRUPTS)
    ending = state in (State.RELEASE_AND_FAIL, State.RELEASE_AND_CANCEL)
    assert (State.DONE in reached(state, without=own)) != ending


@pytest.mark.parametrize("state", sorted(ENDED))
def test_an_end_stays_one_until_there_is_a_new_goal(state: State) -> None:
    assert own_events(state) == ()
    for event in INTERRUPTS:
        assert interrupted(state, event) == (State.LOOK if event == Event.GOAL_CHANGED else state)


def test_what_may_be_held_is_let_go_before_anything_drives() -> None:
    """Where something may be held it is held on, let go, or the end; else open grippers have told."""
    told = {Event.RELEASED, Event.LINK_BACK}  # both are told only with open grippers
    for state in MAY_HOLD:
        for event, after in successors(state):
            assert after not in DRIVING, f"{state} drives after {event}"
            if after not in MAY_HOLD | ENDED:
                assert event in told, f"{state} is left for {after} after {event}"
    for state in DRIVING:
        assert next_state(state, Event.STILL_HELD) == State.RELEASE
    assert next_state(State.LOOK, Event.STILL_HELD) == State.RELEASE, "an end that still held something may go on"


def test_success_while_holding_means_release() -> None:
    assert next_state(State.CLEAR, Event.OPENED) == State.RELEASE
    for state in (State.UPDATE_MODEL, State.ASK_MISMATCH):
        ways = [next_state(state, event) for event in own_events(state)]
        assert set(ways) <= RELEASING | {State.ASK_MISMATCH}


def test_surprises_are_learned_from_while_it_is_held() -> None:
    for event in (Event.UNEXPECTED_FORCE, Event.STALLED, Event.TIMED_OUT):
        assert next_state(State.CLEAR, event) == State.UPDATE_MODEL


def test_interrupts_end_what_they_should() -> None:
    for state in RUNNING:
        assert next_state(state, Event.CANCELLED) in {State.CANCELLED, State.RELEASE_AND_CANCEL}
        assert next_state(state, Event.LINK_LOST) in {State.PAUSED, *ENDED}
        assert next_state(state, Event.GAVE_UP) in {State.FAILED, State.RELEASE_AND_FAIL, State.RELEASE_AND_CANCEL}
        assert next_state(state, Event.LINK_LOST) not in MOVING


def test_states_are_of_one_kind() -> None:
    assert not MOVING & THINKING
    assert not MOVING & ENDED
    assert DRIVING | RELEASING < MOVING
    assert not DRIVING & MAY_HOLD
    assert set(MEANING) == set(State)


@given(st.lists(st.integers(min_value=0, max_value=1000), max_size=200))
def test_any_story_ends_when_its_budget_is_spent(choices: list[int]) -> None:
    """Whatever happens, once it gives up, a release that ends one way or the other is all that is left."""
    state = State.LOOK
    for choice in choices:
        ways = [after for _, after in successors(state)]
        state = ways[choice % len(ways)]
    for event in (Event.GAVE_UP, Event.STUCK):
        if state in ENDED:
            break
        state = next_state(state, event)
    assert state in ENDED


def test_the_table_is_told_as_markdown() -> None:
    text = markdown()
    rows = [line for line in text.splitlines() if line.startswith("|")]
    widths = [row.count("|") for row in rows]
    own, rule = widths[: len(rows) - len(State) - 2], widths[-len(State) - 2 :]
    assert set(own) == {5}
    assert set(rule) == {len(INTERRUPTS) + 2}
    for (state, event), after in TABLE.items():
        assert f" {event} | {after} |" in text
        assert f"**{state}**" in text
    assert len(own) == 2 + len(TABLE) + sum(not own_events(state) for state in State)


def test_random_walks_never_drive_with_something_held() -> None:
    """Grippers close in Grasp and open in releases; a walk over the table keeps count."""
    rng = np.random.default_rng(3)
    for _ in range(300):
        state, held = State.LOOK, False
        for _ in range(200):
            choices = list(successors(state))
            event, after = choices[int(rng.integers(len(choices)))]
            if event in (Event.RELEASED, Event.LINK_BACK) and held:
                held = False  # told only when it is so
            if state == State.LOOK and held and event != Event.STILL_HELD and event not in INTERRUPTS:
                event, after = Event.STILL_HELD, State.RELEASE
            state = after
            held = held or (state == State.GRASP and bool(rng.integers(2)))
            assert not (held and state in DRIVING), f"{event} leads to {state} with something held"


def test_no_two_rows_say_the_same_twice() -> None:
    keys = list(TABLE)
    assert len(keys) == len(set(keys))
    assert all(after in State for after in TABLE.values())
    assert [state for state, _ in itertools.groupby(keys, key=lambda key: key[0])] == [
        state for state in State if own_events(state)
    ]
