"""Beliefs: what furniture is like before it was pushed, and what draws of a posterior say of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_control.constraints.classes import Freedom, ModelClass
from pbrl_control.errors import ControlError
from pbrl_model.parameters import KERNEL_COLUMNS
from pbrl_namo.beliefs import BeliefSettings, ObjectBelief, belief_of_draws, prior_belief
from pbrl_namo.beliefs.furniture import Corners, kind_counts
from pbrl_namo.errors import NamoError
from pbrl_namo.scene import Movable

TABLE = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])
DESK = Movable(TABLE, 0.75, 33.0)
WHEEL = ("mass", "wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y")
NONE = {"free": 0.0, "one_locked": 0.0, "blocked": 0.0, "loaded": 0.0}


def prior(seed: int = 3, thing: Movable = DESK, **settings: float) -> ObjectBelief:
    return prior_belief(thing, np.random.default_rng(seed), BeliefSettings(**settings))


def column(belief: ObjectBelief, name: str) -> np.ndarray:
    return belief.rows[:, KERNEL_COLUMNS.index(name)]


def test_same_seed_same_bytes() -> None:
    assert prior(7).rows.tobytes() == prior(7).rows.tobytes()
    assert prior(7).rows.tobytes() != prior(8).rows.tobytes()


def test_casters_that_all_roll_leave_it_free() -> None:
    classes = prior(**{**NONE, "free": 1.0}).classes()
    assert classes[ModelClass.UNCONSTRAINED] == 1.0


def test_one_locked_caster_is_a_pivot_near_a_corner() -> None:
    belief = prior(**{**NONE, "one_locked": 1.0})
    assert belief.classes()[ModelClass.FIXED_POINT] > 0.9  # the lightest are dragged along unnoticed
    corners = Corners.of(TABLE).inwards(0.06)
    places = np.column_stack((column(belief, "wheel_x"), column(belief, "wheel_y")))
    away = np.hypot(*(places[:, None] - corners[None]).transpose(2, 0, 1))
    assert away.min(axis=1).max() < 0.1
    assert set(away.argmin(axis=1)) == {0, 1, 2, 3}


def test_more_locked_casters_hold_more_and_their_middle_is_nearer_to_the_tables() -> None:
    one, more = prior(**{**NONE, "one_locked": 1.0}), prior(**{**NONE, "blocked": 1.0})
    assert column(more, "mu_x").mean() > 1.8 * column(one, "mu_x").mean()
    assert np.abs(column(more, "wheel_y")).mean() < 0.6 * np.abs(column(one, "wheel_y")).mean()
    turn_one, turn_more = (
        np.median([Freedom.of(model).least_force for model in belief.models(np.random.default_rng(0), 60)])
        for belief in (one, more)
    )
    assert turn_more > 5.0 * turn_one  # each of them is dragged round the middle of all


def test_nothing_more_than_sliding_holds_it_still() -> None:
    """Friction of all casters locked is that of their treads on the whole weight, so no draw resists with more."""
    belief = prior(**{**NONE, "blocked": 1.0, "caster_sigma": 0.0, "rolling_sigma": 0.0})
    assert column(belief, "mu_x").max() == pytest.approx(0.7)
    assert np.array_equal(column(belief, "mu_x"), column(belief, "mu_y"))


def test_mass_is_about_the_guess_and_broad_without_one() -> None:
    known = np.log(column(prior(**{**NONE, "free": 1.0}), "mass"))
    assert math.exp(known.mean()) == pytest.approx(33.0, rel=0.05)
    unknown = np.log(column(prior(thing=Movable(TABLE), **{**NONE, "free": 1.0}), "mass"))
    assert unknown.std() > 2.5 * known.std()


def test_a_load_makes_it_heavier() -> None:
    light, loaded = prior(**{**NONE, "free": 1.0}), prior(**{**NONE, "loaded": 1.0})
    assert column(loaded, "mass").mean() == pytest.approx(1.5 * column(light, "mass").mean(), rel=0.1)
    assert loaded.classes()[ModelClass.UNCONSTRAINED] == 1.0


@pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0, 1.0), (0.55, 0.25, 0.12, 0.08), (0.0, 1.0, 0.0, 0.0)])
def test_kinds_have_their_shares(weights: tuple[float, ...]) -> None:
    settings = BeliefSettings(**dict(zip(NONE, weights, strict=True)), draws=203)
    counts = kind_counts(settings)
    assert sum(counts) == 203
    assert np.abs(np.array(counts) - 203 * np.array(weights) / sum(weights)).max() < 1.0


def test_worlds_have_the_kinds_in_their_shares() -> None:
    belief = prior(free=0.5, one_locked=0.5, blocked=0.0, loaded=0.0)
    for seed in range(5):
        models = belief.models(np.random.default_rng(seed), 20)
        locked = sum(model.parameters.has_wheel for model in models)
        assert abs(locked - 10) <= 1


def test_more_worlds_than_draws_repeat_draws() -> None:
    belief = belief_of_draws(DESK, ("mass",), np.array([[20.0], [30.0]]))
    masses = [model.mass for model in belief.models(np.random.default_rng(0), 9)]
    assert set(masses) == {20.0, 30.0}
    assert sorted(masses) == masses
    with pytest.raises(NamoError, match="at least one world"):
        belief.models(np.random.default_rng(0), 0)


def test_flat_samples_are_rows_one_after_the_other() -> None:
    rows = np.array([[30.0, 0.1, 0.2, 0.3, 0.25, 0.26], [31.0, 0.0, 0.1, 0.2, 0.35, 0.4]])
    flat = belief_of_draws(DESK, WHEEL, rows.ravel())
    assert np.array_equal(flat.rows, belief_of_draws(DESK, WHEEL, rows).rows, equal_nan=True)
    assert np.array_equal(column(flat, "mu_y"), [0.26, 0.4])
    assert np.isnan(column(flat, "hinge_radius")).all()


def test_a_mass_that_was_not_learned_is_the_guess() -> None:
    belief = belief_of_draws(DESK, ("mu_ground",), np.array([0.02, 0.03]))
    assert np.array_equal(column(belief, "mass"), [33.0, 33.0])


def test_a_hinge_at_a_distance_needs_the_pose() -> None:
    names = ("mass", "hinge_x", "hinge_y", "hinge_radius")
    belief = belief_of_draws(DESK, names, np.array([[30.0, 2.0, 0.0, 1.0]] * 3))
    with pytest.raises(ControlError, match="pose"):
        belief.classes()
    assert belief.classes(np.array([1.0, 0.0, 0.0]))[ModelClass.FIXED_POINT] == 1.0


@pytest.mark.parametrize(
    ("names", "samples", "fault"),
    [
        (("mass", "mass"), [[30.0, 30.0]], "once"),
        ((), [], "once"),
        (("mas",), [[30.0]], "did you mean 'mass'"),
        (WHEEL, [1.0] * 7, "rows of 6"),
        (("mass",), [], "rows of 1"),
        (("mass",), np.zeros((0, 1)), "n >= 1"),
        (("mass",), [[math.nan]], "finite"),
        (("mass",), [[math.inf]], "finite"),
        (("mass",), [[0.0]], "mass above zero"),
        (("mass",), [[-3.0]], "mass above zero"),
        (("mass", "mu_x"), [[30.0, 0.1], [30.0, -0.1]], "mu_x"),
        (("mass",), np.ones((2, 2)), "1 columns"),
        (("mass",), np.ones((2, 1, 1)), "finite samples"),
    ],
)
def test_bad_draws_are_refused_in_words(names: tuple[str, ...], samples: object, fault: str) -> None:
    with pytest.raises(NamoError, match=fault) as error:
        belief_of_draws(DESK, names, np.asarray(samples, dtype=float))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("mass", [0.0, -1.0, math.inf])
def test_a_guess_that_is_no_mass_is_refused(mass: float) -> None:
    with pytest.raises(NamoError, match="nominal mass"):
        prior(thing=Movable(TABLE, 0.75, mass))


def test_a_prior_of_nothing_is_refused() -> None:
    with pytest.raises(NamoError, match="weight above zero"):
        prior(**NONE)


def test_an_outline_that_is_none_is_refused() -> None:
    with pytest.raises(NamoError, match="footprint"):
        ObjectBelief(np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]), prior().rows)


def test_draws_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        prior().rows[0, 0] = 1.0
