"""Cases of a long bench go from machine to machine in one file, and only to the bench, seed and code they are of."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from pbrl_bringup.benches.carried import Carried, carry_in, carry_out
from pbrl_bringup.commands import bench, measured
from pbrl_bringup.errors import BringupError
from pbrl_bringup.measurable import WITH_CARRY

CARRIED = Carried(("cases/*/score.json", "lives/*.json"), ("pbrl_bringup.errors",))
TOLD = {"name": "concealed", "seed": 7}


def done(folder: Path) -> Path:
    """Leave what two cases leave in a folder, and something that is not carried."""
    for file, text in (
        ("cases/a1/score.json", '{"x": "\u00e4\\n"}\n'),
        ("lives/003.json", "[]\n"),
        ("cases/a1/bag", "b"),
    ):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text, encoding="utf-8")
    return folder


def test_what_was_done_comes_back_to_the_byte_and_nothing_else(tmp_path: Path) -> None:
    one, other, path = done(tmp_path / "one"), tmp_path / "other", tmp_path / "kept/cases.jsonl"
    carry_out(path, one, TOLD, CARRIED)
    assert carry_in(path, other, TOLD, CARRIED) == 2
    for file in ("cases/a1/score.json", "lives/003.json"):
        assert (other / file).read_bytes() == (one / file).read_bytes()
    assert not (other / "cases/a1/bag").exists()
    carry_out(tmp_path / "again.jsonl", other, TOLD, CARRIED)
    assert (tmp_path / "again.jsonl").read_bytes() == path.read_bytes()


def test_what_the_folder_has_is_left_alone(tmp_path: Path) -> None:
    path, folder = tmp_path / "cases.jsonl", done(tmp_path / "one")
    carry_out(path, folder, TOLD, CARRIED)
    (folder / "lives/003.json").write_text("[1]\n")
    carry_in(path, folder, TOLD, CARRIED)
    assert (folder / "lives/003.json").read_text() == "[1]\n"


def test_no_file_yet_carries_nothing(tmp_path: Path) -> None:
    assert carry_in(tmp_path / "none.jsonl", tmp_path, TOLD, CARRIED) == 0


@pytest.mark.parametrize(
    "told, carried",
    [
        ({**TOLD, "seed": 8}, CARRIED),
        ({**TOLD, "name": "kills"}, CARRIED),
        (TOLD, Carried(CARRIED.files, ("pbrl_bringup.measurable",))),
    ],
)
def test_cases_of_another_bench_or_seed_or_code_stay_away(
    told: dict[str, Any], carried: Carried, tmp_path: Path
) -> None:
    carry_out(tmp_path / "cases.jsonl", done(tmp_path / "one"), TOLD, CARRIED)
    with pytest.raises(BringupError, match="choose another file"):
        carry_in(tmp_path / "cases.jsonl", tmp_path / "other", told, carried)
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("file", ["../lives/x.json", "/lives/x.json", "lives/../../lives/x.json", "models/x.json"])
def test_no_file_leads_out_of_the_folder(file: str, tmp_path: Path) -> None:
    lines = [{**TOLD, "code": CARRIED.code()}, {"file": file, "text": "x"}]
    (tmp_path / "cases.jsonl").write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(BringupError, match="expected files like"):
        carry_in(tmp_path / "cases.jsonl", tmp_path / "out", TOLD, CARRIED)
    assert [each.name for each in tmp_path.rglob("*.json")] == []


@pytest.mark.parametrize("text", ["", "{", "[]", "3\n4", '{"name": "concealed"}\n{"file": 1}', "\u0000"])
def test_what_is_no_such_file_is_refused_in_a_line(text: str, tmp_path: Path) -> None:
    (tmp_path / "cases.jsonl").write_text(text)
    with pytest.raises(BringupError, match="expected"):
        carry_in(tmp_path / "cases.jsonl", tmp_path / "out", TOLD, CARRIED)


@pytest.mark.parametrize("name", WITH_CARRY)
def test_every_such_bench_says_what_it_leaves_and_of_which_code(name: str) -> None:
    carried = import_module(f"pbrl_bringup.benches.{name}").CARRIED
    assert carried.files and len(carried.code()) == 16 and carried.code() == carried.code()


def test_code_that_changes_is_other_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "changing").mkdir()
    (tmp_path / "changing/__init__.py").write_text("")
    (tmp_path / "changing/law.py").write_text("A = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    carried = Carried(("*.json",), ("changing",))
    before = carried.code()
    (tmp_path / "changing/law.py").write_text("A = 2\n")
    assert carried.code() != before
    with pytest.raises(BringupError, match="no_such"):
        Carried((), ("no_such",)).code()


def test_a_bench_that_is_interrupted_adds_what_it_has_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(name: str, seed: int, measure: Any, quick: bool, out: Path) -> dict[str, Any]:
        done(out)
        raise KeyboardInterrupt

    monkeypatch.setattr(measured, "report", interrupted)
    with pytest.raises(KeyboardInterrupt):
        bench.command("kills", tmp_path / "out", 1, False, [], None, None, tmp_path / "kills.jsonl")
    assert [json.loads(each).get("file") for each in (tmp_path / "kills.jsonl").read_text().splitlines()][1:] == [
        "lives/003.json"
    ]
