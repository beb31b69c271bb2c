"""Stretches of a left-out wrench: their evidence, the best cuts, the frame, and how surely a change is known."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from wandering import moments

from pbrl_mismatch.unknown.samples import Samples
from pbrl_mismatch.where.axes import FRAMES, axes_of
from pbrl_mismatch.where.floor import floor_region
from pbrl_mismatch.where.partition import StretchEvidence, inverted, partition


def pushed(samples: Samples, frame: str, wrench: tuple[float, float, float], first: int, end: int) -> Samples:
    """Return moments with a wrench that is constant in a frame added to some of them."""
    more = samples.wrench.copy()
    more[first:end] += axes_of(samples, frame)[first:end] @ np.array(wrench)
    return replace(samples, wrench=more)


def turned(samples: Samples, angle: float, shift: tuple[float, float]) -> Samples:
    """Return the same moments in a world that is turned and shifted."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    whole = np.block([[turn, np.zeros((2, 1))], [np.zeros((1, 2)), np.ones((1, 1))]])
    return replace(
        samples,
        place=samples.place @ turn.T + shift,
        heading=samples.heading + angle,
        velocity=samples.velocity @ turn.T,
        wrench=samples.wrench @ whole.T,
        covariance=whole @ samples.covariance @ whole.T,
    )


def test_the_evidence_of_a_stretch_is_its_closed_form() -> None:
    samples = moments(np.random.default_rng(0), 7, 0.5)
    found = StretchEvidence(samples, 0.8, 0.3)
    noise = np.zeros((21, 21))
    for k in range(7):
        noise[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = samples.covariance[k] + 0.09 * np.diag(samples.scale**2)
    flat, width = samples.wrench.reshape(-1), 3.0 * 0.8 * samples.scale
    wanted = [multivariate_normal(np.zeros(21), noise).logpdf(flat)]
    for frame in FRAMES:
        design = axes_of(samples, frame).reshape(21, 3)
        wanted.append(multivariate_normal(np.zeros(21), noise + design * width**2 @ design.T).logpdf(flat))
    got = found.of_each(np.array([0]), np.array([7]))[:, 0]
    constant = -0.5 * 21 * math.log(2.0 * math.pi)
    np.testing.assert_allclose(got + constant, wanted, atol=1e-9)


def test_the_cuts_are_the_best_of_all() -> None:
    samples = pushed(moments(np.random.default_rng(3), 9, 0.5), "world", (3.0, 0.0, 0.0), 3, 6)
    got = partition(samples)
    size = math.sqrt(float(np.mean((samples.wrench / samples.scale) ** 2)))
    evidence = StretchEvidence(samples, size, got.left_over)
    best = -math.inf
    for count in range(9):
        for cuts in itertools.combinations(range(1, 9), count):
            ends = np.array([0, *cuts, 9])
            best = max(best, float(evidence.of_all(ends[:-1], ends[1:]).sum()) - count * math.log(8))
    assert got.evidence == pytest.approx(best, abs=1e-9)
    assert [each.first for each in got.stretches[1:]] == [each.end for each in got.stretches[:-1]]
    assert (got.stretches[0].first, got.stretches[-1].end) == (0, 9)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_wrench_is_found_when_it_was_there_and_in_its_frame(frame: str) -> None:
    samples = pushed(moments(np.random.default_rng(1), 120, 0.3), frame, (-1.5, 0.6, 0.2), 40, 90)
    found = partition(samples)
    (one,) = [each for each in found.stretches if each.there]
    assert one.frame == frame and one.frames[frame] > 0.99
    assert np.all(np.abs(one.mean - [-1.5, 0.6, 0.2]) < 4.0 * one.sd)
    begun, ended = found.changes
    assert abs(begun.time - samples.time[40]) < 0.8 and abs(ended.time - samples.time[90]) < 0.8


def test_two_causes_have_each_its_own_frame() -> None:
    samples = moments(np.random.default_rng(2), 120, 0.3)
    samples = pushed(pushed(samples, "velocity", (-2.0, 0.0, 0.0), 10, 50), "world", (0.0, 2.0, 0.0), 70, 110)
    there = [each for each in partition(samples).stretches if each.there]
    assert [each.frame for each in there] == ["velocity", "world"]


def test_a_change_is_known_as_well_as_it_says() -> None:
    off = []
    for seed in range(60):
        samples = pushed(moments(np.random.default_rng(seed), 80, 1.0), "world", (1.2, 0.0, 0.0), 40, 80)
        changes = partition(samples).changes
        if len(changes) == 1:
            truth = 0.5 * (samples.time[39] + samples.time[40])
            off.append((changes[0].time - truth) / changes[0].sd)
    assert len(off) > 30
    assert 0.6 < float(np.sqrt(np.mean(np.square(off)))) < 1.5


def test_noise_alone_has_no_stretch() -> None:
    found = [partition(moments(np.random.default_rng(seed), 100, 1.0)) for seed in range(40)]
    assert sum(each.there.any() for each in found) <= 2


def test_the_room_s_axes_do_not_matter() -> None:
    samples = pushed(moments(np.random.default_rng(5), 90, 0.3), "world", (1.0, -1.0, 0.3), 30, 60)
    one, other = partition(samples), partition(turned(samples, 2.1, (3.0, -5.0)))
    assert other.evidence == pytest.approx(one.evidence, abs=1e-6)
    assert [each.end for each in other.stretches] == [each.end for each in one.stretches]
    there = next(k for k, each in enumerate(one.stretches) if each.there)
    c, s = math.cos(2.1), math.sin(2.1)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(other.stretches[there].mean, turn @ one.stretches[there].mean, atol=1e-6)


def test_what_goes_by_place_has_a_region_and_what_does_not_has_none() -> None:
    samples = moments(np.random.default_rng(6), 150, 0.2)
    right = np.flatnonzero(samples.place[:, 0] > 0.6)
    rubbed = samples.wrench.copy()
    rubbed[right] += axes_of(samples, "velocity")[right] @ [-4.0, 0.0, 0.0]
    region = floor_region(samples, partition(replace(samples, wrench=rubbed)))
    assert region is not None and region.passes > 1 and region.share_there > 0.8
    assert region.shape[:, 0].min() == pytest.approx(0.6, abs=0.25)
    timed = pushed(samples, "velocity", (-4.0, 0.0, 0.0), 50, 100)
    assert floor_region(timed, partition(timed)) is None
    everywhere = pushed(samples, "velocity", (-4.0, 0.0, 0.0), 0, 150)
    assert floor_region(everywhere, partition(everywhere)) is None


def test_small_matrices_are_inverted() -> None:
    root = np.random.default_rng(0).normal(size=(20, 3, 3))
    matrices = root @ np.swapaxes(root, 1, 2) + np.eye(3)
    inverse, determinant = inverted(matrices)
    np.testing.assert_allclose(inverse, np.linalg.inv(matrices), atol=1e-10)
    np.testing.assert_allclose(determinant, np.linalg.det(matrices), rtol=1e-10)
