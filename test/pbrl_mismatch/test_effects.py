"""The library of effects: the contract's names, and what every effect must have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrl_mismatch import EFFECTS, MismatchError
from pbrl_mismatch.effects.effect import Parameter, Scene
from pbrl_mismatch.effects.registry import effect_named
from pbrl_mismatch.kernels.columns import COLUMN, COLUMNS, UNIT, neutral_row
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_model.parameters import KERNEL_COLUMNS

CONTRACT = (
    "second_wheel caster_swivel ground_friction breakaway_friction viscous_drag floor_patch floor_slope com_offset "
    "payload_change sloshing_load tether detent hidden_hinge hidden_obstacle unseen_body external_force "
    "grasp_compliance wrench_bias wrench_frame time_offset pose_bias"
)
SCENE = Scene(np.zeros(2), np.ones(2), np.zeros(2), np.zeros(2), np.array([0.6, 0.35]), 20.0, 10.0, 0.1, 0.0, 20.0)


def test_the_names_are_the_contract_s() -> None:
    assert " ".join(EFFECTS) == CONTRACT


def test_a_row_begins_as_the_world_model_s_row() -> None:
    assert tuple(COLUMNS[: len(KERNEL_COLUMNS)]) == KERNEL_COLUMNS
    assert len(set(COLUMNS)) == len(COLUMNS) == len(UNIT) == len(neutral_row())


@pytest.mark.parametrize("name", list(EFFECTS))
def test_every_effect_says_what_it_is(name: str) -> None:
    effect = EFFECTS[name]
    assert effect.summary.endswith(".") and effect.equation and effect.shows.endswith(".")
    known = {parameter.column for parameter in effect.parameters(SCENE)}
    used = {column for variant in effect.variants for column in variant}
    assert used == known and known <= set(COLUMN)
    assert {*effect.angles, *effect.linear} <= known
    values = {parameter.column: parameter.centre for parameter in effect.parameters(SCENE)}
    if effect.where is not None:
        place = effect.where(values, SCENE)
        assert place is not None and place.shape.shape[1] == 2 and np.isfinite(place.shape).all()


@pytest.mark.parametrize("name", list(EFFECTS))
def test_draws_of_the_prior_and_rows_go_round(name: str) -> None:
    base = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.01), ["caster"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    effect = EFFECTS[name]
    for variant in range(len(effect.variants)):
        hypothesis = base.with_effect(effect, SCENE, variant)
        draws = hypothesis.sample_prior(np.random.default_rng(0), 9)
        np.testing.assert_allclose(hypothesis.coordinates(hypothesis.rows(draws)), draws, atol=1e-9)
        assert hypothesis.effects == (name,)


def test_a_point_of_the_body_is_looked_for_on_the_body_alone() -> None:
    base = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.01), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    hypothesis = base.with_effect(EFFECTS["second_wheel"], SCENE, 0)
    draws = hypothesis.mean + 9.0 * hypothesis.spread * np.random.default_rng(0).standard_normal((200, 1))
    held = hypothesis.believable(draws)[:, [hypothesis.columns.index(name) for name in ("wheel2_x", "wheel2_y")]]
    assert np.all(np.abs(held - SCENE.centroid) <= SCENE.half + 1e-12)
    assert np.isclose(np.abs(held - SCENE.centroid), SCENE.half).any()


def test_an_offset_of_the_centre_of_mass_is_from_where_it_was_told_to_be() -> None:
    # Of a footprint that is not symmetric its box's middle is another point.
    where = EFFECTS["com_offset"].where
    place = where and where({"com_x": 0.1, "com_y": 0.0}, replace(SCENE, com=np.array([0.05, -0.02])))
    assert place is not None
    np.testing.assert_allclose(place.shape.mean(axis=0), [0.15, -0.02], atol=1e-9)


def test_unknown_names_are_told_the_nearest() -> None:
    with pytest.raises(MismatchError, match="did you mean 'tether'"):
        effect_named("teter")
    with pytest.raises(MismatchError, match="column"):
        Parameter("weight", 1.0, 1.0)
    with pytest.raises(MismatchError, match="spread"):
        Parameter("mass", 1.0, 0.0)
