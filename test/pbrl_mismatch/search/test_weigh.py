"""How hypotheses are weighed: an effect's variants share its part, also those that were given up."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_mismatch import EFFECTS, DiagnoseOptions
from pbrl_mismatch.search import weigh as weighing
from pbrl_mismatch.search.heldout import Score
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.predictive import Verdict
from pbrl_mismatch.search.weigh import (
    ASTRAY,
    CLEAR,
    DISCREPANCY,
    JUDGED,
    LEAVES,
    OF_EXACT,
    OF_HISTORY,
    VETO,
    Weighed,
    first_judged,
    held_by,
    sure_first,
    veto,
    weigh,
)

OPTIONS = DiagnoseOptions()


def fitted(variant: str, evidence: float, unexplained: float = 0.0, beside: float = 0.0) -> Any:
    """Return what is weighed of a hypothesis, by its variant: its kind of baseline, then effects by number.

    So much it leaves unexplained [nat]; of its evidence so much is beside the motion.
    """
    effects = tuple(part.split("/")[0] for part in variant.split(" + ")[1:])
    return SimpleNamespace(
        hypothesis=SimpleNamespace(effects=effects, variant=variant),
        evidence=evidence,
        of_motion=evidence - beside,
        unexplained=unexplained,
        score=None,
        peak=None,
    )


BASES = [fitted("free", -100.0)]


@pytest.fixture(autouse=True)
def left_over(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Return what sets the chance that what a hypothesis leaves is noise; at first it is."""

    def found(chance: float) -> None:
        monkeypatch.setattr(weighing, "predictive_test", lambda peak, row: Verdict(0.5, 0.0, 1, 1, 1.0, chance))

    found(0.5)
    return found


def weights(*tried: Any) -> dict[tuple[str, ...], float]:
    return {each.effects: each.log_weight for each in weigh(BASES, tried, OPTIONS)}


def test_a_variant_that_was_given_up_counts_as_one_that_explains_nothing() -> None:
    slope, push = fitted("free + floor_slope/0", -50.0), fitted("free + external_force/0", -50.0)
    alone = weights(slope, push)
    hopeless = weights(slope, push, fitted("free + external_force/2", -500.0))
    assert alone == hopeless
    share = math.log(len(EFFECTS["external_force"].variants))
    assert alone["floor_slope",] - alone["external_force",] == pytest.approx(share)


def test_variants_that_are_as_good_share_what_the_best_of_them_lost() -> None:
    every = [fitted(f"free + external_force/{k}", -50.0) for k in range(len(EFFECTS["external_force"].variants))]
    found = weights(fitted("free + floor_slope/0", -50.0), *every)
    assert found["external_force",] == pytest.approx(found["floor_slope",])


def test_two_effects_are_the_same_two_in_either_order() -> None:
    ways = ["free + tether/0 + detent/1", "free + detent/1 + tether/0"]
    once, twice = (weights(*(fitted(way, -50.0) for way in ways[:count])) for count in (1, 2))
    assert once["detent", "tether"] == pytest.approx(twice["detent", "tether"])


TETHER, SLOPE, DRAG, POST, LOAD = "tether/0", "floor_slope/0", "viscous_drag/0", "hidden_obstacle/0", "sloshing_load/0"


@pytest.mark.parametrize("unexplained", [0.0, 70.0])
@pytest.mark.parametrize(
    ("first", "second", "share"),
    [
        (TETHER, SLOPE, DISCREPANCY),
        (SLOPE, TETHER, OF_EXACT),
        (POST, SLOPE, OF_HISTORY),
        (LOAD, TETHER, OF_HISTORY),
    ],
)
def test_one_effect_more_takes_more_than_a_wrong_law_leaves(
    unexplained: float, first: str, second: str, share: float
) -> None:
    def gained(more: float) -> float:
        found = weights(
            fitted(f"free + {first}", 900.0, 2.0 * unexplained),
            fitted(f"free + {second}", -100.0, 1000.0),
            fitted(f"free + {first} + {second}", 900.0 + more, unexplained),
        )
        both = tuple(sorted(each.split("/")[0] for each in (first, second)))
        return found[both] - found[(first.split("/")[0],)]

    # Of two that were tried, one; a share of what the first explains, of an exact law a small one; what both leave;
    # and clearly.
    assert gained(200.0) == pytest.approx(200.0 - math.log(2.0) - share * 1000.0 - unexplained - CLEAR)
    assert gained(300.0) - gained(200.0) == pytest.approx(100.0)


