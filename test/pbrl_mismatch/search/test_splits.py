"""A fitted wheel parted in two does, where the body slides without turning, what the one did."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_mismatch.search.path.splits import LEAST, SHARE, with_splits

ROUND = ("mass", "wheel_x", "wheel_y", "mu_x", "wheel2_x", "wheel2_y", "wheel2_mu_x")
TWO_AXES = (*ROUND, "wheel_theta", "mu_y", "wheel2_theta", "wheel2_mu_y")


@pytest.mark.parametrize("columns", [ROUND, TWO_AXES])
def test_both_together_pull_as_the_one_did_at_its_place(columns: tuple[str, ...]) -> None:
    rng = np.random.default_rng(3)
    draws = np.tile(rng.standard_normal(len(columns)), (50, 1))
    found = dict(zip(columns, with_splits(rng, draws, columns, 0.6)[: int(SHARE * 50)].T, strict=True))
    whole = dict(zip(columns, draws[0], strict=True))
    shares = []
    for axis in ("x", "y") if "mu_y" in columns else ("x",):
        first, second = np.exp(found[f"mu_{axis}"]), np.exp(found[f"wheel2_mu_{axis}"])
        assert first + second == pytest.approx(np.exp(whole[f"mu_{axis}"]))
        shares.append(first / (first + second))
        assert np.all(shares[-1] >= 0.999 * LEAST)
    share = np.mean(shares, axis=0)
    for axis in ("x", "y"):
        middle = share * found[f"wheel_{axis}"] + (1.0 - share) * found[f"wheel2_{axis}"]
        assert middle == pytest.approx(whole[f"wheel_{axis}"])
        assert np.std(found[f"wheel_{axis}"]) > 0.05


def test_other_draws_and_other_columns_stay() -> None:
    draws = np.random.default_rng(0).standard_normal((20, len(ROUND)))
    parted = with_splits(np.random.default_rng(1), draws, ROUND, 0.6)
    assert np.array_equal(parted[int(SHARE * 20) :], draws[int(SHARE * 20) :])
    assert np.array_equal(parted[:, 0], draws[:, 0])
