"""Transitions of bodies that slide freely, whose displacements are linear in equation 20's inputs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pbrl_model.transitions.data import Transitions

MASS, INERTIA = np.array([4.0, 9.0]), np.array([0.5, 2.0])
SECONDS = 0.4


def free_transitions(seed: int, n: int) -> Transitions:
    """Return n transitions of two bodies without friction, integrated exactly."""
    rng = np.random.default_rng(seed)
    state = rng.normal(size=(n, 2, 6))
    state[:, 1, :2] += 100.0  # they never meet
    target = rng.integers(0, 2, n)
    wrench = rng.normal(size=(n, 3)) * [8.0, 8.0, 2.0]
    own = np.where((target[:, None] == np.arange(2))[..., None], wrench[:, None], 0.0)
    gained = own / np.stack([MASS, MASS, INERTIA], axis=1)
    after = state.copy()
    after[..., :3] += SECONDS * state[..., 3:] + 0.5 * SECONDS**2 * gained
    after[..., 3:] += SECONDS * gained
    return Transitions(state, target, wrench, np.full(n, SECONDS), after)


@pytest.fixture(scope="session")
def make_free() -> Callable[[int, int], Transitions]:
    """Return the maker: `make_free(seed, n)`."""
    return free_transitions