@pytest.mark.parametrize(("law", "exact"), [(SLOPE, True), (TETHER, False)])
def test_an_exact_law_that_leaves_a_wrench_for_certain_is_not_a_little_wrong(
    left_over: Callable[[float], None], law: str, exact: bool
) -> None:
    other, (name,) = "time_offset", fitted(f"free + {law}", 0.0).hypothesis.effects

    def gained() -> float:
        found = weights(fitted(f"free + {law}", 1900.0), fitted(f"free + {law} + {other}/0", 1918.0))
        return found[tuple(sorted((name, other)))] - found[(name,)]

    doubtful = gained()
    left_over(LEAVES / 2.0)
    # Eighteen nats are more than chance, and were less than one in a hundred of what the law explains.
    assert doubtful < 0.0 and gained() == pytest.approx(18.0 - CLEAR if exact else doubtful)


def test_what_an_exact_law_explains_leaves_less_than_what_a_wrong_one_explains_beside_it() -> None:
    # The slope explains most, the post half as much and is a little wrong: what that leaves is more.
    single, beside = fitted(f"free + {SLOPE}", 900.0), fitted(f"free + {POST}", 400.0)
    found = weights(single, beside, fitted(f"free + {SLOPE} + {POST}", 1000.0))
    gained = found["floor_slope", "hidden_obstacle"] - found["floor_slope",]
    shapes = math.log(len(EFFECTS["hidden_obstacle"].variants))
    assert gained == pytest.approx(100.0 - math.log(2.0) - shapes - OF_HISTORY * 500.0 - CLEAR)


def test_what_the_likeliest_set_leaves_counts_against_all_alike() -> None:
    one, other = f"free + {TETHER} + {SLOPE}", f"free + {TETHER} + {DRAG}"
    single = fitted(f"free + {TETHER}", 900.0)
    found = weights(single, fitted(one, 1000.0, 30.0), fitted(other, 998.0, 40.0))
    assert found["floor_slope", "tether"] - found["tether", "viscous_drag"] == pytest.approx(
        2.0 + math.log(len(EFFECTS["viscous_drag"].variants))
    )
    # A set that has no evidence leaves nothing that could count against others.
    hopeless = weights(single, fitted(one, math.nan, math.nan))
    assert math.isfinite(hopeless["tether",]) and hopeless["floor_slope", "tether"] == -math.inf


def test_a_law_is_not_named_for_a_little_more_than_its_limit_explains() -> None:
    def gained(more: float) -> float:
        found = weights(
            fitted("free + ground_friction/0", 1400.0), fitted("free + breakaway_friction/0", 1400.0 + more)
        )
        return found["breakaway_friction",] - found["ground_friction",]

    assert gained(8.0) == pytest.approx(8.0 - 15.0) and gained(40.0) == pytest.approx(40.0 - 15.0)
    alone = weights(fitted("free + breakaway_friction/0", 1400.0))
    assert alone["breakaway_friction",] == pytest.approx(
        weights(fitted("free + floor_slope/0", 1400.0))["floor_slope",]
    )


