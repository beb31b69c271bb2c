"""What the grippers' poses say of the hold: the regression's closed forms, and laws on readings drawn from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest, multivariate_normal

from pbrl_bag.types import Recording
from pbrl_mismatch import track_of
from pbrl_mismatch.data.grip import GripTrack, lay_grips
from pbrl_mismatch.effects.grasp_compliance import PARAMETERS
from pbrl_mismatch.effects.pose_bias import PARAMETERS as TAG_PARAMETERS
from pbrl_mismatch.kernels.columns import neutral_row
from pbrl_mismatch.observability.power import needed
from pbrl_mismatch.search import grip as gripping
from pbrl_mismatch.search.grip import (
    BETWEEN,
    CAMERA_SPREAD,
    FREE_PLACE,
    NEW_RUBBER,
    NEW_RUBBER_SPREAD,
    POINT_SPREAD,
    SOFT_FORCE,
    grip_evidence,
    moved_on,
)
from pbrl_mismatch.search.grip_noise import LASTS
from pbrl_mismatch.search.hypothesis import Hypothesis

DELAY, NOISE = 0.005, 0.002
CONTACT = np.array([[0.5, 0.1], [-0.2, -0.4]])


def turned(angle: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]])


def lasting(rng: np.random.Generator, spread: float, kept: float) -> np.ndarray:
    """Draw (80, 2) of a spread, each with a share kept of the one before."""
    drawn = spread * rng.standard_normal((80, 2))
    for k in range(1, 80):
        drawn[k] = kept * drawn[k - 1] + np.sqrt(1.0 - kept**2) * drawn[k]
    return drawn


def readings(
    rng: np.random.Generator, compliance: float = NEW_RUBBER, play: float = 0.0, late: float = 0.0, kept: float = 0.0
) -> GripTrack:
    """Draw two grasps of forty readings, with an error of the gripper's point in each and one of the camera.

    Each reading has a share `kept` of the noise and of the force of the one before.
    """
    grasp = np.repeat([0, 1], 40)
    force = lasting(rng, 12.0, kept)
    heading, turn = np.cumsum(0.1 * rng.standard_normal(80)), 0.3 * rng.standard_normal(80)
    velocity = 0.1 * rng.standard_normal((80, 2))
    place = 0.02 * rng.standard_normal((2, 2))[grasp]
    place += turned(turn, 0.005 * rng.standard_normal((2, 2))[grasp])
    place += turned(-heading, np.tile(0.005 * rng.standard_normal(2), (80, 1)))
    place += compliance * force + play * force / (np.hypot(*force.T)[:, None] + SOFT_FORCE) + late * velocity
    place += lasting(rng, NOISE, kept)
    return GripTrack(grasp, np.arange(80.0), place, heading, turn, CONTACT[grasp], force, velocity)


def seen_off(grips: GripTrack, offset: np.ndarray) -> GripTrack:
    """Return readings as a tag that is off by (x, y, turn) makes one see them."""
    first = np.searchsorted(grips.grasp, grips.grasp)
    way = offset[:2] + offset[2] * np.column_stack([-grips.contact[:, 1], grips.contact[:, 0]])
    return replace(grips, place=grips.place + turned(grips.turn - grips.turn[first], way) - way)


def test_a_tag_s_offset_shows_where_the_edge_turns_and_none_is_held_against_it() -> None:
    wide, none = np.diag([0.06, 0.06, 0.15]) ** 2, np.zeros(3)
    for seed in range(6):
        grips = readings(np.random.default_rng(seed))
        there = np.array([0.04, -0.03, 0.02])
        with_tag = grip_evidence(seen_off(grips, there), DELAY).rigid
        assert with_tag.of_tag(none, wide) > 10.0 and grip_evidence(grips, DELAY).rigid.of_tag(none, wide) < 0.0
        # An offset that is known is better than one that is not, and a wrong one is worse.
        assert with_tag.of_tag(there, 1e-6 * np.eye(3)) > with_tag.of_tag(none, wide)
        assert with_tag.of_tag(-there, 1e-6 * np.eye(3)) < 0.0


def test_a_body_that_is_seen_far_from_where_it_is_held_is_a_mismatch_whatever_the_law() -> None:
    for seed in range(6):
        grips = readings(np.random.default_rng(seed))
        told = grip_evidence(grips, DELAY).p_value
        # Of a centimetre that each grasp may be off nobody is surprised, of five of all of them one is.
        assert grip_evidence(seen_off(grips, np.array([0.05, -0.04, 0.0])), DELAY).p_value < 1e-3 < told
        assert grip_evidence(seen_off(grips, np.array([0.004, 0.003, 0.0])), DELAY).p_value > 0.1 * told


def test_what_a_told_model_has_between_gripper_and_body_is_no_mismatch_and_not_found_again() -> None:
    none = (np.zeros(0), np.zeros((0, 0)))
    for seed in range(4):
        grips = readings(np.random.default_rng(seed))
        cases = {
            "grasp_compliance": readings(np.random.default_rng(seed), compliance=6e-4),
            "time_offset": readings(np.random.default_rng(seed), late=0.15),
            "pose_bias": seen_off(grips, np.array([0.08, -0.07, 0.0])),
        }
        for effect, recorded in cases.items():
            assert grip_evidence(recorded, DELAY).p_value < 1e-3
            found = grip_evidence(recorded, DELAY, (effect,))
            assert found.p_value > 0.01, effect
            if effect == "pose_bias":
                continue  # its coordinates are the motion's
            model = Hypothesis((), "told", (), neutral_row(), told=(effect,))
            assert found.beside(model, *none) == found.beside(replace(model, effects=(effect,), told=()), *none)
            assert found.beyond(model, *none, BETWEEN) < 3.0 < found.beyond(replace(model, told=()), *none, BETWEEN)
            # What the model does not have is a mismatch as before.
            other = "time_offset" if effect == "grasp_compliance" else "grasp_compliance"
            assert grip_evidence(recorded, DELAY, (other,)).p_value < 1e-3


def test_the_odds_of_a_tag_s_offset_are_those_of_the_gaussian_that_it_is() -> None:
    found = grip_evidence(readings(np.random.default_rng(0)), DELAY).rigid
    rng, mean = np.random.default_rng(1), np.array([0.004, -0.002, 0.003])
    spread = np.diag([0.004, 0.003, 0.01]) ** 2
    draws = rng.multivariate_normal(mean, spread, 200_000)
    gained = draws @ found.tag_pull - 0.5 * np.einsum("ni,ij,nj->n", draws, found.tag_precision, draws)
    assert found.of_tag(mean, spread) == pytest.approx(
        float(np.logaddexp.reduce(gained) - np.log(len(gained))), abs=0.1
    )


@pytest.mark.parametrize("kept", [0.0, 0.5])
def test_the_evidence_is_that_of_the_gaussian_that_the_law_is(kept: float) -> None:
    grips = readings(np.random.default_rng(0), compliance=4e-4, kept=kept)
    found = grip_evidence(grips, DELAY)
    size = np.hypot(*grips.force.T)[:, None]
    laws = np.stack([grips.force, grips.force / (size + SOFT_FORCE), grips.velocity], -1).reshape(-1, 3)
    own, spread = [], []
    for k in (0, 1):
        for unit in np.eye(2):
            for angle, sigma in ((np.zeros(80), FREE_PLACE), (grips.turn, POINT_SPREAD)):
                own.append((turned(angle, np.tile(unit, (80, 1))) * (grips.grasp == k)[:, None]).reshape(-1))
                spread.append(sigma)
    for unit in np.eye(2):
        own.append(turned(-grips.heading, np.tile(unit, (80, 1))).reshape(-1))
        spread.append(CAMERA_SPREAD)
    places = np.array(own).T
    every = np.column_stack([places, laws])
    seen = grips.place.reshape(-1)
    free, same = len(seen) - every.shape[1], np.repeat(grips.grasp, 2)[:, None] == np.repeat(grips.grasp, 2)

    def restricted(tau: float) -> tuple[float, float, np.ndarray]:
        """Return the log of the restricted likelihood, the noise's variance and its correlation (2 N, 2 N)."""
        gap = np.abs(grips.time[:, None] - grips.time)
        alike = np.exp(-gap / tau) if tau else np.eye(80)
        noise = np.kron(alike, np.eye(2)) * same
        inner = every.T @ np.linalg.solve(noise, every)
        rest = seen - every @ np.linalg.solve(inner, every.T @ np.linalg.solve(noise, seen))
        variance = float(rest @ np.linalg.solve(noise, rest)) / free
        size = np.linalg.slogdet(noise)[1] + np.linalg.slogdet(inner)[1]
        return -0.5 * float(size) - 0.5 * free * np.log(variance), variance, noise

    _, variance, noise = max(map(restricted, LASTS), key=lambda each: each[0])
    assert (noise[0, 2] > 0.3) == (kept > 0.0)

    def evidence(wide: list[float]) -> float:
        design, prior = np.column_stack([places, laws]), np.array([*spread, *wide])
        covariance = (design * prior**2) @ design.T + variance * noise
        value = multivariate_normal.logpdf(seen - laws[:, 0] * NEW_RUBBER, np.zeros(len(seen)), covariance)
        common = 0.5 * len(seen) * np.log(2.0 * np.pi * variance) + 0.5 * float(np.linalg.slogdet(noise)[1])
        return float(value) + common

    soft = [parameter.spread for parameter in PARAMETERS]
    assert found.rigid.evidence == pytest.approx(evidence([NEW_RUBBER_SPREAD, 1e-9, DELAY]), abs=1e-3)
    assert found.gives.evidence == pytest.approx(evidence([*soft, DELAY]), abs=1e-3)
    assert found.late.evidence == pytest.approx(evidence([NEW_RUBBER_SPREAD, 1e-9, 0.12]), abs=1e-3)


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.6])
def test_p_values_are_uniform_where_the_hold_is_as_it_should_be(kept: float) -> None:
    rng = np.random.default_rng(1)
    values = []
    for _ in range(200):
        rubber = NEW_RUBBER + NEW_RUBBER_SPREAD * rng.standard_normal()
        values.append(
            grip_evidence(readings(rng, rubber, late=DELAY * rng.standard_normal(), kept=kept), DELAY).p_value
        )
    assert kstest(values, "uniform").pvalue > 0.01, np.sort(values)


