"""What tests of whoever thinks share."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

WAIT = 120.0
"""A process is made and answers within so long [s], on a machine that has other work too."""


@pytest.fixture
def polled() -> Callable[[Any], Any]:
    """Return a function that waits for the answer of a thinker."""

    def poll(thinker: Any) -> Any:
        until = time.monotonic() + WAIT
        while time.monotonic() < until:
            answer = thinker.poll()
            if answer is not None:
                return answer
            time.sleep(0.005)
        raise TimeoutError

    return poll
