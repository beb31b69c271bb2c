"""The bench of the cart's controller: it is known by its name, and its robot does what rows say of it."""

from __future__ import annotations

import numpy as np

from pbrl_bringup.benches.cart import follow, open_floor, paths, silent
from pbrl_bringup.commands.bench import BENCHES
from pbrl_control.cart import DriveStatus


def test_it_follows_and_stops() -> None:
    assert "cart" in BENCHES
    rng = np.random.default_rng(1)
    off, status = follow(paths()["in place"], open_floor(), rng)
    assert status is DriveStatus.ARRIVED
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03
    assert 0.0 < silent(paths()["straight"], rng) <= 0.3
