"""Objectives: the thesis's terms by hand, files and functions, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from desk_cases import laid, layout_of, three

from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop import Aligned, Apart, Facing, Near, Objective

TEXT = """
terms:
  - {term: near, items: [eraser, remote, scale]}
  - {term: aligned, items: [eraser, remote, scale], weight: 0.2}
"""


def test_terms_are_the_equations() -> None:
    desk = three()
    layout = np.array([[0.3, 0.0, 0.1], [0.0, 0.4, math.pi / 2 - 0.2], [0.0, 0.0, math.pi]])
    apart = Objective.of(desk, [Apart(term="apart", items=("eraser", "remote", "scale"))])
    assert apart(layout) == pytest.approx(-2.0 * (0.5 + 0.3 + 0.4)), "equation (1) counts each pair twice"
    assert Objective.of(desk, [Near(term="near", items=("eraser", "remote"))])(layout) == pytest.approx(0.7)
    away = Near(term="near", items=("scale",), point=(0.3, 0.4), weight=2.0)
    assert Objective.of(desk, [away])(layout) == pytest.approx(1.0)
    assert Objective.of(desk, [Aligned(term="aligned", items=desk.names)])(layout) == pytest.approx(0.3)
    facing = Facing(term="facing", items=("scale", "eraser"), angle=0.0)
    assert Objective.of(desk, [facing])(layout) == pytest.approx(0.1), "a box turned half round looks the same"


def test_many_layouts_at_once_are_each_alone(rng: np.random.Generator) -> None:
    desk, objective = laid(4, 2)
    layouts = np.array([layout_of(desk, rng) for _ in range(6)])
    np.testing.assert_allclose(objective.many(layouts), [objective(layout) for layout in layouts])


def test_a_file_and_a_function_can_say_the_same(tmp_path: Path, rng: np.random.Generator) -> None:
    desk = three()
    (tmp_path / "tidy.yaml").write_text(TEXT, encoding="utf-8")
    read = Objective.from_file(desk, tmp_path / "tidy.yaml")

    def untidy(poses):
        near = sum(float(np.hypot(*pose[:2])) for pose in poses.values())
        off = sum(abs(pose[2] - math.pi / 2 * round(pose[2] / (math.pi / 2))) for pose in poses.values())
        return near + 0.2 * off

    written = Objective.from_function(desk, untidy)
    for _ in range(5):
        layout = layout_of(desk, rng)
        assert read(layout) == pytest.approx(written(layout))
    assert (read.name, written.name) == ("tidy", "untidy")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "terms: [{term: near, items: [eraser, plate]}]",
            "expected one of the items eraser, remote, scale, got 'plate'",
        ),
        ("terms: [{term: near, items: [eraser], weight: .nan}]", "weight"),
        ("terms: [{term: near, items: [eraser], point: [.inf, 0]}]", "point"),
        ("terms: [{term: far, items: [eraser]}]", "term"),
        ("terms: [{term: near, items: [eraser], wieght: 1}]", "expected a known key, got 'wieght'"),
        ("terms: [{term: apart, items: [eraser]}]", "items"),
        ("terms: []", "terms"),
        ("[1, 2]", "keys and values"),
        ("terms: [", "objective"),
    ],
)
def test_files_that_make_no_sense_are_refused_in_a_line(text: str, words: str) -> None:
    with pytest.raises(PlannerError, match=words) as error:
        Objective.from_text(three(), text)
    assert "\n" not in str(error.value)


def test_values_that_are_none_are_refused_with_their_layout() -> None:
    desk = three()
    layout = np.array([[0.1, 0.0, 0.0], [0.2, 0.1, 0.0], [0.2, -0.1, 0.0]])
    with pytest.raises(PlannerError, match="expected a finite value, got nan"):
        Objective.from_function(desk, lambda poses: math.nan)(layout)
    with pytest.raises(PlannerError, match="expected 1 values"):
        Objective(desk, lambda layouts: np.zeros(3))(layout)
    with pytest.raises(PlannerError, match="function of one argument"):
        Objective.from_function(desk, lambda a, b: 0.0)
    with pytest.raises(PlannerError, match="readable YAML"):
        Objective.from_file(desk, Path("no_such_file.yaml"))
