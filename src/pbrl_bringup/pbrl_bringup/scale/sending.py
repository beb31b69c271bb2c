"""`in_parallel` on a cluster: what benches and experiments do in independent parts goes there."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from typing import Any

from distributed import Client

from pbrl_bringup.parallel import sent_to
from pbrl_bringup.scale.cluster import cluster
from pbrl_bringup.scale.pieces import Failed, run_pieces


@contextmanager
def sent(where: str) -> Iterator[Client]:
    """Have `in_parallel` run its trials on a cluster inside the block.

    Args:
        where: `local`, `local:WORKERS`, or the address of a scheduler.

    Raises:
        BringupError: there is no such cluster.
    """
    with cluster(where) as client, sent_to(partial(results_of, client)):
        yield client


def results_of(
    client: Client, trial: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]
) -> Generator[tuple[int, Any]]:
    """Yield (number, result) as trials end; the first that fails ends the rest."""
    with closing(run_pieces(client, trial, arguments)) as ended:
        for each in ended:
            if isinstance(each, Failed):
                raise each.error
            yield each.index, each.result
