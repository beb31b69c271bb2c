"""A place to run a graph in: the certainty that nothing is left of it, and somebody who asks it for something."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

sys.path.insert(0, str(Path(__file__).parent))


def nodes_of_this_test() -> list[psutil.Process]:
    """Processes below this one that are ROS nodes."""
    return [each for each in psutil.Process().children(recursive=True) if "--ros-args" in each.cmdline()]


@pytest.fixture
def nothing_left() -> Iterator[None]:
    """Fail the test that leaves a node behind."""
    yield
    assert not [" ".join(each.cmdline()) for each in nodes_of_this_test()]
