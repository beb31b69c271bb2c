"""Sets of concealed cases: no recording twice, names that are known, and telling wrongly leaves the truth alone."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

from pbrl_bag import read_recording, write_recording
from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_bringup.commands.bench import command
from pbrl_bringup.concealed import sets
from pbrl_bringup.concealed.cases import Case, Made
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.furnished import PART_OF_IT
from pbrl_bringup.concealed.sets import (
    FIRST_SEED,
    OUTLINE_OFF,
    QUICK_EFFECTS,
    ROUGHLY,
    SETS,
    SPARE_STEP,
    SPARES,
    Trial,
    draw_pairs,
    evenly,
    go_together,
    make_trial,
    out_of_step,
    told_roughly,
    trials_of,
)
from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.errors import BringupError
from pbrl_mismatch.options import DiagnoseOptions


def small_recording() -> Recording:
    outline = np.array([[-0.3, -0.5], [0.3, -0.5], [0.3, 0.5], [-0.3, 0.5]])
    time = np.arange(5.0)
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (5, 1))
    stream = PoseStream(time, np.zeros((5, 3)), upright)
    body = BodyGeometry("table", outline, 0.7, 20.0, True, np.zeros(3))
    wrench = WrenchStream(time, np.ones((5, 3)), np.zeros((5, 3)))
    grasp = Grasp("left", "table", 0.5, 3.5, np.zeros(2))
    return Recording(Path("x"), {"table": body}, {"table": stream}, {"left": stream}, {"left": wrench}, (grasp,))


def test_a_full_run_has_every_set_as_the_acceptance_asks() -> None:
    trials = trials_of(0, quick=False)
    count = {name: sum(each.set == name for each in trials) for name in SETS}
    assert count["clean"] == 100 and count["pairs"] == 40 and count["withheld"] == len(DRAWS)
    assert count["single"] == 10 * len(DRAWS)
    assert count["furnished"] == 3 * (len(DRAWS) - len(PART_OF_IT))
    assert {each.withheld for each in trials if each.set == "withheld"} == {(name,) for name in DRAWS}
    assert len({each.name for each in trials}) == len(trials)


def test_no_recording_is_in_two_sets_or_two_seeds_and_none_is_for_development() -> None:
    def drawn(seed: int) -> list[tuple[tuple[str, ...], int]]:
        return [
            (each.case.effects, each.case.seed + SPARE_STEP * spare)
            for each in trials_of(seed, quick=False)
            for spare in range(SPARES)
        ]

    first, second = drawn(0), drawn(1)
    assert min(seed for _, seed in first) >= FIRST_SEED
    assert not set(first) & set(second)
    by_set = {
        name: {
            (t.case.effects, t.case.seed + SPARE_STEP * k) for t in trials_of(0, False, [name]) for k in range(SPARES)
        }
        for name in SETS
    }
    assert all(not by_set[a] & by_set[b] for a, b in itertools.combinations(by_set, 2))


def test_every_beginning_of_the_order_has_its_share_of_each_set_and_effect() -> None:
    trials = evenly(trials_of(0, quick=False))
    assert sorted(each.name for each in trials) == sorted(each.name for each in trials_of(0, quick=False))
    for part in (0.25, 0.5, 0.8):
        begun = trials[: round(part * len(trials))]
        for name in SETS:
            here, whole = (sum(each.set == name for each in some) for some in (begun, trials))
            assert abs(here - part * whole) <= 1.0
        counts = Counter(each.case.effects for each in begun if each.set == "single")
        assert max(counts.values()) - min(counts.values()) <= 1


def test_a_folder_s_name_says_nothing_of_what_is_concealed() -> None:
    trials = trials_of(0, quick=False)
    assert len({each.folder for each in trials}) == len(trials)
    assert all(set(each.folder) <= set("0123456789abcdef") for each in trials)
    assert {str(each.options) for each in trials if each.set in ("clean", "single", "pairs", "furnished")} == {"{}"}
    withheld = next(each for each in trials if each.set == "withheld")
    assert withheld.options == {"without": list(withheld.withheld)}
    assert next(each for each in trials if each.set == "rough").options == ROUGHLY


def test_a_quick_run_is_small_and_sets_can_be_chosen() -> None:
    assert {each.set for each in trials_of(0, quick=True)} == {"clean", "single"}
    assert {e.case.effects[0] for e in trials_of(0, True, ["rough"])} == set(QUICK_EFFECTS)
    assert {each.set for each in trials_of(0, False, ["pairs", "pairs"])} == {"pairs"}
    few = trials_of(0, False, ["single", "clean"], 2)
    assert Counter(each.case.effects for each in few) == {(): 20, **{(name,): 2 for name in DRAWS}}
    assert set(few) <= set(trials_of(0, False, ["single", "clean"]))
    with pytest.raises(BringupError, match=r"expected some of clean, single.*'pears'; did you mean 'pairs'"):
        trials_of(0, False, ["pears"])
    with pytest.raises(BringupError, match="bench wheel: expected no --sets"):
        command("wheel", None, 0, True, ["clean"], None)
    with pytest.raises(BringupError, match="bench wheel: expected no --most"):
        command("wheel", None, 0, True, [], 2)
    with pytest.raises(BringupError, match="bench wheel: expected no --minutes"):
        command("wheel", None, 0, True, [], None, 2.0)
    with pytest.raises(BringupError, match="bench wheel: expected no --carry"):
        command("wheel", None, 0, True, [], None, None, Path("cases.jsonl"))


def test_pairs_are_sensible_and_the_same_for_the_same_seed() -> None:
    pairs = draw_pairs(np.random.default_rng(3), 40)
    assert pairs == draw_pairs(np.random.default_rng(3), 40) != draw_pairs(np.random.default_rng(4), 40)
    assert len(set(pairs)) == 40 and all(one != other and go_together(one, other) for one, other in pairs)
    assert not go_together("ground_friction", "caster_swivel") and not go_together("tether", "hidden_hinge")
    assert go_together("tether", "floor_patch") and go_together("hidden_hinge", "wrench_bias")
    with pytest.raises(BringupError, match="expected at most"):
        draw_pairs(np.random.default_rng(0), 1000)


def test_telling_roughly_keeps_what_was_seen_and_bounds_what_is_wrong() -> None:
    recording = small_recording()
    told = [told_roughly(recording, np.random.default_rng(seed)) for seed in range(200)]
    moved = np.array([each.bodies["table"].footprint - recording.bodies["table"].footprint for each in told])
    assert np.abs(moved).max() <= OUTLINE_OFF and np.abs(moved).max() > 0.8 * OUTLINE_OFF
    mass = np.log([each.bodies["table"].nominal_mass / 20.0 for each in told])
    assert np.std(mass) == pytest.approx(0.2, abs=0.04) and abs(np.mean(mass)) < 0.05
    quaternions = np.array([each.gripper_poses["left"].quaternion for each in told])
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=-1), 1.0, atol=1e-12)
    turns = 2.0 * np.arctan2(quaternions[:, 0, 2], quaternions[:, 0, 3])
    assert np.std(turns) == pytest.approx(0.1, abs=0.02) and np.ptp(quaternions, axis=1).max() == 0.0
    assert all(each.object_poses is recording.object_poses and each.wrenches is recording.wrenches for each in told)
    again = told_roughly(recording, np.random.default_rng(7))
    assert again.bodies["table"].nominal_mass == told[7].bodies["table"].nominal_mass
    assert replace(recording).bodies["table"].nominal_mass == 20.0


@pytest.mark.parametrize("late", [0.25, -0.25])
def test_tags_out_of_step_are_late_against_all_else_and_a_bag_can_hold_that(late: float, tmp_path: Path) -> None:
    made = small_recording()
    off = out_of_step(made, late)
    write_recording(off, tmp_path / "bag")
    for each in (off, read_recording(tmp_path / "bag")):
        (grasp,) = each.grasps
        assert grasp.end - grasp.start == pytest.approx(3.0, abs=1e-6)
        np.testing.assert_allclose(each.object_poses["table"].time - grasp.start, np.arange(5.0) - 0.5 + late)
        np.testing.assert_allclose(each.gripper_poses["left"].time - grasp.start, np.arange(5.0) - 0.5)
        np.testing.assert_allclose(each.wrenches["left"].time - grasp.start, np.arange(5.0) - 0.5)
    assert off.object_poses["table"].position is made.object_poses["table"].position


def test_clean_recordings_are_out_of_step_and_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    truth = Truth((), "table", {}, {}, {}, 0.0, {})
    monkeypatch.setattr(sets, "make", lambda _: Made(small_recording(), truth))

    def late(of: str, seed: int) -> float:
        found = make_trial(Trial(of, Case((), seed)), _learns_nothing).recording
        return float(found.object_poses["table"].time[0] - found.wrenches["left"].time[0])

    assert np.std([late("clean", seed) for seed in range(300)]) == pytest.approx(
        DiagnoseOptions().delay_spread, rel=0.15
    )
    assert late("clean", 3) == late("clean", 3) != late("clean", 4)
    assert {late(of, seed) for of in ("single", "rough", "withheld", "pairs") for seed in range(5)} == {0.0}


def _learns_nothing(*_: object) -> NoReturn:
    raise AssertionError("expected no model to be learned where nothing is furnished")