@pytest.mark.parametrize("wanted", [0.5, 0.95])
def test_a_soft_hold_is_noticed_at_least_as_often_as_its_distance_says(wanted: float) -> None:
    """Of three numbers a test to one side counts two in the mean; what is faint it sees a little more often."""
    rng, noticed = np.random.default_rng(6), []
    for _ in range(200):
        state = rng.bit_generator.state
        found = grip_evidence(readings(rng), DELAY)
        way = np.array([1e-4, 1e-3]) * np.abs(rng.standard_normal(2))
        way *= np.sqrt(needed(2, 0.05, wanted) / found.noncentrality(way[None])[0])
        rubber = NEW_RUBBER + NEW_RUBBER_SPREAD * rng.standard_normal()
        late = DELAY * rng.standard_normal()
        again = np.random.default_rng()
        again.bit_generator.state = state
        held = grip_evidence(readings(again, rubber + way[0], way[1], late), DELAY)
        noticed.append(held.p_value < 0.05)
    assert wanted - 0.05 < np.mean(noticed) < wanted + 0.15


@pytest.mark.parametrize(("compliance", "play"), [(6e-4, 0.0), (NEW_RUBBER, 4e-3), (5e-4, 3e-3)])
def test_a_hold_that_gives_is_seen_and_measured(compliance: float, play: float) -> None:
    rng, off = np.random.default_rng(2), []
    for _ in range(30):
        found = grip_evidence(readings(rng, compliance, play), DELAY)
        assert found.p_value < 1e-6 and found.gives.evidence > max(found.rigid.evidence, found.late.evidence) + 5.0
        off.append(
            np.linalg.solve(
                np.linalg.cholesky(found.gives.covariance[:2, :2]), found.gives.mean[:2] - [compliance, play]
            )
        )
    assert 0.6 < np.mean(np.square(off)) < 1.6


