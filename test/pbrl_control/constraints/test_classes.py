"""Figure 40 of the thesis, from the physics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_control.constraints.classes import ConstraintSettings, Freedom, ModelClass, classify, dissipation
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.errors import ControlError
from pbrl_model.parameters import BodyParameters

KINDS = {
    "free": ModelClass.UNCONSTRAINED,
    "wheel": ModelClass.ANISOTROPIC,
    "locked": ModelClass.FIXED_POINT,
    "pivot": ModelClass.FIXED_POINT,
    "bar": ModelClass.FIXED_POINT,
}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_has_its_class(draw, place, kind: str) -> None:
    for _ in range(20):
        model = draw(kind)
        assert classify(model, place(model)) == KINDS[kind]


def test_moves_obey_the_rows_and_are_those_of_figure_40(draw, place) -> None:
    for kind, count in {"free": 3, "wheel": 2, "locked": 1, "pivot": 1, "bar": 1}.items():
        model = draw(kind)
        freedom = Freedom.of(model, place(model))
        assert len(freedom.moves) == count == 3 - len(freedom.rows)
        np.testing.assert_allclose(freedom.rows @ freedom.moves.T, 0.0, atol=1e-12)


def test_a_locked_caster_that_carries_a_quarter_of_a_table_holds_though_its_coefficient_is_below_the_thesis_s(
    table,
) -> None:
    wheel = {"wheel_x": -0.315, "wheel_y": -0.69, "mu_x": 0.175, "mu_y": 0.175}
    assert classify(table(**wheel)) == ModelClass.FIXED_POINT
    assert classify(table(mass=5.0, **wheel)) == ModelClass.UNCONSTRAINED, "8.6 N are dragged along unnoticed"


def test_threshold_of_the_thesis_is_the_default_of_a_setting(table) -> None:
    between = ConstraintSettings(drag_force=1e6)
    assert classify(table(mu_x=0.02, mu_y=0.31), settings=between) == ModelClass.ANISOTROPIC
    assert classify(table(mu_x=0.02, mu_y=0.29), settings=between) == ModelClass.UNCONSTRAINED
    assert classify(table(mass=3.0, mu_x=0.02, mu_y=0.31), settings=between) == ModelClass.UNCONSTRAINED


def test_what_is_too_heavy_for_the_robot_is_static(table) -> None:
    assert classify(table(mass=400.0, mu_ground=0.05)) == ModelClass.UNCONSTRAINED
    heavy = Freedom.of(table(mass=400.0, mu_ground=0.3))
    assert heavy.model_class == ModelClass.STATIC
    assert not len(heavy.moves)
    assert "300 N" in heavy.reason
    assert heavy.least_force > 300.0


def test_least_force_of_a_translation_is_mu_m_g(table) -> None:
    model = table(mass=30.0, mu_ground=0.05)
    assert dissipation(model, np.array([0.2, 0.0, 0.0])) == pytest.approx(0.2 * 0.05 * 30.0 * 9.81)
    turn = 0.05 * 30.0 * 9.81 * math.sqrt(model.inertia_per_mass) / math.hypot(0.375, 0.75)
    assert Freedom.of(model).least_force == pytest.approx(turn), "at a corner it is turned more easily than pushed"


def test_anisotropic_axis_is_the_one_that_rolls(table) -> None:
    model = table(wheel_x=0.1, wheel_y=0.2, wheel_theta=math.radians(30), mu_x=0.5, mu_y=0.01)
    freedom = Freedom.of(model)
    np.testing.assert_allclose(freedom.moves[0, :2], [-0.5, math.sqrt(0.75)], atol=1e-12)
    assert "120 deg" in freedom.reason


@pytest.mark.parametrize(
    ("parameters", "complaint"),
    [
        ({"mass": 0.0}, "mass above zero, got 0.0 kg"),
        ({"mass": -3.0}, "mass above zero"),
        ({"mass": math.nan}, "mass above zero"),
        ({"mu_x": -0.1}, "not below zero as mu_x"),
        ({"mu_y": math.nan}, "mu_y, got nan"),
        ({"wheel_x": math.inf}, "finite number as wheel_x"),
        ({"hinge_radius": -1.0}, "hinge_radius"),
    ],
)
def test_an_unphysical_model_is_refused_in_one_line(table, parameters: dict, complaint: str) -> None:
    with pytest.raises(ControlError, match=complaint) as caught:
        table(**parameters)
    assert "\n" not in str(caught.value)


def test_a_footprint_that_is_none_is_refused() -> None:
    with pytest.raises(ControlError, match="footprint"):
        ObjectModel.uniform(BodyParameters(mass=3.0), np.zeros((4, 2)))


@pytest.mark.parametrize("pose", [None, np.array([0.0, math.nan, 0.0])])
def test_a_hinge_at_a_distance_wants_a_pose(table, pose) -> None:
    with pytest.raises(ControlError, match="expected a finite pose"):
        classify(table(hinge_x=1.0, hinge_radius=0.5), pose)
    with pytest.raises(ControlError, match="both in one place"):
        classify(table(hinge_x=1.0, hinge_radius=0.5), np.array([1.0, 0.0, 0.0]))
