"""Priors of table 2: support, nominal mass, symmetry; and their settings in YAML."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag.types import BodyGeometry
from pbrl_model.distributions import LogNormal, Uniform
from pbrl_model.errors import ModelError
from pbrl_model.parameters import MODEL_CLASSES, UNITS, free_columns
from pbrl_model.prior_options import PriorOptions, load_prior_options, parse_prior_options
from pbrl_model.priors import table2_prior
from pbrl_model.symmetry import equivalent_wheels

ROOT = Path(__file__).resolve().parents[2]
FOOTPRINT = np.array([[-0.4, -0.2], [0.8, -0.2], [0.8, 0.5], [-0.4, 0.5]])
TABLE = BodyGeometry("table", FOOTPRINT, 0.7, 30.0, True, np.array([3.0, 4.0, 0.5]))


@pytest.mark.parametrize("name", MODEL_CLASSES)
def test_samples_lie_in_the_support_of_a_named_joint_prior(name: str) -> None:
    prior = table2_prior(TABLE, name)
    assert prior.names == free_columns(name)
    assert prior.units == tuple(UNITS[parameter] for parameter in prior.names)
    theta = prior.sample(np.random.default_rng(0), 500)
    low, high = prior.bounds
    assert theta.shape == (500, len(prior.names)) and np.all((theta >= low) & (theta <= high))
    assert np.isfinite(prior.log_prob(theta)).all()


def test_wheel_lies_within_the_bounding_box() -> None:
    prior = table2_prior(TABLE, "wheel")
    low, high = prior.bounds
    assert (low[1], high[1], low[2], high[2]) == (-0.4, 0.8, -0.2, 0.5)
    theta = prior.sample(np.random.default_rng(0), 1)
    outside = theta.copy()
    outside[0, 1] = 0.81
    assert prior.log_prob(outside)[0] == -np.inf
    wide = table2_prior(TABLE, "wheel", parse_prior_options({"wheel": {"margin": 0.1}}))
    assert np.isfinite(wide.log_prob(outside)[0])


def test_mass_is_around_the_nominal_mass_and_wide_where_there_is_none() -> None:
    known = table2_prior(TABLE, "free").parts["mass"]
    unknown = table2_prior(replace(TABLE, nominal_mass=float("nan")), "free").parts["mass"]
    assert known == LogNormal(30.0, 0.5) and unknown == LogNormal(15.0, 1.0)


def test_log_prob_is_the_sum_of_the_parts_and_nan_has_none() -> None:
    prior = table2_prior(TABLE, "wheel")
    theta = prior.sample(np.random.default_rng(1), 20)
    total = sum(part.log_prob(column) for part, column in zip(prior.parts.values(), theta.T, strict=True))
    np.testing.assert_allclose(prior.log_prob(theta), total)
    theta[3, 2] = np.nan
    assert prior.log_prob(theta)[3] == -np.inf
    with pytest.raises(ModelError, match="columns"):
        prior.log_prob(theta[:, :3])


def test_equivalent_wheels_are_equally_likely() -> None:
    prior = table2_prior(TABLE, "wheel")
    theta = prior.sample(np.random.default_rng(2), 50)
    for same in equivalent_wheels(theta, prior.names):
        np.testing.assert_allclose(prior.log_prob(same), prior.log_prob(theta))
    np.testing.assert_array_equal(prior.periodic, [name == "wheel_theta" for name in prior.names])


def test_hinge_is_sought_around_the_body_or_where_asked() -> None:
    middle = table2_prior(TABLE, "hinge").bounds.mean(axis=0)
    assert (middle[3], middle[4]) == (3.0, 4.0)
    middle = table2_prior(TABLE, "hinge", around=(-1.0, 2.0)).bounds.mean(axis=0)
    assert (middle[3], middle[4]) == (-1.0, 2.0)
    with pytest.raises(ModelError, match="2 finite"):
        table2_prior(TABLE, "hinge", around=(np.nan, 0.0))


def test_a_parameter_can_be_written_out() -> None:
    options = parse_prior_options({"parameters": {"mass": {"distribution": "uniform", "lower": 2, "upper": 60}}})
    assert table2_prior(TABLE, "wheel", options).parts["mass"] == Uniform(2.0, 60.0)


def test_the_file_that_comes_with_the_workspace_says_the_defaults() -> None:
    assert load_prior_options(ROOT / "config" / "params" / "priors.yaml") == PriorOptions()


BAD = {
    "key": ({"weel": {}}, "unknown key weel; did you mean 'wheel'"),
    "inner key": ({"mass": {"sigmas": 1}}, "unknown key mass.sigmas; did you mean 'sigma'"),
    "parameter": ({"parameters": {"mas": {"distribution": "uniform", "lower": 0, "upper": 1}}}, "did you mean 'mass'"),
    "no prior": ({"parameters": {"anchor_x": {"distribution": "uniform", "lower": 0, "upper": 1}}}, "got 'anchor_x'"),
    "distribution": ({"parameters": {"mass": {"distribution": "normal"}}}, "parameters.mass"),
    "spec key": (
        {"parameters": {"mass": {"distribution": "uniform", "lower": 0, "upper": 1, "uper": 2}}},
        "did you mean 'upper'",
    ),
    "empty range": ({"parameters": {"mass": {"distribution": "uniform", "lower": 1, "upper": 1}}}, "lower < upper"),
    "negative": ({"mass": {"sigma": -1}}, "mass.sigma"),
    "nan": ({"friction": {"mean": float("nan")}}, "friction.mean"),
    "text": ({"friction": {"mean": "much"}}, "friction.mean"),
    "list": ([1, 2], "priors: file"),
}


@pytest.mark.parametrize(("values", "what"), BAD.values(), ids=BAD.keys())
def test_bad_settings_are_refused_in_one_line(values: object, what: str) -> None:
    with pytest.raises(ModelError, match=what) as caught:
        parse_prior_options(values)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", [b"mass: [", b"\xff\xfe\x00", None])
def test_unreadable_files_are_refused_in_one_line(text: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "priors.yaml"
    if text is not None:
        path.write_bytes(text)
    with pytest.raises(ModelError, match=r"priors\.yaml") as caught:
        load_prior_options(path)
    assert "\n" not in str(caught.value)
    (tmp_path / "empty.yaml").write_text("")
    assert load_prior_options(tmp_path / "empty.yaml") == PriorOptions()