@pytest.mark.parametrize(("compliance", "play"), [(-6e-4, 0.0), (NEW_RUBBER, -4e-3)])
def test_no_hold_gives_way_against_the_force(compliance: float, play: float) -> None:
    rng = np.random.default_rng(4)
    values = [grip_evidence(readings(rng, compliance, play), DELAY).p_value for _ in range(40)]
    assert min(values) > 1e-3 and np.mean(np.array(values) < 0.05) < 0.1


def test_how_a_smoother_bends_the_path_is_no_way_of_the_hold(concealed_recording: Callable[..., Recording]) -> None:
    recording = concealed_recording("clean", 1)
    track = track_of(recording, "table")
    bent = 1e-3 * np.sin(2.0 * np.pi * track.clock / 3.0)
    seen = track.seen.copy()
    for begin, last in zip(track.begin, track.last, strict=True):
        rows = slice(int(begin), int(last) + 1)
        # What holds on is where the contact is at first: that stays.
        seen[rows, :2] += (bent[rows] * (track.clock[rows] > track.clock[rows][0] + 2.0))[:, None]
    straight, found = (lay_grips(recording, each) for each in (track, replace(track, seen=seen)))
    moved = np.hypot(*(found.place - straight.place).T)
    assert np.median(moved) < 1e-4 and np.quantile(moved, 0.9) < 3e-4


