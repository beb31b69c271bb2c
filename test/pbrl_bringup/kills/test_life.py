"""When a mission that is waited for counts as one that stands still, and when as one that only takes long."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

from pbrl_bringup.errors import BringupError
from pbrl_bringup.kills import life as life_module
from pbrl_bringup.kills.cases import FREE
from pbrl_bringup.kills.life import Life
from pbrl_namo.executive.table import State

STILL, LONGEST = 10.0, 60.0
STEP = 0.5


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[Sequence[tuple[float, State]]], Life]:
    """Make a life whose executive tells of states at times [s] of a clock that goes on while somebody waits."""

    def make(script: Sequence[tuple[float, State]]) -> Life:
        now, left, life = [0.0], list(script), Life(tmp_path, FREE, 1)
        monkeypatch.setattr(life_module, "time", SimpleNamespace(monotonic=lambda: now[0], time=lambda: now[0]))

        def until(condition: Callable[[], bool], timeout: float, complaint: str) -> None:
            end = now[0] + timeout
            while not condition():
                if now[0] > end:
                    raise BringupError(complaint)
                now[0] += STEP
                while left and left[0][0] <= now[0]:
                    life.told.append((now[0], left.pop(0)[1], ""))

        monkeypatch.setattr(life, "until", until)
        return life

    return make


def busy(until: float) -> list[tuple[float, State]]:
    """Return a mission that plans and looks in turn, each for less than `STILL`."""
    count = math.ceil(until / (0.8 * STILL))
    return [(0.8 * STILL * k, (State.LOOK, State.PLANNING)[k % 2]) for k in range(count)]


def test_a_state_is_met_however_late_while_others_follow_each_other(scripted: Callable[..., Life]) -> None:
    life = scripted([*busy(5.0 * STILL), (5.0 * STILL, State.GRASP)])
    assert life.reach(State.GRASP, STILL, LONGEST)


def test_a_mission_that_ends_before_does_not_meet_it(scripted: Callable[..., Life]) -> None:
    life = scripted([(1.0, State.LOOK), (2.0, State.FAILED), (3.0, State.GRASP)])
    assert not life.reach(State.GRASP, STILL, LONGEST)


def test_one_that_goes_on_for_ever_does_not_meet_it_and_does_not_stand_still(scripted: Callable[..., Life]) -> None:
    life = scripted(busy(10.0 * LONGEST))
    assert not life.reach(State.GRASP, STILL, LONGEST)


@pytest.mark.parametrize("script", [[], [(1.0, State.LOOK)], [(1.0, State.LOOK), (5.0, State.LOOK), (9.0, State.LOOK)]])
def test_one_that_stays_in_a_state_stands_still(
    scripted: Callable[..., Life], script: Sequence[tuple[float, State]]
) -> None:
    life = scripted([*script, (2.0 * STILL, State.GRASP)])
    with pytest.raises(BringupError, match=f"no Grasp: still {script[-1][1] if script else 'nothing'}"):
        life.reach(State.GRASP, STILL, LONGEST)
