"""How a thing slides in one step: an equation of motion, and friction on the limit surface against what it resists."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from pbrl_mismatch.kernels.limit_surface_kernel import inverse, slid, times


def drawn(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float, float, np.ndarray]:
    """Return A (3, 3), b (3,), F, a and the load's middle (2,)."""
    root = rng.normal(size=(3, 3)) * [20.0, 20.0, 3.0]
    matrix = root.T @ root + np.diag([50.0, 50.0, 1.0])
    push = rng.normal(size=3) * [60.0, 60.0, 8.0]
    return matrix, push, float(rng.uniform(1.0, 30.0)), float(rng.uniform(0.05, 0.3)), rng.normal(size=2) * 0.1


def packed(matrix: np.ndarray) -> tuple[float, float, float, float, float, float]:
    return tuple(float(matrix[i, j]) for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))  # type: ignore[return-value]


def test_inverse_and_product_are_those_of_matrices() -> None:
    matrix, push, *_ = drawn(np.random.default_rng(0))
    found = inverse(packed(matrix))
    np.testing.assert_allclose(times(found, *push), np.linalg.solve(matrix, push), rtol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_it_moves_as_least_resistance_says(seed: int) -> None:
    matrix, push, force, lever, (dx, dy) = drawn(np.random.default_rng(seed))
    speed, twist, friction = slid(packed(matrix), *push, force, lever, dx, dy)
    w, r = np.array(twist), np.array(friction)
    np.testing.assert_allclose(matrix @ w, push - r, atol=1e-3 * force)
    # About the load's middle: on the ellipsoid where it moves, inside where it stands, and against the motion.
    about = np.array([r[0], r[1], (r[2] - dx * r[1] + dy * r[0]) / lever])
    at = np.array([w[0] - w[2] * dy, w[1] + w[2] * dx, lever * w[2]])
    if speed == 0.0:
        np.testing.assert_array_equal(w, 0.0)
        assert np.linalg.norm(about) <= force * (1.0 + 1e-12)
        return
    assert np.linalg.norm(about) == pytest.approx(force, rel=1e-9)
    assert speed == pytest.approx(np.linalg.norm(at), rel=1e-9)
    np.testing.assert_allclose(about / force, at / speed, atol=1e-6)

    def lost(v: np.ndarray) -> float:
        moved = np.array([v[0] - v[2] * dy, v[1] + v[2] * dx, lever * v[2]])
        return float(0.5 * v @ matrix @ v - push @ v + force * np.linalg.norm(moved))

    least = minimize(lost, w + 0.01, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12, "maxiter": 4000})
    assert lost(w) <= least.fun + 1e-6 * abs(least.fun)
