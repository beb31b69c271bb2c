"""What tests of more than one package stand in."""

from __future__ import annotations

import resource
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording

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


def _later(recording: Recording, time: float) -> Recording:
    def moved(streams: Mapping[str, Any]) -> dict[str, Any]:
        return {name: replace(each, time=each.time + time) for name, each in streams.items()}

    return replace(
        recording,
        object_poses=moved(recording.object_poses),
        gripper_poses=moved(recording.gripper_poses),
        wrenches=moved(recording.wrenches),
        grasps=tuple(replace(each, start=each.start + time, end=each.end + time) for each in recording.grasps),
    )


def _joined(one: Mapping[str, Any], other: Mapping[str, Any], names: Sequence[str], since: float) -> dict[str, Any]:
    def columns(first: Any, second: Any) -> dict[str, Any]:
        keep = first.time >= since
        return {name: np.concatenate([getattr(first, name)[keep], getattr(second, name)]) for name in names}

    return {name: replace(one[name], **columns(one[name], other[name])) for name in one}


def _held_twice(first: Recording, second: Recording, after: float, heard_since: float = -np.inf) -> Recording:
    second, poses = _later(second, after), ("time", "position", "quaternion")
    wrenches = ("time", "force", "torque")
    return replace(
        first,
        object_poses=_joined(first.object_poses, second.object_poses, poses, -np.inf),
        gripper_poses=_joined(first.gripper_poses, second.gripper_poses, poses, -np.inf),
        wrenches=_joined(first.wrenches, second.wrenches, wrenches, heard_since),
        grasps=(*first.grasps, *second.grasps),
    )


@pytest.fixture(scope="session")
def held_twice() -> Callable[..., Recording]:
    """Return what makes one recording of two: `held_twice(first, second, after [s], heard_since [s])`.

    The second begins so long after the first did; the first's wrenches are heard only since some time.
    """
    return _held_twice
