"""What is known of pushes: taught, kept in a file, read again; files of the other kind are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from desk_cases import ERASER, TRAVELS, model_of, three

from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop import (
    Desk,
    Ended,
    Ending,
    Knowledge,
    PhysicsDisplacements,
    Table,
    Teaching,
    displaced,
    pushes_of,
)

PLACES = np.array([[-0.25, -0.1, 0.3], [0.2, -0.12, 0.1], [0.0, 0.12, 0.2]])


def taught(task: Teaching, desk: Desk) -> Teaching:
    """Go through lessons in a world that does what a model says."""
    world, layout = model_of(desk), PLACES[: len(desk.items)].copy()
    while True:
        asked = task.next(dict(zip(desk.names, layout, strict=True)))
        if isinstance(asked, Ended):
            assert asked.ending is Ending.TAUGHT, asked.reason
            return task
        layout[asked.item] = displaced(layout[asked.item], world.of(desk.names[asked.item], asked.push).mean)


@pytest.mark.parametrize(("kind", "most"), [("tables", 200), ("physics", 24)])
def test_what_was_taught_is_the_same_from_its_file(kind: str, most: int, tmp_path: Path) -> None:
    desk, file = three(), tmp_path / "known.json"
    known = Knowledge(kind, TRAVELS, file=file)
    assert not known.is_taught(desk)
    task = taught(known.lessons(desk), desk)
    assert 18 <= task.pushes <= most
    known.take_in(task)
    known.write()
    again = Knowledge(kind, TRAVELS, file=file)
    assert again.is_taught(desk)
    pushes = pushes_of(TRAVELS)
    one, other = (each.model.displacements(desk.items[0], pushes) for each in (known, again))
    np.testing.assert_allclose(one.mean, other.mean, atol=1e-12)
    np.testing.assert_allclose(one.spread, other.spread, atol=1e-12)


def test_files_of_the_other_kind_and_kinds_that_are_not_there_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "tables.json"
    file.write_text(json.dumps(model_of(three()).as_dict()))
    with pytest.raises(PlannerError, match=r"\(physics\).*expected primitive, travel and displacement"):
        Knowledge("physics", TRAVELS, file=file)
    physics = PhysicsDisplacements(0.012, seed=0)
    physics.update("eraser", pushes_of((0.05,))[0], np.array([0.04, 0.0, 0.0]))
    file.write_text(json.dumps(physics.as_dict()))
    with pytest.raises(PlannerError, match=r"\(tables\).*expected primitive, travel, count"):
        Knowledge("tables", TRAVELS, file=file)
    with pytest.raises(PlannerError, match="expected one of tables, physics, got 'oracle'"):
        Knowledge("oracle", TRAVELS)


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    known = Knowledge("tables", TRAVELS, file=tmp_path / "no" / "such" / "folder.json")
    with pytest.raises(PlannerError, match="expected to write"):
        known.write()


def test_the_world_model_needs_one_push_of_each_kind() -> None:
    desk = Desk(Table.of(0.8, 0.5), (ERASER,))
    known = Knowledge("physics", TRAVELS)
    task = taught(known.lessons(desk), desk)
    assert {push.primitive for _, push, _ in task.seen} == {push.primitive for push in pushes_of((0.05,))}
    known.take_in(task)
    told = known.model.displacements(desk.items[0], pushes_of((0.03,)))
    assert told.mean[0, 0] > 0.0 > told.mean[1, 0]
