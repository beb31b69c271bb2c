"""Pieces on a cluster: each once, few at a time, whatever becomes of a worker."""

from __future__ import annotations

import itertools
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import psutil
import pytest
from distributed import Client
from scale_kit import DEADLY, STRANGE, deadly, held_up_once, one_is_wrong, square, surroundings

from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import in_parallel, sent_to
from pbrl_bringup.scale.cluster import process_ids
from pbrl_bringup.scale.pieces import Done, Failed, run_pieces
from pbrl_bringup.scale.sending import results_of


def test_every_piece_is_done_once_and_few_wait(two_workers: Client) -> None:
    taken = 0

    def numbers() -> Iterator[tuple[int]]:
        nonlocal taken
        for number in itertools.count():  # has no end: what takes all first never begins
            taken += 1
            yield (number,)

    found = {}
    with closing(run_pieces(two_workers, square, numbers())) as ended:
        for each in itertools.islice(ended, 40):
            assert isinstance(each, Done)
            assert each.index not in found
            found[each.index] = each.result
            assert taken - len(found) <= 1  # beside the one that has just ended
    assert len(found) == 40
    assert all(result == index**2 for index, result in found.items())


def test_nothing_to_do_is_done_at_once(two_workers: Client) -> None:
    assert list(run_pieces(two_workers, square, [])) == []


def test_a_piece_that_raises_costs_itself(two_workers: Client) -> None:
    ended = {each.index: each for each in run_pieces(two_workers, one_is_wrong, [(k,) for k in range(6)])}
    failed = ended.pop(STRANGE)
    assert isinstance(failed, Failed)
    assert isinstance(failed.error, ValueError)
    assert sorted(ended) == [0, 1, 2, 4, 5]
    assert all(isinstance(each, Done) for each in ended.values())


def test_a_killed_worker_costs_its_piece_only(two_workers: Client, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")

    def kill() -> None:
        os.kill(int((tmp_path / "fifo").read_text()), signal.SIGKILL)  # the fifo gives it when the piece is running

    killer = threading.Thread(target=kill)
    killer.start()
    jobs = [(number, tmp_path) for number in range(8)]
    ended = {each.index: each for each in run_pieces(two_workers, held_up_once, jobs)}
    killer.join()
    assert ended == {number: Done(number, number * number) for number in range(8)}
    runs = sorted(map(int, (tmp_path / "runs").read_text().split()))
    assert runs == sorted([*range(8), STRANGE])


def test_a_piece_that_kills_its_workers_is_named_and_costs_itself(two_workers: Client) -> None:
    ended = {each.index: each for each in run_pieces(two_workers, deadly, [(k,) for k in range(5)])}
    failed = ended.pop(DEADLY)
    assert isinstance(failed, Failed)
    assert isinstance(failed.error, BringupError)
    for words in (f"piece {DEADLY + 1}, ({DEADLY},)", "2 died", "memory"):
        assert words in str(failed.error)
    assert {each.index for each in ended.values() if isinstance(each, Done)} == {0, 1, 3, 4}


def test_what_runs_in_parallel_is_the_same_on_a_cluster(two_workers: Client) -> None:
    with sent_to(partial(results_of, two_workers)):
        assert in_parallel(square, [(k,) for k in range(7)], "squares") == [k * k for k in range(7)]
        with pytest.raises(ValueError, match="three is wrong"):
            in_parallel(one_is_wrong, [(k,) for k in range(7)], "numbers")


def test_workers_have_one_thread_and_share_compiled_code(two_workers: Client) -> None:
    ended = [each for each in run_pieces(two_workers, surroundings, [()] * 4) if isinstance(each, Done)]
    assert all(each.result["deaf"] for each in ended), "Ctrl-C is for the command"
    assert {each.result["pid"] for each in ended} <= set(process_ids(two_workers).values())
    told = {(each.result["threads"], each.result["most"], each.result["blas"], each.result["cache"]) for each in ended}
    assert told == {(1, 1, "1", os.environ.get("NUMBA_CACHE_DIR"))}


def test_a_cluster_of_ours_listens_on_this_machine_only(two_workers: Client) -> None:
    processes = [psutil.Process(), *map(psutil.Process, process_ids(two_workers).values())]
    listening = [
        each.laddr.ip for process in processes for each in process.net_connections("inet") if each.status == "LISTEN"
    ]
    assert len(listening) >= 3
    assert set(listening) == {"127.0.0.1"}
