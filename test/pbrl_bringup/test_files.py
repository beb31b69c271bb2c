"""Nothing half-written is seen under its final name."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import output_folder, removed_afterwards, whole_folder, write_json, write_text


def test_text_is_replaced_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    for text in ("first", "second"):
        write_text(path, text)
        assert path.read_text() == text
    assert list(tmp_path.iterdir()) == [path]


def test_json_has_no_nan(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"a": [1.0, float("nan")], "b": (float("inf"),)})
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": [1.0, None], "b": [None]}


def test_a_folder_appears_when_the_block_ends_well(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "bag") as folder:
        (folder / "file").write_text("x")
        assert not (tmp_path / "bag").exists()
    assert (tmp_path / "bag/file").read_text() == "x"


def test_a_folder_does_not_appear_when_the_block_fails(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), whole_folder(tmp_path / "bag") as folder:
        (folder / "file").write_text(str(1 / 0))
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_written_over(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag/file").write_text("precious")
    with pytest.raises(BringupError, match="bag: expected a name that is free"), whole_folder(tmp_path / "bag"):
        pass
    assert (tmp_path / "bag/file").read_text() == "precious"


def test_results_do_not_go_into_a_file(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(BringupError, match="expected a folder for results"):
        output_folder(tmp_path / "out")


def test_a_folder_is_removed_however_the_block_ends(tmp_path: Path) -> None:
    """Ctrl-C between two files of a bag once left the first behind."""
    folder = tmp_path / "unfinished"
    with pytest.raises(KeyboardInterrupt), removed_afterwards(folder):
        (folder / "bag").mkdir(parents=True)
        (folder / "bag/half").write_text("x")
        raise KeyboardInterrupt
    assert not folder.exists()
    with removed_afterwards(folder):
        pass  # never made: nothing to remove, and no error
