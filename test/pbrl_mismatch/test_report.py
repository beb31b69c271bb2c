"""What a report says of places: an ellipse that holds the middle of an effect's place as often as it promises."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from shapely import Polygon, contains_xy

from pbrl_mismatch import EFFECTS, report
from pbrl_mismatch.effects.effect import Effect, Scene, disc
from pbrl_mismatch.report import findings_of, place_uncertainty, sentence
from pbrl_mismatch.search.predictive import Verdict
from pbrl_mismatch.search.weigh import Weighed

COVARIANCE = np.array([[0.04, 0.018, 0.0], [0.018, 0.01, 0.0], [0.0, 0.0, 1.0]])
MIDDLE = np.array([0.3, -0.2])


def fitted(columns: tuple[str, ...]) -> Any:
    """Return a stand-in for a fit with a posterior over some columns."""
    return SimpleNamespace(
        hypothesis=SimpleNamespace(columns=columns), peak=SimpleNamespace(covariance=lambda row: COVARIANCE), draws=None
    )


def test_the_ellipse_holds_the_middle_in_95_percent() -> None:
    wheel = EFFECTS["second_wheel"]
    found = place_uncertainty(fitted(("wheel2_x", "wheel2_y", "mass")), wheel, disc("body", *MIDDLE, 0.05))
    assert found is not None
    draws = np.random.default_rng(0).multivariate_normal(MIDDLE, COVARIANCE[:2, :2], 20_000)
    assert np.mean(contains_xy(Polygon(found), *draws.T)) == pytest.approx(0.95, abs=0.01)


def test_the_ellipse_is_that_of_the_draws_where_there_are_any() -> None:
    made = fitted(("wheel2_x", "wheel2_y", "mass"))
    by_laplace = place_uncertainty(made, EFFECTS["second_wheel"], disc("body", *MIDDLE, 0.05))
    made.draws = np.random.default_rng(1).multivariate_normal(np.zeros(3), 9.0 * COVARIANCE, 20_000)
    found = place_uncertainty(made, EFFECTS["second_wheel"], disc("body", *MIDDLE, 0.05))
    assert found is not None and by_laplace is not None
    assert Polygon(found).area == pytest.approx(9.0 * Polygon(by_laplace).area, rel=0.05)


def test_a_place_that_is_not_free_has_none() -> None:
    where = disc("body", *MIDDLE, 0.05)
    assert place_uncertainty(fitted(("wheel2_x", "mu_x", "mass")), EFFECTS["second_wheel"], where) is None
    assert place_uncertainty(fitted(("wheel2_x", "wheel2_y", "mass")), EFFECTS["wrench_bias"], where) is None


def test_every_place_s_middle_is_where_its_outline_is() -> None:
    placed = [effect for effect in EFFECTS.values() if effect.where is not None]
    assert placed and all(effect.place is not None for effect in placed)
    assert all(effect.place is None for effect in EFFECTS.values() if effect.where is None)


@pytest.mark.parametrize("effect", [each for each in EFFECTS.values() if each.where], ids=lambda each: each.name)
def test_a_place_is_told_in_the_world_or_in_its_object_s_frame(effect: Effect, monkeypatch: pytest.MonkeyPatch) -> None:
    zero, one = np.zeros(2), np.ones(2)
    scene = Scene(zero, one, zero, zero, 0.5 * one, mass=20.0, force=10.0, speed=0.1, start=0.0, seconds=20.0)
    means = {each.column: {"mean": 0.1} for each in effect.parameters(scene)}
    monkeypatch.setattr(report, "parameters_of", lambda *_: means)
    monkeypatch.setattr(report, "activity", lambda *_, **__: {effect.name: None})
    objective = SimpleNamespace(cuts=SimpleNamespace(track=SimpleNamespace(object="table")))
    peak = SimpleNamespace(settled=[True], objective=objective)
    hypothesis = SimpleNamespace(columns=(), told=(), effects=(effect.name,))
    fits: Any = SimpleNamespace(usual_scale=1.0, unexplained=0.0, peak=peak, hypothesis=hypothesis, row=None)
    (told,) = findings_of(fits, (Weighed((effect.name,), fits, 0.0, 1.0, False),), scene, exact=False).effects
    moves = effect.name in ("second_wheel", "com_offset", "payload_change")
    assert told.to_report()["where"]["frame"] == ("table" if moves else "world")


def test_of_two_effects_the_one_that_explains_more_alone_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "_described", lambda each, scene: each.effects)
    peak = SimpleNamespace(settled=[True])
    fits: Any = SimpleNamespace(usual_scale=1.0, peak=peak, unexplained=0.0)
    weights = {("hidden_obstacle", "unseen_body"): 0.0, ("unseen_body",): -9.0, ("hidden_obstacle",): -20.0, (): -50.0}
    weighed = tuple(Weighed(names, fits, value, float(value == 0.0), False) for names, value in weights.items())
    found = findings_of(fits, weighed, fits, exact=True)
    assert found.effects == ("unseen_body", "hidden_obstacle")
    assert found.alternatives == ("unseen_body", "hidden_obstacle")


def test_one_effect_is_named_where_only_what_is_beside_it_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "_described", lambda each, scene: ((each.effects, each.probability),))
    fits: Any = SimpleNamespace(usual_scale=1.0, peak=SimpleNamespace(settled=[True]), unexplained=0.0)
    shares = {("tether",): 0.45, ("com_offset", "tether"): 0.35, ("tether", "wrench_bias"): 0.15, (): 0.05}
    weighed = tuple(Weighed(names, fits, np.log(share), share, False) for names, share in shares.items())
    found = findings_of(fits, weighed, fits, exact=False)
    assert found.effects == ((("tether",), pytest.approx(0.95)),)
    assert [names for names, _ in found.alternatives] == [("tether", "com_offset"), ("tether", "wrench_bias")]


def test_where_two_explain_alike_it_is_not_said_that_nothing_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "_described", lambda each, scene: ())
    verdict = Verdict(1e-4, 0.0, 1, 1, 1.0, 1e-4)

    def said(scale: float, vetoed: bool) -> str:
        fits: Any = SimpleNamespace(usual_scale=scale, peak=SimpleNamespace(settled=[True]), unexplained=0.0)
        shares = {("floor_slope",): 0.48, ("com_offset",): 0.46, (): 0.06}
        weighed = tuple(Weighed(names, fits, np.log(share), share, vetoed) for names, share in shares.items())
        found = findings_of(fits, weighed, fits, exact=False)
        assert found.effects == () and any("alike" in note for note in found.notes)
        return sentence("table", True, verdict, found)

    assert said(1.0, False).endswith("and which of what may explain it is open")
    assert said(9.0, False).endswith("none of what the library knows") == said(1.0, True).endswith("the library knows")


@pytest.mark.parametrize(
    ("names", "exact", "p_value", "left", "forecast", "named"),
    [
        (("wrench_bias",), True, 1e-9, 0.0, 0.5, False),
        (("wrench_bias",), True, 1e-9, 0.0, 0.05, True),  # a forecast as good as that is no chance
        (("wrench_bias",), True, 1e-3, 0.5, 0.5, True),
        (("wrench_bias",), False, 1e-9, 0.5, 0.5, True),  # a told baseline's casters are an idealisation
        (("wrench_bias", "unseen_body"), True, 1e-9, 0.2, 0.5, True),  # so is a contact
        (("wrench_bias", "unseen_body"), True, 1e-9, 0.5, 0.5, False),  # that leaves half is another thing
        (("wrench_bias", "unseen_body"), True, 1e-9, 0.5, 0.05, True),  # but where it says where the body will be
        (("unseen_body",), True, 1e-3, 0.5, 0.5, True),
        (("unseen_body",), True, 1e-9, 0.35, 0.5, True),
        (("floor_patch",), True, 1e-9, 0.35, 0.5, False),  # a patch has no history that a third could hang on
        (("floor_patch",), True, 1e-9, 0.2, 0.5, True),
    ],
)
def test_a_law_that_leaves_a_wrench_is_not_named_if_it_is_exact_or_the_wrench_large(
    monkeypatch: pytest.MonkeyPatch,
    names: tuple[str, ...],
    exact: bool,
    p_value: float,
    left: float,
    forecast: float,
    named: bool,
) -> None:
    monkeypatch.setattr(report, "_described", lambda each, scene: each.effects)
    monkeypatch.setattr(report, "predictive_test", lambda peak, row: Verdict(p_value, 0.0, 1, 1, 1.0))
    settled, score, before = (
        SimpleNamespace(**each) for each in ({"settled": [True]}, {"rmse_position": forecast}, {"rmse_position": 1.0})
    )
    fits: Any = SimpleNamespace(usual_scale=1.0, peak=settled, unexplained=100.0 * left, score=score)
    none: Any = SimpleNamespace(usual_scale=1.0, unexplained=100.0, score=before)
    weighed = (Weighed(names, fits, 0.0, 1.0, False), Weighed((), none, -50.0, 0.0, False))
    found = findings_of(none, weighed, fits, exact=exact)
    assert found.effects == (names if named else ())
    assert found.alternatives == (() if named else names)
    assert any("reaches the noise floor" in note for note in found.notes) != named
    assert any("there is more" in note for note in found.notes) == (named and forecast < 0.1)
    # It is the same for a wrench that lasts and is too little to be seen among all that there could be.
    monkeypatch.setattr(report, "predictive_test", lambda peak, row: Verdict(0.5, 0.0, 1, 1, 1.0, p_value))
    assert findings_of(none, weighed, fits, exact=exact).effects == found.effects
