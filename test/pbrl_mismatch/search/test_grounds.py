"""On what effects are tried: kinds of baseline, the simplest, the best, and richer ones; then likely other effects."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pbrl_mismatch import DiagnoseOptions
from pbrl_mismatch.search.climbed_on import LED
from pbrl_mismatch.search.explain import (
    GROUNDS_OF_SETS,
    OF_THE_BEST,
    WORTH_A_KIND,
    _grounds,
    _grounds_of_sets,
    _lacks,
)


def base(parameters: int, evidence: float, simulated: float | None = None) -> Any:
    hypothesis = SimpleNamespace(parameters=range(parameters))
    simulated = evidence if simulated is None else simulated
    return SimpleNamespace(hypothesis=hypothesis, evidence=evidence, simulated=simulated)


def test_where_a_locked_caster_is_the_best_a_wheel_is_tried_too() -> None:
    # What an effect did may have hidden the wheel's second axis, never that there is friction.
    caster, wheel, free = base(6, 0.0), base(8, -0.9 * LED), base(3, -900.0)
    assert _grounds([caster, wheel, free]) == [free, caster, wheel]
    far = base(8, -1.1 * LED)
    assert _grounds([caster, far, free]) == [free, caster]


def test_a_wheel_that_simulates_better_is_tried_however_far_behind_the_path_of_a_caster_is_ahead() -> None:
    # The caster's friction stands in along the path for what is left out. Numbers of a recording with a sensor's bias.
    caster, wheel, free = base(6, -1462.0, simulated=-1793.0), base(8, -1586.0), base(3, -2400.0)
    assert _grounds([caster, wheel, free]) == [free, caster, wheel]
    assert _grounds([caster, base(8, -1586.0, simulated=-1900.0), free]) == [free, caster]


@pytest.mark.parametrize(("worse", "count"), [(0.5 * WORTH_A_KIND, 1), (2.0 * WORTH_A_KIND, 2)])
def test_richer_kinds_are_tried_only_where_they_are_worth_it(worse: float, count: int) -> None:
    free, wheel = base(3, -worse), base(8, 0.0)
    assert len(_grounds([wheel, free])) == count
    assert _grounds([base(3, 0.0), base(8, -1.0)])[0].evidence == 0.0
    assert len(_grounds([base(3, 0.0), base(8, -1.0)])) == 1


def weighed(effects: str, evidence: float, beside: float = 0.0) -> Any:
    """Return a hypothesis of effects joined by "+", as it is weighed; so much of its evidence is beside the motion."""
    names = tuple(name for name in effects.split("+") if name)
    fitted = SimpleNamespace(hypothesis=SimpleNamespace(effects=names), evidence=evidence, of_motion=evidence - beside)
    return SimpleNamespace(effects=names, fitted=fitted)


def grounds(entries: tuple[Any, ...], depth: int, *, lacks: bool, pinned: bool = False, patch: Any) -> list[str]:
    patch.setattr("pbrl_mismatch.search.explain.may_be_pinned", lambda _: pinned)
    found = _grounds_of_sets(entries, depth, SimpleNamespace(), lacks)
    return ["+".join(each.hypothesis.effects) for each in found]


def test_where_the_likeliest_leaves_something_out_others_may_be_half_of_the_truth(monkeypatch: Any) -> None:
    names = ["com_offset", "tether", "floor_slope", "viscous_drag", "wrench_bias"]
    entries = (*(weighed(name, 100.0 - k) for k, name in enumerate(names)), weighed("", 0.0))
    assert grounds(entries, 1, lacks=True, patch=monkeypatch) == names[:GROUNDS_OF_SETS]
    assert grounds(entries, 1, lacks=False, patch=monkeypatch) == names[:1]


def test_what_explains_little_or_gives_way_is_no_ground(monkeypatch: Any) -> None:
    little = 0.9 * OF_THE_BEST * 100.0
    entries = (weighed("tether", 100.0), weighed("grasp_compliance", 90.0), weighed("detent", little), weighed("", 0.0))
    assert grounds(entries, 1, lacks=True, patch=monkeypatch) == ["tether"]


def test_what_a_grip_tells_beside_the_motion_hides_no_law_of_the_motion(monkeypatch: Any) -> None:
    entries = (weighed("grasp_compliance", 1000.0, beside=1000.0), weighed("tether", 90.0), weighed("", 0.0))
    assert grounds(entries, 1, lacks=True, patch=monkeypatch) == ["grasp_compliance", "tether"]


def test_only_hypotheses_of_the_asked_number_of_effects_are_grounds(monkeypatch: Any) -> None:
    entries = (weighed("tether+detent", 120.0), weighed("tether", 100.0), weighed("detent", 90.0), weighed("", 0.0))
    assert grounds(entries, 2, lacks=True, patch=monkeypatch) == ["tether+detent"]
    assert grounds(entries, 1, lacks=True, patch=monkeypatch) == ["tether", "detent"]


def test_a_pin_is_a_ground_where_a_place_stood_still(monkeypatch: Any) -> None:
    entries = (weighed("tether", 100.0), weighed("hidden_hinge", 1.0), weighed("", 0.0))
    assert grounds(entries, 1, lacks=False, pinned=True, patch=monkeypatch) == ["tether", "hidden_hinge"]
    assert grounds(entries, 1, lacks=False, pinned=False, patch=monkeypatch) == ["tether"]


def test_what_needs_more_noise_than_there_is_leaves_something_out(monkeypatch: Any) -> None:
    # A simulation that is far off is off by what a wrench explains and by the rest: their ratio says nothing then.
    monkeypatch.setattr("pbrl_mismatch.search.explain.predictive_test", lambda peak, row: SimpleNamespace(p_value=0.5))
    for scale, lacks in ((1.0, False), (1.1, False), (1.2, True)):
        fitted: Any = SimpleNamespace(noise_scale=scale, peak=None)
        assert _lacks(fitted, None, DiagnoseOptions()) is lacks
