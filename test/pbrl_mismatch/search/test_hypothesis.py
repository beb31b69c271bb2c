"""A hypothesis without what bends: as it was believed to be, or with columns held."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.hypothesis import BELIEVED, BaselineOptions, Hypothesis, baselines

OPTIONS = BaselineOptions(20.0, 0.1, 0.1, 0.02, 0.1, 0.02)


def kind(name: str) -> Hypothesis:
    return baselines(OPTIONS, [name], np.zeros(2), np.array([0.6, 0.35]), None)[0]


@given(st.floats(20.0, 300.0), st.floats(1e-3, 0.01), st.booleans())
def test_a_wheel_s_friction_stays_the_force_that_it_was(mass: float, friction: float, turned: bool) -> None:
    wheel = kind("wheel")
    bent = wheel.mean.copy()
    holds, rolls = ("mu_x", "mu_y") if turned else ("mu_y", "mu_x")
    for column, value in (("mass", mass), (holds, friction), (rolls, 0.1 * friction), ("delay", 0.08)):
        k = wheel.columns.index(column)
        bent[k] = np.log(value) if wheel.parameters[k].positive else value
    row, was = (wheel.rows(each[None])[0] for each in (wheel.as_believed(bent), bent))
    assert row[COLUMN["mass"]] == pytest.approx(20.0)
    assert row[COLUMN["delay"]] == 0.0
    assert row[COLUMN[holds]] * row[COLUMN["mass"]] == pytest.approx(friction * mass)
    assert row[COLUMN[rolls]] * row[COLUMN["mass"]] == pytest.approx(0.1 * friction * mass)
    # Where it is, and how it is turned, is not bent by what is lacking.
    assert [row[COLUMN[name]] for name in ("wheel_x", "wheel_y", "wheel_theta")] == [
        was[COLUMN[name]] for name in ("wheel_x", "wheel_y", "wheel_theta")
    ]


def test_no_wheel_holds_more_than_rubber_can() -> None:
    wheel = kind("wheel")
    bent = wheel.mean.copy()
    bent[wheel.columns.index("mass")] = np.log(1e5)
    assert wheel.rows(wheel.as_believed(bent)[None])[0, COLUMN["mu_y"]] < 0.7


@pytest.mark.parametrize("name", ["free", "caster", "ground"])
def test_without_a_wheel_that_rolls_all_that_bends_is_as_it_was_believed(name: str) -> None:
    body = kind(name)
    bent = body.mean + 2.0 * body.spread
    found = body.as_believed(bent)
    free = np.isin(body.columns, [*BELIEVED, "mu_x"])
    np.testing.assert_array_equal(found[free], body.mean[free])
    np.testing.assert_array_equal(found[~free], bent[~free])


@pytest.mark.parametrize("name", ["free", "caster", "wheel"])
def test_what_is_held_is_at_its_centre_and_the_rest_is_as_before(name: str) -> None:
    body = kind(name)
    held = body.fixed(BELIEVED)
    assert not BELIEVED & set(held.columns)
    drawn = body.sample_prior(np.random.default_rng(0), 5)
    believed = np.isin(body.columns, list(BELIEVED))
    drawn[:, believed] = body.mean[believed]
    rows = body.rows(drawn)
    np.testing.assert_allclose(held.rows(held.coordinates(rows) if held.parameters else np.zeros((5, 0))), rows)
