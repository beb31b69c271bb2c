"""What the bench of the controller's rate and jitter makes of moments, and which nodes it starts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrl_bringup.benches import control_jitter
from pbrl_bringup.benches.control_jitter import LEAST, RATE, jitter_rows, two_arms
from pbrl_bringup.errors import BringupError
from pbrl_bringup.graph import node_command
from pbrl_bringup.ros.moments import Moments


def measured(monkeypatch: pytest.MonkeyPatch, intervals: np.ndarray) -> list:
    sent = 1e9 + np.concatenate(([0.0], np.cumsum(intervals)))
    moments = Moments(sent.tolist(), (sent + 1e-3).tolist())
    monkeypatch.setattr(control_jitter, "while_moved", lambda seed, logs: moments)
    return jitter_rows(0, Path("nowhere"))


def test_even_commands_hold_rate_and_jitter(monkeypatch: pytest.MonkeyPatch) -> None:
    rate, jitter = measured(monkeypatch, np.full(LEAST, 1.0 / RATE))
    assert rate.holds and rate.value == pytest.approx(RATE, rel=1e-6)
    assert jitter.holds and jitter.value < 1e-3


def test_one_late_command_in_fifty_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    intervals = np.full(2 * LEAST, 1.0 / RATE)
    intervals[::50] += 4e-3
    intervals[1::50] -= 4e-3
    rate, jitter = measured(monkeypatch, intervals)
    assert rate.holds
    assert not jitter.holds and jitter.value == pytest.approx(4.0, abs=0.01)
    assert jitter.against["median"] == pytest.approx(0.0, abs=1e-3)


def test_too_few_commands_are_no_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BringupError, match="expected 1000 commands while a table is moved, got 11"):
        measured(monkeypatch, np.full(10, 1.0 / RATE))


def test_the_controller_is_told_the_rate_at_real_time() -> None:
    nodes = two_arms(3).nodes
    assert set(nodes) == {"sim", "controller", "push"}
    assert nodes["controller"].parameters["rate"] == RATE
    assert nodes["sim"].parameters.get("rate", 1.0) == 1.0
    assert all(node_command(name, node) for name, node in nodes.items())
