"""Which recordings arguments name, and names for their results that nobody shares."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrl_bringup.errors import BringupError
from pbrl_bringup.scale.recordings import choose_recordings, folder_names

Make = Callable[..., Path]


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Make:
    monkeypatch.chdir(tmp_path)

    def made(*names: str) -> Path:
        for name in names:
            path = Path(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        return tmp_path

    return made


def chosen(*given: str) -> list[str]:
    return [str(path) for path in choose_recordings([Path(each) for each in given], None).bags]


def test_one_bag_is_one(make: Make) -> None:
    make("bag/metadata.yaml", "other/x.mcap", "y.db3")
    for name in ("bag", "other", "y.db3", "is not there"):
        assert choose_recordings([Path(name)], None).bags == (Path(name),)
        assert not choose_recordings([Path(name)], None).several


def test_a_folder_gives_the_bags_below_it(make: Make) -> None:
    make("runs/b/bag/metadata.yaml", "runs/a/bag/x.mcap", "runs/old.bag", "runs/notes.txt", "runs/.part/metadata.yaml")
    assert chosen("runs") == ["runs/a/bag", "runs/b/bag", "runs/old.bag"]
    assert choose_recordings([Path("runs/a")], None).several, "one was found, but several were asked for"


def test_a_bag_is_not_looked_into(make: Make) -> None:
    make("bag/metadata.yaml", "bag/x.mcap", "bag/inner/metadata.yaml")
    assert chosen("bag") == ["bag"]


def test_patterns_and_lists(make: Make) -> None:
    folder = make("runs/b/bag/metadata.yaml", "runs/a/bag/metadata.yaml", "one [2].mcap")
    assert chosen("runs/*/bag") == ["runs/a/bag", "runs/b/bag"]
    assert chosen(f"{folder}/runs/*/bag") == [f"{folder}/runs/a/bag", f"{folder}/runs/b/bag"]
    assert chosen("one [2].mcap") == ["one [2].mcap"], "what is there is no pattern"
    Path("list.txt").write_text("# of Monday\nruns/b/bag\n\n  one [2].mcap \n")
    listed = choose_recordings([Path("runs/a/bag")], Path("list.txt"))
    assert [str(path) for path in listed.bags] == ["runs/a/bag", "runs/b/bag", "one [2].mcap"]
    assert listed.several


@pytest.mark.parametrize(
    ("given", "listed", "words"),
    [
        ([], None, "at least one bag"),
        (["a", "b"], None, "b: expected a recording, got nothing of that name"),
        (["a", "b", "c"], None, "and 1 more"),
        (["a", "./a"], None, "2 times"),
        (["x*"], None, "got none"),
        ([], "none.txt", "none.txt: expected a text file"),
        ([], "empty.txt", "empty.txt: expected a bag on each line"),
        ([], "bytes.txt", "it is no text"),
        ([], ".", "expected a text file"),
    ],
)
def test_what_names_nothing_is_told(given: list[str], listed: str | None, words: str, make: Make) -> None:
    make("a", "empty.txt")
    Path("bytes.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BringupError) as told:
        choose_recordings([Path(each) for each in given], None if listed is None else Path(listed))
    assert words in str(told.value)


PARTS = st.sampled_from(["a", "b", "a_b", "b_2", "a_b_2", "bag", "bag_2"])


@given(st.lists(st.tuples(PARTS, PARTS, PARTS), min_size=1, max_size=12, unique=True))
def test_no_two_recordings_share_a_folder(places: list[tuple[str, str, str]]) -> None:
    names = folder_names([Path("/nowhere", *parts) for parts in places])
    assert len(set(names)) == len(places)
    assert all("/" not in name and name for name in names)


def test_names_are_as_short_as_they_can_be() -> None:
    given = [Path(each) for each in ("/r/x/bag", "/r/y/bag", "/r/z", "/s/x/bag")]
    assert folder_names(given) == ["x_bag", "y_bag", "z", "x_bag_2"]
