"""What tests of more than one package stand in."""

from __future__ import annotations

import resource
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import pytest

PATIENCE, ASKED_AGAIN = 60.0, 5.0  # [s]


@contextmanager
def _little_room(most: int) -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture(scope="session")
def little_room() -> Callable[[int], AbstractContextManager[None]]:
    """Return what lets no file grow beyond so many bytes within its block, as a full disk; a child has it from us."""
    return _little_room


@pytest.fixture
def domain() -> Iterator[int]:
    """Return a ROS_DOMAIN_ID that no other test and no graph of this machine uses meanwhile."""
    # Here, since most tests know nothing of ROS.
    from pbrl_bringup.graph import free_domain

    with free_domain() as number:
        yield number


def _ask(client: Any, request: Any) -> Any:
    assert client.wait_for_service(PATIENCE)
    answered, futures = threading.Event(), []
    deadline = time.monotonic() + PATIENCE
    while not answered.is_set():
        assert time.monotonic() < deadline, f"{client.srv_name} does not answer"
        futures.append(client.call_async(request))
        futures[-1].add_done_callback(lambda _: answered.set())
        answered.wait(ASKED_AGAIN)
    return next(each for each in futures if each.done()).result()


@pytest.fixture(scope="session")
def ask() -> Callable[[Any, Any], Any]:
    """Return what asks a client's service, whose node another thread spins, until it answers.

    Whoever serves drops its answer where it finds the client's reader more than 0.1 s later (rmw_fastrtps, issue 842),
    so that on a busy machine a first answer may be lost: only what may be done twice is asked so.
    """
    return _ask
