"""Which angles and faces each model class allows (thesis figures 39 and 40)."""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
import pytest
from floor_cases import TABLE

from pbrl_control.errors import ControlError
from pbrl_control.grasping import GraspModel
from pbrl_control.grasping.model_rules import BAND, fixed_point_angles, ray_hits
from pbrl_control.planar import rotation

CENTRE = np.zeros(2)
FIXED_W, FIXED_H = 1.5, 0.75
SPREAD = math.atan2(math.sqrt(3.0) / 2.0, FIXED_W / (2.0 * FIXED_H))


def hit_faces(model: GraspModel, rng: np.random.Generator, count: int = 200) -> np.ndarray:
    """Return the points (n, 2) that a model's rays reach on the table."""
    angles = model.angles(TABLE.footprint, CENTRE, count, rng)
    return np.array([ray_hits(TABLE.footprint, CENTRE, float(angle)) for angle in angles])


def test_an_unconstrained_object_is_grasped_all_round(rng: np.random.Generator) -> None:
    points = hit_faces(GraspModel("unconstrained"), rng)
    on = [points[:, 0] < -0.374, points[:, 0] > 0.374, points[:, 1] < -0.749, points[:, 1] > 0.749]
    assert np.any(on, axis=0).all(), "every ray ends on the outline"
    shares = np.mean(on, axis=1)
    subtended = 2.0 * math.atan2(0.75, 0.375) / (2.0 * math.pi)  # of a long face, seen from the centre
    np.testing.assert_allclose(shares[:2], subtended, atol=0.01)
    np.testing.assert_allclose(shares[2:], 0.5 - subtended, atol=0.01)


@pytest.mark.parametrize(
    ("axis", "allowed"),
    [
        (0.0, [True, False, True, False]),
        (math.pi / 2, [False, True, False, True]),
        (-math.pi, [True, False, True, False]),
    ],
)
def test_an_anisotropic_object_is_grasped_across_its_free_axis(axis: float, allowed: list[bool]) -> None:
    model = GraspModel("anisotropic", free_axis=axis)
    assert [model.face_fault(normal) == "" for normal in (0.0, math.pi / 2, math.pi, -math.pi / 2)] == allowed


def test_slanting_free_axis_leaves_every_object_a_face(rng: np.random.Generator) -> None:
    for axis in rng.uniform(-10.0, 10.0, 100):
        model = GraspModel("anisotropic", free_axis=float(axis))
        assert any(model.face_fault(normal) == "" for normal in (0.0, math.pi / 2, math.pi, -math.pi / 2))


def test_fixed_point_angles_are_those_of_the_footnote() -> None:
    """The table's long side is its y; anchored at the low end, rays go to both long faces near the high end."""
    angles = fixed_point_angles(TABLE.footprint, CENTRE, np.array([0.3, -0.65]))
    np.testing.assert_allclose(sorted(angles), sorted([math.pi / 2 - SPREAD, math.pi / 2 + SPREAD]))
    far = np.array([ray_hits(TABLE.footprint, CENTRE, angle) for angle in angles])
    np.testing.assert_allclose(np.abs(far[:, 0]), 0.375)
    np.testing.assert_allclose(far[:, 1], FIXED_W / 2.0 / math.sqrt(3.0))


def test_fixed_point_rays_stay_in_their_bands_and_away_from_the_anchor(rng: np.random.Generator) -> None:
    anchor = np.array([-0.3, 0.65])
    model = GraspModel("fixed-point", anchor=anchor)
    angles = model.angles(TABLE.footprint, CENTRE, 100, rng)
    middle = np.array(fixed_point_angles(TABLE.footprint, CENTRE, anchor))
    off = np.abs(np.remainder(angles[:, None] - middle + math.pi, 2.0 * math.pi) - math.pi).min(axis=1)
    assert off.max() <= BAND + 1e-12
    points = hit_faces(model, rng)
    assert np.hypot(*(points - anchor).T).min() > 0.8


def test_an_anchor_in_the_middle_leaves_both_ends() -> None:
    assert len(fixed_point_angles(TABLE.footprint, CENTRE, np.array([0.01, 0.0]))) == 4


def test_turning_the_object_turns_the_angles(rng: np.random.Generator) -> None:
    anchor, theta = np.array([0.3, -0.65]), 0.7
    turned = fixed_point_angles(TABLE.footprint @ rotation(theta).T, CENTRE, rotation(theta) @ anchor)
    plain = fixed_point_angles(TABLE.footprint, CENTRE, anchor)
    away = np.remainder(np.subtract.outer(np.array(turned), np.array(plain) + theta) + math.pi, 2 * math.pi) - math.pi
    assert np.abs(away).min(axis=1).max() < 1e-9


def test_a_string_enumeration_names_a_class_too() -> None:
    kind = StrEnum("kind", {"FIXED_POINT": "fixed-point"}).FIXED_POINT
    assert GraspModel(kind, anchor=np.zeros(2)).refusal() == ""


def test_a_static_object_is_refused_with_the_reason() -> None:
    assert "static" in GraspModel("static").refusal()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"kind": "liquid"}, "expected one of static, unconstrained, anisotropic, fixed-point"),
        ({"kind": "fixed-point"}, "expected a finite anchor"),
        ({"kind": "fixed-point", "anchor": np.array([np.nan, 0.0])}, "expected a finite anchor"),
        ({"kind": "fixed-point", "anchor": np.zeros(3)}, "expected a finite anchor"),
        ({"kind": "anisotropic"}, "expected the angle of its free axis"),
        ({"kind": "anisotropic", "free_axis": math.inf}, "expected the angle of its free axis"),
    ],
)
def test_a_class_without_what_it_needs_is_refused(arguments: dict, complaint: str) -> None:
    with pytest.raises(ControlError, match=complaint):
        GraspModel(**arguments)
