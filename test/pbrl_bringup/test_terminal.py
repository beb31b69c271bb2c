"""What is printed is what was said, whatever a stranger's file calls its topics."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrl_bringup.cli.app import run_arguments
from pbrl_bringup.fuzz.push_seed import encoded, plain_mcap, push
from pbrl_bringup.terminal import output, say, table

EVIL = "/x[/red][link=file:///etc]a\x1b[2J:smile:"


def test_names_are_no_markup_and_clear_no_screen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    messages = [(EVIL if topic == "/plan" else topic, *rest) for topic, *rest in encoded(push())]
    (tmp_path / "x.mcap").write_bytes(plain_mcap(messages))  # type: ignore[arg-type]
    assert run_arguments(["info", str(tmp_path / "x.mcap")]) == 0
    told = capsys.readouterr()
    assert EVIL.replace("\x1b", r"\x1b") in told.out
    assert "\x1b" not in told.out + told.err


def test_an_error_shows_what_cannot_be_seen_and_ends(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x.yaml").write_text("nodes: {}\n" + '"\\e[2J' + "y" * 5000 + '": 1\n')
    assert run_arguments(["run", str(tmp_path / "x.yaml")]) == 2
    told = capsys.readouterr().err
    assert "\x1b" not in told
    assert len(told) < 3000


def test_said_and_listed_texts_are_plain(capsys: pytest.CaptureFixture[str]) -> None:
    say(EVIL)
    output().print(table(EVIL, ("[/]",), ((EVIL,),)))
    told = capsys.readouterr()
    assert told.err.count("[/red]") == 1
    assert told.out.count("[/red]") == 2
    assert "\x1b[2J" not in told.out + told.err
