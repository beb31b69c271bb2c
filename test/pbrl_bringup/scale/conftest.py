"""Pieces of work that workers can import, and a cluster of two that gives a piece up after two of them died of it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import dask
import pytest
from distributed import Client

from pbrl_bringup.scale.cluster import cluster

sys.path.insert(0, str(Path(__file__).parent))  # workers are given it


@pytest.fixture(scope="package")
def two_workers() -> Iterator[Client]:
    with dask.config.set({"distributed.scheduler.allowed-failures": 1}), cluster("local:2") as client:
        yield client