def test_poses_that_are_late_are_no_soft_hold() -> None:
    found = grip_evidence(readings(np.random.default_rng(3), late=0.1), DELAY)
    assert found.late.evidence > max(found.rigid.evidence, found.gives.evidence) + 5.0 and found.p_value < 1e-6


def test_readings_lie_where_the_gripper_holds(concealed_recording: Callable[..., Recording]) -> None:
    recording = concealed_recording("grasp_compliance", 1)
    grips = lay_grips(recording, track_of(recording, "table"))
    assert grips is not None and len(grips.time) > 25
    assert set(grips.grasp) == {0} and np.all(np.diff(grips.time) > 0.0)
    found = grip_evidence(grips, DELAY)
    assert found.gives.evidence > found.rigid.evidence + 5.0
    clean = concealed_recording("clean", 1)
    rigid = lay_grips(clean, track_of(clean, "table"))
    assert rigid is not None
    assert np.abs(rigid.place).max() < 0.012 and grip_evidence(rigid, DELAY).p_value > 0.01


def test_what_one_effect_says_of_the_readings_the_others_are_held_against() -> None:
    nothing = np.zeros(0), np.zeros((0, 0))

    def with_effects(*names: str) -> Hypothesis:
        return Hypothesis(names, "free", (), neutral_row())

    late = grip_evidence(readings(np.random.default_rng(3), late=0.1), DELAY)
    assert late.beyond(with_effects(), *nothing, BETWEEN) > 5.0
    assert late.beyond(with_effects("time_offset"), *nothing, BETWEEN) < 5.0
    # What the library does without would explain nothing.
    assert late.beyond(with_effects(), *nothing, ["viscous_drag"]) == -np.inf
    both = grip_evidence(readings(np.random.default_rng(3), 6e-4, late=0.1), DELAY)
    for names in (("grasp_compliance",), ("time_offset",)):
        assert both.beyond(with_effects(*names), *nothing, BETWEEN) > 5.0
    assert both.beyond(with_effects("grasp_compliance", "viscous_drag", "time_offset"), *nothing, BETWEEN) < 5.0
    # What the motion says of a tag is what the readings are held against; what else is on does not matter.
    wide, off = np.diag([0.06, 0.06, 0.15]) ** 2, np.array([0.04, -0.03, 0.02])
    tag = grip_evidence(seen_off(readings(np.random.default_rng(5)), off), DELAY)
    named = Hypothesis(("pose_bias",), "free", TAG_PARAMETERS, neutral_row())
    assert tag.beyond(with_effects("viscous_drag"), *nothing, BETWEEN) > 5.0
    assert tag.beyond(named, off, 1e-6 * wide, BETWEEN) < 5.0
    assert tag.beside(named, np.zeros(3), wide) > tag.beside(named, -off, 1e-6 * wide)


