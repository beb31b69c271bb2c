"""The watchdog: commands hold for a while and then are zero."""

from __future__ import annotations

import math

import numpy as np
import pytest

from krang_sim.commands import TIMEOUT, CommandWatchdog
from krang_sim.errors import KrangError


@pytest.fixture
def watchdog() -> CommandWatchdog:
    return CommandWatchdog({"base": 2, "arm": 7})


def test_nothing_commanded_is_zero(watchdog):
    np.testing.assert_array_equal(watchdog.current("arm", 5.0), np.zeros(7))


def test_a_command_holds_until_the_timeout(watchdog):
    watchdog.set("base", (0.1, -0.2), 1.0)
    np.testing.assert_array_equal(watchdog.current("base", 1.0 + 0.99 * TIMEOUT), [0.1, -0.2])
    np.testing.assert_array_equal(watchdog.current("base", 1.0 + 1.01 * TIMEOUT), [0.0, 0.0])


def test_groups_expire_alone(watchdog):
    watchdog.set("base", (0.1, 0.0), 1.0)
    watchdog.set("arm", [0.3] * 7, 1.0 + 0.9 * TIMEOUT)
    later = 1.0 + 1.5 * TIMEOUT
    np.testing.assert_array_equal(watchdog.current("base", later), np.zeros(2))
    np.testing.assert_array_equal(watchdog.current("arm", later), np.full(7, 0.3))


@pytest.mark.parametrize("bad", [(0.1,), (0.1, 0.2, 0.3), (math.nan, 0.0), (0.0, -math.inf)])
def test_a_bad_command_is_refused_and_the_good_one_stays(watchdog, bad):
    watchdog.set("base", (0.1, 0.2), 1.0)
    with pytest.raises(KrangError, match="base command: expected"):
        watchdog.set("base", bad, 1.05)
    np.testing.assert_array_equal(watchdog.current("base", 1.05), [0.1, 0.2])


def test_the_caller_may_reuse_its_array(watchdog):
    mine = np.array([0.1, 0.2])
    watchdog.set("base", mine, 0.0)
    mine[:] = 9.0
    np.testing.assert_array_equal(watchdog.current("base", 0.0), [0.1, 0.2])
