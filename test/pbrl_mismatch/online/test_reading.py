"""A posterior is read as what it is: groups of draws apart, both laws of a wheel, no sharper than it was published."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.online.reading import readings_of
from pbrl_model.parameters import free_columns
from pbrl_model.posterior import Posterior

WHEEL = {"mass": 20.0, "wheel_x": 0.3, "wheel_y": -0.2, "wheel_theta": 0.4, "mu_x": 0.01, "mu_y": 0.2}


def drawn(model_class: str, spread: float = 0.02, count: int = 300, **means: float) -> Posterior:
    names = free_columns(model_class)
    middle = np.array([{**WHEEL, **means}[name] for name in names])
    rng = np.random.default_rng(0)
    return Posterior(
        "table", model_class, names, (middle * (1.0 + spread * rng.normal(size=(count, len(names)))))[None]
    )


def test_a_wheel_is_read_with_both_laws_and_a_body_without_one_once() -> None:
    box, ellipse = readings_of(drawn("wheel"))
    assert [each.hypothesis.rows(each.mean[None])[0, COLUMN["cone"]] for each in (box, ellipse)] == [0.0, 1.0]
    assert len(readings_of(drawn("free"))) == 1


def test_its_mean_is_that_of_the_draws_and_its_spread_is_not_smaller() -> None:
    posterior = drawn("wheel")
    reading = readings_of(posterior)[0]
    row = reading.hypothesis.rows(reading.mean[None])[0]
    for name, mean, sd in zip(posterior.names, posterior.mean(), posterior.sd(), strict=True):
        k = reading.hypothesis.columns.index(name)
        told = math.sqrt(reading.covariance[k, k])
        assert row[COLUMN[name]] == pytest.approx(mean, rel=0.02)
        assert told >= (sd / mean if reading.hypothesis.parameters[k].positive else sd) * 0.99
    assert np.all(np.linalg.eigvalsh(reading.covariance) > 0.0)


def test_two_groups_of_draws_are_two_readings_and_a_wide_one_is_one() -> None:
    one, other = drawn("wheel"), drawn("wheel", wheel_x=-0.3, wheel_theta=-0.9)
    both = Posterior("table", "wheel", one.names, np.concatenate([one.draws, other.draws[:, :100]], axis=1))
    readings = readings_of(both)
    k = readings[0].hypothesis.columns.index("wheel_x")
    assert [round(float(each.mean[k]), 1) for each in readings] == [0.3, 0.3, -0.3, -0.3]
    assert len(readings_of(drawn("wheel", spread=0.4))) == 2


def test_a_turn_across_the_border_of_its_circle_is_one_turn() -> None:
    posterior = drawn("wheel", wheel_theta=math.pi / 2.0)
    assert 0.0 < np.mean(posterior.canonical().column("wheel_theta") < 0.0) < 1.0
    reading = readings_of(posterior)[0]
    k = reading.hypothesis.columns.index("wheel_theta")
    assert abs(reading.mean[k]) == pytest.approx(math.pi / 2.0, abs=0.02) and reading.covariance[k, k] < 0.1**2
    assert len(readings_of(posterior)) == 2


def test_a_hinge_is_read_too() -> None:
    posterior = drawn("hinge", mu_x=0.1, mu_y=0.1, hinge_x=1.0, hinge_y=2.0, hinge_radius=0.4)
    (reading,) = readings_of(posterior) if len(readings_of(posterior)) == 1 else readings_of(posterior)[:1]
    assert {"hinge_x", "hinge_y", "hinge_radius", "delay"} <= set(reading.hypothesis.columns)
