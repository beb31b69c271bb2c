"""`./pbrl view` as a person meets it: a line with the address, Ctrl-C, and one line for each mistake."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from pbrl_bag import write_recording
from pbrl_bringup.cli.app import run_arguments

sys.path.insert(0, str(Path(__file__).parent))
from view_kit import recorded


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(recorded(seconds=8.0), tmp_path_factory.mktemp("view") / "bag")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_serves_until_it_is_told_to_stop(bag: Path, number: signal.Signals) -> None:
    command = [sys.executable, "-m", "pbrl_bringup", "view", str(bag), "--port", "0", "--no-open"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        line = process.stderr.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", line)
        try:
            assert found, line
            with urllib.request.urlopen(found.group() + "data", timeout=30) as answer:
                assert b'"table"' in answer.read()
        finally:
            process.send_signal(number)
        rest = process.stderr.read()
        code = process.wait(30)
    assert "Traceback" not in rest
    assert code == (0 if number == signal.SIGINT else 128 + number)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "nowhere"),
        (["{empty}"], "empty"),
        (["{bag}", "--model", "nothing.nc"], "nothing.nc"),
        (["{bag}", "--model", "{text}"], "text.json"),
        (["{bag}", "--report", "{text}"], "text.json"),
        (["{bag}", "--report", "nothing.json"], "nothing.json"),
        (["{bag}", "--map", "nothing.yaml"], "nothing.yaml"),
        (["{bag}", "--port", "70000"], "--port"),
    ],
)
def test_mistakes_are_told_in_a_line(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "text.json").write_text("not JSON")
    places = {"bag": bag, "empty": tmp_path / "empty.mcap", "text": tmp_path / "text.json"}
    asked = [each.format(**places) for each in arguments]
    assert run_arguments(["view", *asked, "--no-open"]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and said in lines[0]