def test_a_hold_that_gives_way_moves_on_with_what_it_was_laid_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def fit(variant: str, evidence: float) -> Any:
        return SimpleNamespace(hypothesis=SimpleNamespace(variant=variant), evidence=evidence)

    monkeypatch.setattr(gripping, "beside_motion", lambda each, grip: each)
    hold = " + grasp_compliance/0"
    monkeypatch.setattr(
        gripping, "gives_way", lambda each, grip: fit(f"{each.hypothesis.variant}{hold}", each.evidence + 8.0)
    )
    bases = [fit("free", 20.0), fit("wheel", 10.0)]
    tried = [fit("free + floor_patch/0", 115.0), fit(f"free + floor_patch/0{hold}", 108.0), fit(f"free{hold}", 13.0)]
    tried += [fit(f"wheel{hold}", 50.0), fit(f"caster{hold}", 5.0), fit("free + tether/0", 90.0)]
    grip: Any = object()
    found = moved_on(tried, bases, grip)
    assert [each.hypothesis.variant for each in found] == [each.hypothesis.variant for each in tried]
    # Of a ground that is no longer there, and of one that is behind, it stays as it was.
    assert [each.evidence for each in found] == [115.0, 123.0, 28.0, 50.0, 5.0, 90.0]
    assert moved_on(tried, bases, None) == tried


def test_a_gripper_that_is_seen_without_its_orientation_says_nothing(
    concealed_recording: Callable[..., Recording],
) -> None:
    recording = concealed_recording("clean", 1)
    track = track_of(recording, "table")
    whole = lay_grips(recording, track)
    ((name, stream),) = recording.gripper_poses.items()
    bare = np.full_like(stream.quaternion, np.nan)
    assert lay_grips(replace(recording, gripper_poses={name: replace(stream, quaternion=bare)}), track) is None
    bare[: len(bare) // 2] = stream.quaternion[: len(bare) // 2]
    half = lay_grips(replace(recording, gripper_poses={name: replace(stream, quaternion=bare)}), track)
    assert half is not None and whole is not None and 0 < len(half.time) < len(whole.time)
    assert np.isfinite(half.place).all() and np.isfinite(half.turn).all()


def test_readings_that_a_law_fits_exactly_are_weighed() -> None:
    grips = readings(np.random.default_rng(4))
    assert grip_evidence(replace(grips, place=np.zeros_like(grips.place)), DELAY).p_value > 0.5


def test_where_no_gripper_was_seen_nothing_is_said(concealed_recording: Callable[..., Recording]) -> None:
    recording = concealed_recording("clean", 1)
    track = track_of(recording, "table")
    assert lay_grips(replace(recording, gripper_poses={}), track) is None


def test_readings_too_few_to_know_their_noise_say_nothing() -> None:
    grips = readings(np.random.default_rng(4))
    for count in range(1, 7):
        few = GripTrack(*(getattr(grips, each.name)[:count] for each in fields(grips)))
        assert grip_evidence(few, DELAY) is None
    assert grip_evidence(GripTrack(*(getattr(grips, each.name)[:12] for each in fields(grips))), DELAY) is not None
