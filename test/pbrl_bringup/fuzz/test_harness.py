"""The harness finds what it is there to find: ends of the process, hangs, memory, writing and running of anything."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from pbrl_bringup.benches.fuzz import markdown, rows_of
from pbrl_bringup.errors import BringupError
from pbrl_bringup.fuzz.byte_mutations import mutate_bytes, mutate_text
from pbrl_bringup.fuzz.campaign import Finding, Tally, shares_of
from pbrl_bringup.fuzz.message_mutations import mutate_message
from pbrl_bringup.fuzz.push_seed import models, push
from pbrl_bringup.fuzz.readers import READERS
from pbrl_bringup.fuzz.subjects import FILES, subject
from pbrl_bringup.fuzz.text_mutations import mutate_table, mutate_xml
from pbrl_bringup.fuzz.tree_mutations import mutate_json, mutate_yaml
from pbrl_bringup.fuzz.worker import generator

PROGRAM = """
import os, sys
from pathlib import Path
from pbrl_bringup.errors import BringupError
from pbrl_bringup.fuzz import worker
worker.PATIENCE = {patience}
class Bad:
    def make(self, rng): return None
    def read(self, _):
        {body}
place = Path(sys.argv[1])
worker.work("bad", Bad(), 0, range(2), place)
"""


def read_by(body: str, place: Path, patience: float = 20.0) -> tuple[int, list[dict]]:
    """Run a reader that does something; return the exit code of its process and what it told."""
    (place / "work").mkdir()
    command = [sys.executable, "-c", PROGRAM.format(body=body, patience=patience), str(place / "work")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ("1 / 0", "ZeroDivisionError"),
        ("raise BringupError('')", "without a message"),
        ("(place.parent / 'x').write_text('')", "outside of its folder"),
        ("open(place.parent / 'x', 'ab')", "outside of its folder"),
        ("os.mkdir('../x')", "outside of its folder"),
        ("os.rename(place / 'in', place.parent / 'y')", "outside of its folder"),
        ("(place / 'x').write_text('')", "beside its folder"),
        ("__import__('subprocess').run(['true'])", "subprocess.Popen"),
        ("__import__('pickle').loads(__import__('pickle').dumps(os.system))", "pickle.find_class"),
        ("bytearray(1200 << 20)[-1]", ""),
    ],
)
def test_what_no_reader_may_do_is_found(body: str, fault: str, tmp_path: Path) -> None:
    code, told = read_by(body, tmp_path)
    outcomes = [line["outcome"] for line in told if "outcome" in line]
    assert code == 0
    assert outcomes[0]["index"] == 0
    assert fault in outcomes[0]["fault"]
    assert fault or outcomes[0]["memory"] > 1 << 30


@pytest.mark.parametrize(
    "body", ["pass", "raise BringupError('expected a, got b')", "(place / 'out').mkdir(exist_ok=True)"]
)
def test_what_a_reader_may_do_is_not(body: str, tmp_path: Path) -> None:
    code, told = read_by(body, tmp_path)
    assert code == 0
    assert not any("outcome" in line for line in told)
    assert told[-1]["total"]["count"] == 2


@pytest.mark.parametrize(
    ("body", "number"), [("while True: pass", signal.SIGPROF), ("os.abort()", signal.SIGABRT)], ids=["hang", "crash"]
)
def test_what_ends_the_process_is_known_by_its_index(body: str, number: signal.Signals, tmp_path: Path) -> None:
    code, told = read_by(body, tmp_path, patience=0.3)
    assert code == -number
    assert told == [{"index": 0}]


@pytest.mark.parametrize("name", ["scene", "table with mapping", "map", "drawing", "model", "report"])
def test_an_input_is_made_again_from_seed_reader_and_index(name: str, tmp_path: Path) -> None:
    one = subject(name, tmp_path)
    made = [one.hostile(generator(3, name, index)) for index in (0, 1, 2, 1)]  # type: ignore[attr-defined]
    assert made[1] == made[3]
    assert made[0] != made[1] != made[2]


@pytest.mark.parametrize("mutate", [mutate_bytes, mutate_text])
def test_bytes_of_any_kind_can_be_mutated(mutate: object) -> None:
    rng = np.random.default_rng(0)
    for data in (b"", b"\0", b"a: 1", bytes(range(256)) * 20):
        made = {mutate(data, rng, (b"other",)) for _ in range(50)}  # type: ignore[operator]
        assert len(made) > 5


def test_trees_tables_and_drawings_can_be_mutated() -> None:
    rng = np.random.default_rng(0)
    for mutate, data in (
        (mutate_yaml, b"a: {b: [1, 2.5, x]}"),
        (mutate_json, b'{"a": {"b": [1, 2.5, "x"]}}'),
        (mutate_xml, b'<svg width="3"><g><path d="M 0 1"/></g></svg>'),
        (mutate_table, b"a,b\n1,2\n3,4\n"),
    ):
        made = {mutate(data, rng, (data,)) for _ in range(400)}
        assert len(made) > 150


def test_messages_are_mutated_into_what_the_wire_can_carry() -> None:
    rng = np.random.default_rng(0)
    for _, _, message, _ in push()[:12]:
        before = str(message)
        for _ in range(30):
            made = mutate_message(message, rng)
            deserialize_message(serialize_message(made), type(made))
        assert str(message) == before


def test_a_mutated_message_is_one_that_a_middleware_could_carry() -> None:
    """Texts thousands of times, models with thousands of draws hundreds of times: gigabytes are nobody's input."""
    rng = np.random.default_rng(0)
    assert max(len(serialize_message(mutate_message(models(), rng))) for _ in range(400)) < 50_000_000


def test_every_reader_has_a_share_and_inputs_add_up() -> None:
    assert set(FILES) == set(READERS)
    for count in (len(FILES), 1000, 100_000):
        given = shares_of(FILES, count)
        assert sum(given.values()) == count
        assert min(given.values()) >= 1


def test_an_unknown_reader_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BringupError, match="MCAP bag"):
        subject("nothing", tmp_path)


def test_findings_at_one_place_are_one_and_rows_tell_them_apart() -> None:
    tally = Tally(inputs=10, refused=4, memory=300 << 20)
    for index in range(3):
        tally.add(Finding("scene", index, "ValueError: x", "scene.py:1"))
    tally.add(Finding("scene", 5, "still reading after 5 s of processor time", "yaml"))
    tally.add(Finding("scene", 6, "open outside of its folder: '/x'", ""))
    tally.add(Finding("scene", 7, "2000 MiB of memory", ""))
    assert (tally.faults, len(tally.findings)) == (6, 4)
    rows = rows_of({"scene": tally})
    assert [row.value for row in rows[1:4]] == [1, 1, 1]
    assert not any(row.holds for row in rows[1:4])
    assert "| scene | 10 | 4 | 6 |" in markdown({"scene": tally}, 3)
