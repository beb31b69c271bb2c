"""Posteriors: one representative a wheel, circular summaries, rows for the kernel, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.parameters import BodyParameters, expand, free_columns
from pbrl_model.posterior import Posterior
from pbrl_model.rollout import rollout
from pbrl_model.symmetry import canonical_wheel, circular_mean, circular_sd, equivalent_wheels, wheel_features, wrap

NAMES = free_columns("wheel")
BASE = BodyParameters(1.0)


def wheels(seed: int, n: int = 50) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    columns = [
        rng.uniform(5, 40, n),
        *rng.uniform(-0.4, 0.4, (2, n)),
        rng.uniform(-7, 7, n),
        *rng.uniform(0, 0.5, (2, n)),
    ]
    return np.column_stack(columns)


def posterior(draws: NDArray[np.float64]) -> Posterior:
    return Posterior("table", "wheel", NAMES, draws)


def test_equivalent_wheels_move_alike_and_have_one_representative() -> None:
    draws = wheels(0)
    wrench = np.random.default_rng(1).normal(size=(1, 100, 3)) * 50
    expected = rollout(expand(draws, NAMES, BASE), np.zeros((1, 6)), wrench, 0.07)
    representative = canonical_wheel(draws, NAMES)
    for same in (*equivalent_wheels(draws, NAMES), representative):
        moved = rollout(expand(same, NAMES, BASE), np.zeros((1, 6)), wrench, 0.07)
        np.testing.assert_allclose(moved, expected, atol=1e-9)
        np.testing.assert_allclose(canonical_wheel(same, NAMES), representative, atol=1e-12)
    np.testing.assert_array_equal(canonical_wheel(representative, NAMES), representative)
    assert np.all(representative[:, 4] <= representative[:, 5])
    assert np.all(np.abs(representative[:, 3]) <= np.pi / 2)


def test_draws_without_a_whole_wheel_stay_as_they_are() -> None:
    draws = np.random.default_rng(0).normal(size=(3, 4, 6))
    np.testing.assert_array_equal(canonical_wheel(draws, free_columns("hinge")), draws)


def test_wheel_features_are_the_same_for_the_same_wheel_and_only_for_it() -> None:
    draws = wheels(3)
    features = wheel_features(draws, NAMES)
    for same in equivalent_wheels(draws, NAMES):
        np.testing.assert_allclose(wheel_features(same, NAMES), features, atol=1e-12)
    turned = draws.copy()
    turned[:, NAMES.index("wheel_theta")] += 0.5
    assert np.all(np.abs(wheel_features(turned, NAMES) - features).max(axis=1) > 1e-4)
    turned[:, NAMES.index("mu_x")] = turned[:, NAMES.index("mu_y")]
    twice = turned.copy()
    twice[:, NAMES.index("wheel_theta")] += 1.0
    np.testing.assert_allclose(wheel_features(twice, NAMES), wheel_features(turned, NAMES), atol=1e-12)
    np.testing.assert_array_equal(wheel_features(draws[:, :1], NAMES[:1]), draws[:, :1])


def test_summary_does_not_depend_on_which_of_the_equivalent_wheels_was_drawn() -> None:
    draws = wheels(3)
    mixed = np.concatenate([same[k::4] for k, same in enumerate(equivalent_wheels(draws, NAMES))])
    np.testing.assert_allclose(posterior(mixed[None]).mean(), posterior(draws[None]).mean(), atol=1e-9)
    np.testing.assert_allclose(posterior(mixed[None]).sd(), posterior(draws[None]).sd(), atol=1e-9)


def test_angles_are_averaged_on_their_circle() -> None:
    rng = np.random.default_rng(0)
    angle = np.pi / 2 + 0.05 * rng.standard_normal(20000)
    folded = wrap(angle, np.pi)
    assert np.all((folded > -np.pi / 2) & (folded <= np.pi / 2))
    assert abs(circular_mean(folded, np.pi)) == pytest.approx(np.pi / 2, abs=2e-3)
    assert circular_sd(folded, np.pi) == pytest.approx(0.05, rel=0.03)
    assert circular_sd(np.full(5, 1.0), np.pi) == pytest.approx(0.0, abs=1e-7)


def test_summary_has_the_form_of_the_report() -> None:
    draws = wheels(5)
    summary = posterior(draws.reshape(2, 25, 6)).summary()
    assert list(summary) == list(NAMES)
    assert summary["mass"] == {
        "mean": pytest.approx(draws[:, 0].mean()),
        "sd": pytest.approx(draws[:, 0].std()),
        "unit": "kg",
    }


def test_rows_are_what_the_kernel_takes() -> None:
    base = BodyParameters(1.0, anchor_x=0.3)
    found = Posterior("door", "hinge", ("mass", "hinge_radius"), np.array([[[4.0, 0.3]], [[5.0, 0.2]]]), base)
    np.testing.assert_array_equal(found.rows()[:, [0, 8, 9]], [[4.0, 0.3, 0.3], [5.0, 0.2, 0.3]])
    assert found.units == ("kg", "m") and found.flat.shape == (2, 2)


def test_draws_are_a_copy_and_read_only() -> None:
    draws = wheels(1)[None]
    found = posterior(draws)
    draws[:] = 0.0
    assert found.draws.any()
    with pytest.raises(ValueError, match="read-only"):
        found.draws[0, 0, 0] = 1.0


def test_thinning_keeps_order_and_repeats_with_the_seed() -> None:
    found = posterior(wheels(1, 200).reshape(2, 100, 6))
    one, two = (found.thinned(30, np.random.default_rng(3)) for _ in range(2))
    assert one.draws.shape == (1, 30, 6) and one.draws.tobytes() == two.draws.tobytes()
    where = [np.flatnonzero((found.flat == row).all(axis=1))[0] for row in one.flat]
    assert np.all(np.diff(where) > 0)
    assert found.thinned(10**6, np.random.default_rng(0)).draws.shape == (1, 200, 6)


def test_bad_posteriors_are_refused() -> None:
    with pytest.raises(ModelError, match="model class"):
        Posterior("t", "weel", NAMES, wheels(0)[None])
    with pytest.raises(ModelError, match="did you mean"):
        Posterior("t", "free", ("mas",), np.ones((1, 3, 1)))
    with pytest.raises(ModelError, match="chains, n, 6"):
        posterior(wheels(0))
    with pytest.raises(ModelError, match="chains, n, 6"):
        posterior(np.empty((0, 4, 6)))
    with pytest.raises(ModelError, match="finite"):
        posterior(np.full((1, 4, 6), np.nan))
    with pytest.raises(ModelError, match="expected one of mass"):
        posterior(wheels(0)[None]).column("hinge_x")