@pytest.mark.parametrize("friction", [0.0005, 0.5])
def test_a_wheel_may_roll_on_bearings_or_slide(friction: float) -> None:
    options = BaselineOptions(20.0, 0.1, 0.1, 0.02)
    wheel = baselines(options, ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    for part in wheel.parameters:
        if part.column in ("mu_x", "mu_y"):
            assert abs(math.log(friction) - part.mean) < 2.5 * part.spread


def test_what_is_known_beside_the_motion_leaves_no_share_of_the_motion_to_others() -> None:
    # Poses of the gripper say that it gives way; a law of the motion beside it explains 60 nat there and all alone.
    gives, hinge = "free + grasp_compliance/0", "free + hidden_hinge/0"
    both = fitted(f"{gives} + hidden_hinge/0", 160.0, beside=200.0)
    found = weights(fitted(gives, 100.0, beside=200.0), fitted(hinge, -40.0), both)
    assert max(found, key=lambda effects: found[effects]) == ("grasp_compliance", "hidden_hinge")
    # A gain in the motion alone, where the first has explained a lot of it, is what a wrong law leaves to any other.
    found = weights(fitted(gives, 2000.0), fitted(hinge, -40.0), fitted(both.hypothesis.variant, 2025.0))
    assert max(found, key=lambda effects: found[effects]) == ("grasp_compliance",)


@pytest.mark.parametrize(
    ("log_score", "position", "vetoed"),
    [
        (-50.0, 0.01, False),
        (-50.0, 0.99 * ASTRAY * 0.02, False),
        (-50.0, 1.01 * ASTRAY * 0.02, True),
        (-60.0 - VETO - 6.0, 0.01, True),
        (-50.0, math.nan, False),
    ],
)
def test_what_predicts_worse_than_nothing_does_is_not_named(log_score: float, position: float, vetoed: bool) -> None:
    baseline = fitted("free", -200.0)
    baseline.score = Score(-60.0, 0.02, 0.02, 0.01)
    law, other = fitted("free + tether/0", -100.0), fitted("free + detent/0", -120.0)
    weighed = tuple(
        Weighed(each.hypothesis.effects, each, each.evidence, 0.5, False) for each in (law, other, baseline)
    )

    def judge(each: Any) -> Any:
        each.score = Score(log_score, position, 0.02, 0.01) if each is law else baseline.score
        return each

    best = next(each for each in veto(weighed, baseline, judge) if each.effects == ("tether",))
    assert best.vetoed == vetoed
    assert best.log_weight == pytest.approx(-100.0 - max(-60.0 - log_score, 0.0))


@pytest.mark.parametrize(
    ("log_score", "position", "stands"),
    [
        (-50.0, 1.0, False),  # astray
        (-70.0 - VETO, 0.01, False),
        (-50.1, 0.011, False),  # a little worse than its part in both
        (-49.9, 0.011, True),
        (-50.1, 0.009, True),
    ],
)
def test_a_set_that_predicts_worse_than_its_part_leaves_it_the_name(
    log_score: float, position: float, stands: bool
) -> None:
    baseline = fitted("free", -200.0)
    baseline.score = Score(-60.0, 0.02, 0.02, 0.01)
    part, whole = fitted("free + tether/0", -110.0), fitted("free + tether/0 + wrench_bias/1", -100.0)
    hypotheses = (whole, part, baseline)
    weighed = tuple(Weighed(each.hypothesis.effects, each, each.evidence, 0.5, False) for each in hypotheses)

    def judge(each: Any) -> Any:
        each.score = Score(log_score, position, 0.02, 0.01) if each is whole else Score(-50.0, 0.01, 0.02, 0.01)
        return each

    names = [("tether", "wrench_bias"), ("tether",), ()]
    found = veto(weighed, baseline, judge)
    assert [each.effects for each in found] == (names if stands else [names[1], names[2], names[0]])
    assert found[0].probability == pytest.approx(1.0, abs=1e-4) and not found[0].vetoed


@pytest.mark.parametrize(
    ("shares", "first"),
    [
        ({("tether",): 0.49, ("com_offset", "tether"): 0.48, (): 0.03}, ("tether",)),
        ({("com_offset", "tether"): 0.48, ("tether",): 0.45, ("com_offset",): 0.04, (): 0.03}, ("tether",)),
        ({("com_offset", "tether"): 0.6, ("tether",): 0.4}, ("com_offset", "tether")),
        ({("com_offset", "tether"): 0.4, ("detent",): 0.35, (): 0.2, ("tether",): 0.05}, ("com_offset", "tether")),
        ({(): 0.9, ("tether",): 0.1}, ()),
    ],
)
def test_of_what_is_certain_to_be_there_the_most_is_named(
    shares: dict[tuple[str, ...], float], first: tuple[str, ...]
) -> None:
    fits: Any = None
    weighed = tuple(Weighed(names, fits, math.log(share), share, False) for names, share in shares.items())
    ordered = sure_first(weighed)
    assert ordered[0].effects == first
    assert sorted(each.effects for each in ordered) == sorted(shares)
    rest = [each.log_weight for each in ordered[1:]]
    assert rest == sorted(rest, reverse=True)


def test_what_comes_first_was_held_against_what_was_held_out_however_many_went_astray_before_it() -> None:
    baseline = fitted("free", -400.0)
    baseline.score = Score(-60.0, 0.02, 0.02, 0.01)
    tried = [fitted(f"free + law_{k}/0", -100.0 - 3.0 * k) for k in range(2 * JUDGED)]
    weighed = tuple(Weighed(each.hypothesis.effects, each, each.evidence, 0.1, False) for each in (*tried, baseline))

    def judge(each: Any) -> Any:
        astray = tried.index(each) <= JUDGED + 1
        each.score = Score(-160.0 if astray else -50.0, 1.0 if astray else 0.01, 0.02, 0.01)
        return each

    found = first_judged(veto(weighed, baseline, judge), baseline, judge)
    assert found[0].effects == (f"law_{JUDGED + 2}",)
    assert found[0].fitted.score is not None and not found[0].vetoed


def test_that_an_effect_is_there_is_as_probable_as_all_that_hold_it_together() -> None:
    fits: Any = None
    shares = {("com_offset", "tether"): 0.4, ("detent", "tether"): 0.2, ("detent",): 0.1, (): 0.3}
    weighed = tuple(Weighed(names, fits, math.log(share), share, False) for names, share in shares.items())
    assert held_by(weighed, ["tether"]) == pytest.approx(0.6)
    assert held_by(weighed, ["tether", "detent"]) == pytest.approx(0.2)
    assert held_by(weighed, []) == pytest.approx(1.0)
