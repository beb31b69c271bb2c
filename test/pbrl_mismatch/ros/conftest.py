"""A mismatch node that is watched, and what it is given in the place of a diagnosis."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context

from pbrl_mismatch.ros import watcher

sys.path.insert(0, str(Path(__file__).parent))
from watched import AtHand, Graph


@pytest.fixture
def at_hand(monkeypatch: pytest.MonkeyPatch) -> AtHand:
    worker = AtHand()
    monkeypatch.setattr(watcher, "DiagnosisWorker", lambda: worker)
    return worker


@pytest.fixture
def graph(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, at_hand: AtHand, domain: int
) -> Iterator[Graph]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    graph = Graph(context, **getattr(request, "param", {}))
    yield graph
    graph.close()
    rclpy.try_shutdown(context=context)
