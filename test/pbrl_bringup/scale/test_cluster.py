"""What answers under the address of `--scheduler`, and what is said where it is no cluster of ours."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from itertools import count

import pytest
from distributed import LocalCluster
from scale_kit import square

from pbrl_bringup.cli.app import run_arguments
from pbrl_bringup.errors import BringupError
from pbrl_bringup.scale import cluster as clusters
from pbrl_bringup.scale import pieces
from pbrl_bringup.scale.address import Scheduler, parse_scheduler
from pbrl_bringup.scale.cluster import cluster
from pbrl_bringup.scale.pieces import run_pieces


@pytest.fixture
def here(request: pytest.FixtureRequest) -> Iterator[LocalCluster]:
    """A scheduler that somebody runs, with as many workers and threads as a test asks for, in this process."""
    workers, threads = getattr(request, "param", (1, 1))
    place = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
    with LocalCluster(
        n_workers=workers,
        threads_per_worker=threads,
        processes=False,
        host="127.0.0.1",
        protocol="tcp",
        dashboard_address=None,
        scheduler_kwargs=place,
    ) as made:
        yield made


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("tcp://127.0.0.1:8786", "tcp://127.0.0.1:8786"),
        ("node-7.lab:8786", "tcp://node-7.lab:8786"),
        ("tls://[::1]:8786/", "tls://[::1]:8786"),
    ],
)
def test_addresses(text: str, address: str) -> None:
    assert parse_scheduler(text) == Scheduler(address, 0)


def test_clusters_of_this_machine() -> None:
    assert parse_scheduler("local").workers >= 1
    assert parse_scheduler("local:3") == Scheduler("", 3)


@pytest.mark.parametrize(
    "text",
    [
        *("", "lokal", "local:", "local:0", "local:99999", "local:-1", "8786", "host", "tcp://host", "host:0"),
        *("host:99999", "http://host:80", "tcp://a b:1", "tcp://[::1:8786", "tcp://host:80/x", "local:2\nlocal:3"),
    ],
)
def test_what_is_neither_is_one_line(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BringupError, match="expected"):
        parse_scheduler(text)
    assert run_arguments(["fit", "bag", "--scheduler", text, "--out", "/proc/none"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_pieces_go_to_the_address_that_is_named(here: LocalCluster) -> None:
    with cluster(here.scheduler_address) as client:
        found = run_pieces(client, square, [(k,) for k in range(5)])
        assert sorted(each.result for each in found) == [0, 1, 4, 9, 16]  # type: ignore[union-attr]


def test_a_scheduler_that_goes_is_told(here: LocalCluster) -> None:
    with (
        cluster(here.scheduler_address) as client,
        closing(run_pieces(client, square, ((k,) for k in count()))) as ended,
    ):
        next(ended)
        here.close()
        with pytest.raises(BringupError, match="expected the scheduler to go on"):
            list(ended)


@pytest.mark.parametrize("here", [(1, 2)], indirect=True)
def test_workers_with_threads_are_refused(here: LocalCluster) -> None:
    with pytest.raises(BringupError, match="expected one thread, got 2"), cluster(here.scheduler_address):
        pass


def test_workers_with_other_code_are_refused(here: LocalCluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clusters, "code_of", lambda: "another checksum")
    with pytest.raises(BringupError, match="expected the same code"), cluster(here.scheduler_address):
        pass


def test_a_worker_that_comes_later_is_looked_at_too(here: LocalCluster, monkeypatch: pytest.MonkeyPatch) -> None:
    with cluster(here.scheduler_address) as client:
        monkeypatch.setattr(pieces, "code_of", lambda: "another checksum")
        with pytest.raises(BringupError, match="expected the same code"):
            list(run_pieces(client, square, [(3,)]))


@pytest.mark.parametrize("here", [(0, 1)], indirect=True)
def test_a_scheduler_without_workers_is_not_waited_for_for_ever(
    here: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clusters, "FIRST_WORKER", 0.2)
    with pytest.raises(BringupError, match="at least one worker"), cluster(here.scheduler_address):
        pass


def test_a_worker_s_address_is_no_scheduler_s(here: LocalCluster) -> None:
    [worker] = here.workers.values()
    with pytest.raises(BringupError, match="got the address of a Worker"), cluster(worker.address):
        pass


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\0" * 64, None])
def test_what_listens_there_may_be_anything(answer: bytes | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clusters, "ANSWER", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            while True:
                try:
                    kept.append(server.accept()[0])
                except OSError:  # closed
                    return
                if answer is not None:
                    kept[-1].sendall(answer)
                    kept[-1].close()

        kept: list[socket.socket] = []
        serving = threading.Thread(target=serve, daemon=True)
        serving.start()
        address = f"127.0.0.1:{server.getsockname()[1]}"
        try:
            with pytest.raises(BringupError, match="expected a Dask scheduler that answers"), cluster(address):
                pass
        finally:
            server.shutdown(socket.SHUT_RDWR)
            serving.join()
            for each in kept:
                each.close()
