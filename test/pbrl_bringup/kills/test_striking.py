"""Who goes on with the cases of a life when a mission ends before it gets to a state."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from pbrl_bringup.kills import striking
from pbrl_bringup.kills.cases import Case, draw_cases, lives_of
from pbrl_bringup.kills.striking import MISSES, NOT_MET, RESUMED, Outcome, live


def resumed(case: Case) -> Outcome:
    return Outcome(case.number, case.state, case.state, case.node, case.way, False, None, RESUMED, "", 1.0)


@pytest.mark.parametrize("misses", range(MISSES + 2))
def test_a_state_is_waited_for_in_another_graph_with_another_seed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, misses: int
) -> None:
    cases = next(life for life in lives_of(draw_cases(1, 97)) if len(life) > 2)
    graphs: list[tuple[str, int, int]] = []

    def one_graph(folder: Path, left: Sequence[Case], seed: int) -> tuple[list[Outcome], str]:
        graphs.append((folder.name, left[0].number, seed))
        second = [number for _, number, _ in graphs].count(cases[1].number)
        if left[0] == cases[0]:
            return [resumed(cases[0])], ""
        never = left[0] == cases[1] and second <= misses
        return ([], "Failed: no way") if never else ([resumed(case) for case in left], "")

    monkeypatch.setattr(striking, "_one_graph", one_graph)
    outcomes = live(tmp_path, cases, 7)
    assert [each.number for each in outcomes] == [case.number for case in cases]
    met = misses <= MISSES
    assert [each.mission for each in outcomes] == [RESUMED, RESUMED if met else NOT_MET, *[RESUMED] * (len(cases) - 2)]
    assert outcomes[1].sentence == ("" if met else "Failed: no way")
    assert outcomes[1].before == ("Failed: no way",) * min(misses, MISSES)
    assert not any(each.before for each in (outcomes[0], *outcomes[2:]))
    assert len({name for name, _, _ in graphs}) == len(graphs)
    assert [seed for _, number, seed in graphs if number == cases[1].number] == [
        7 + k for k in range(min(misses, MISSES) + 1)
    ]
