"""A place to run a graph in: folder, free domain, and the certainty that nothing is left of it."""

from __future__ import annotations

from collections.abc import Iterator

import psutil
import pytest


def nodes_of_this_test() -> list[psutil.Process]:
    """Processes below this one that are ROS nodes."""
    return [each for each in psutil.Process().children(recursive=True) if "--ros-args" in each.cmdline()]


@pytest.fixture
def nothing_left() -> Iterator[None]:
    """Fail the test that leaves a node behind."""
    yield
    assert not [" ".join(each.cmdline()) for each in nodes_of_this_test()]
