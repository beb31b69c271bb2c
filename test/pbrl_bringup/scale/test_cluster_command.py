"""`./pbrl cluster` as a person uses it: one keeps a scheduler, another adds workers, Ctrl-C ends both."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from scale_kit import square

from pbrl_bringup.cli.app import run_arguments
from pbrl_bringup.scale.cluster import cluster
from pbrl_bringup.scale.pieces import run_pieces

COMMAND = [sys.executable, "-m", "pbrl_bringup", "cluster", "--workers", "1"]


@contextmanager
def running(*options: str) -> Iterator[subprocess.Popen[str]]:
    pipe = subprocess.PIPE
    with subprocess.Popen([*COMMAND, *options], stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def test_workers_of_two_machines_serve_one_command() -> None:
    with running("--port", "0") as first:
        assert first.stdout is not None
        address = first.stdout.readline().strip()
        assert address.startswith("tcp://127.0.0.1:")
        with running("--join", address) as second:
            with cluster(address) as client:
                client.wait_for_workers(2, timeout=60.0)
                assert sorted(each.index for each in run_pieces(client, square, [(k,) for k in range(6)])) == [
                    *range(6)
                ]
            second.send_signal(signal.SIGINT)
            second.communicate(timeout=30.0)
        first.send_signal(signal.SIGINT)
        _, said = first.communicate(timeout=30.0)
        assert first.returncode == 0
        assert said.splitlines()[-1] == "pbrl: stopping"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--join", "local"), "expected the address of a scheduler"),
        (("--join", "nonsense"), "expected local"),
        (("--host", "203.0.113.7"), "203.0.113.7"),
        (("--host", "no such host"), "no such host"),
        (("--port", "70000"), "--port"),
        (("--workers", "0"), "--workers"),
    ],
)
def test_mistakes_are_one_line(options: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_arguments(["cluster", *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    assert words in error
