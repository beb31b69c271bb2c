"""The bench of the next experiment: its cases, how recordings are joined, and its rows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Grasp, PoseStream, Recording, WrenchStream
from pbrl_bringup.benches import next_experiment as bench
from pbrl_bringup.benches.next_experiment import (
    FIRST_SEED,
    GROUPS,
    MOST,
    Told,
    cases_of,
    figure,
    laid_after,
    rows_of,
    until_told,
)
from pbrl_bringup.commands.bench import BENCHES
from pbrl_model.errors import ModelError


@pytest.fixture(scope="module")
def recording() -> Recording:
    time = np.arange(0.0, 3.0, 0.05)
    poses = PoseStream(time, np.zeros((60, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (60, 1)))
    return Recording(
        path=Path("push"),
        bodies={},
        object_poses={"table": poses},
        gripper_poses={"left": poses},
        wrenches={"left": WrenchStream(time, np.zeros((60, 3)), np.zeros((60, 3)))},
        grasps=(Grasp("left", "table", 1.0, 2.5, np.zeros(2)),),
    )


def told(chosen: int, random: int, acted: bool = True) -> Told:
    return Told(GROUPS[0], "viscous_drag", 1, 0.5, chosen, random, (False, False), acted, (0.5,))


def test_scored_cases_have_scored_seeds_and_every_effect_is_true_once() -> None:
    assert "next-experiment" in BENCHES
    assert all(seed >= FIRST_SEED for _, _, seed in cases_of(0, False))
    assert not {case[2] for case in cases_of(0, False)} & {case[2] for case in cases_of(1, False)}
    assert {(group, truth) for group, truth, _ in cases_of(0, False)} == {(g, truth) for g in GROUPS for truth in g}
    assert len(cases_of(0, True)) < len(cases_of(0, False))


def test_joined_recordings_follow_each_other(recording: Recording) -> None:
    joined = laid_after(recording, recording)
    for before, after in (
        (recording.object_poses["table"], joined.object_poses["table"]),
        (recording.wrenches["left"], joined.wrenches["left"]),
    ):
        assert len(after.time) == 2 * len(before.time) and np.all(np.diff(after.time) > 0.0)
    assert len(joined.grasps) == 2 * len(recording.grasps)
    assert all(a.end <= b.start for a, b in zip(joined.grasps, joined.grasps[1:], strict=False))


def test_the_row_compares_medians_with_half_of_chance() -> None:
    row = rows_of([told(1, 2), told(1, 4), told(2, 2)])[0]
    assert row.value == 1.0 and row.against["random"] == 2.0 and row.holds
    row = rows_of([told(2, 2), told(MOST + 1, 2)])[0]
    assert not row.holds
    assert not rows_of([])[0].holds
    assert not rows_of([told(1, 2, False)])[0].holds
    assert figure([told(1, 2)]).axes[0].get_legend() is not None


def test_cases_in_which_the_effect_never_acted_are_counted_apart() -> None:
    slack = told(MOST + 1, MOST + 1, False)
    row, within, _ = rows_of([told(1, 2), told(1, 4), told(2, 2), slack, slack])
    assert (row.value, row.against["random"], row.against["never_acted"]) == (1.0, 2.0, 2.0) and within.value == 1.0
    assert (row.against["median_of_all"], row.against["median_of_all_random"]) == (2.0, 4.0)


def test_a_push_whose_recording_is_refused_costs_a_push_and_not_the_bench(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    def weighed(of: Recording, names: Any, seed: int) -> Any:
        if of.path.name == "refused":
            raise ModelError("table: expected a pose")
        sure = 0.99 if of.path.name == "good" else 0.5
        return [SimpleNamespace(effects=("tether",), probability=sure)], None

    made: list[str] = []

    class Table(SimpleNamespace):
        def pushed(self, push: Any, number: int) -> Any:
            made.append(self.recording.path.name)
            return Table(recording=replace(recording, path=Path("refused" if number == 1 else "good")), acted=True)

    plan = SimpleNamespace(expected_bits=1.0, direction=(1.0, 0.0), speed=0.1, duration=1.0, contact_point=(0.0, 0.0))
    monkeypatch.setattr(bench, "weighed_by", weighed)
    monkeypatch.setattr(bench, "next_experiment", lambda *_: plan)
    table: Any = Table(recording=replace(recording, room=np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]])), acted=False)
    run = until_told(table, ("tether",), "tether", 1, random=False)
    assert run.pushes == 2 and not run.misled and made == ["push", "push"]
