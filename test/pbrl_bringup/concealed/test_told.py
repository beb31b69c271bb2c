"""What the oracle is told reproduces what the simulator did: the library's law with the told values predicts it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bullet_sim.concealed.detent import catch_force
from bullet_sim.concealed.sloshing_load import SloshingLoadSettings
from pbrl_bringup.concealed.cases import grip_turn
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.concealed.stage import NAME, Stage, draw_stage, play
from pbrl_bringup.concealed.told import _obstacle, told_values
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.effects.effect import Scene
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.search.fitted import scene_of
from pbrl_mismatch.search.heldout import settle
from pbrl_mismatch.search.hypothesis import FURTHEST, BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective

SCENE = Scene(np.zeros(2), np.ones(2), np.zeros(2), np.zeros(2), np.array([0.4, 0.7]), 30.0, 10.0, 0.1, 0.0, 30.0)
EXACT: dict[str, tuple[int, Any]] = {
    "ground_friction": (0, {NAME: {"friction": 0.08}}),
    "viscous_drag": (0, {NAME: {"damping": 80.0}}),
    "floor_slope": (0, {"angle": 0.03, "heading": 2.0}),
    "com_offset": (0, {NAME: {"mass": 20.0, "place": [0.25, -0.45]}}),
    "tether": (
        0,
        {NAME: {"anchor": [-0.9, -0.5, 0.72], "point": [0.2, 0.3, -0.05], "slack_length": 0.6, "stiffness": 60.0}},
    ),
    "external_force": (0, {NAME: {"force": [6.0, -4.0]}}),
    "external_force in a rhythm": (2, {NAME: {"force": [9.0, 6.0], "period": 1.7}}),
    "external_force for a while": (1, {NAME: {"force": [9.0, 6.0], "start": 4.0, "end": 7.0}}),
    "external_force in a rhythm for a while": (
        3,
        {NAME: {"force": [9.0, 6.0], "period": 2.3, "start": 4.0, "end": 8.0}},
    ),
    "wrench_bias": (
        1,
        {"left": {"force": [3.0, -8.0, 0.0], "torque": [0.0, 0.0, 1.0], "start": 4.0, "rise": 0.3}},
    ),
    "wrench_frame": (0, {"left": {"scale": 1.6, "turn": [0.0, 0.0, 0.5]}}),
    "time_offset": (0, {NAME: {"delay": 0.3}}),
    "time_offset of the force": (0, {"left": {"delay": 0.25}}),
    "pose_bias": (0, {NAME: {"offset": [0.2, -0.15], "turn": 0.3}}),
}
"""Variant of the library's law, and settings of the simulator, where both laws are the same."""
NO_FRICTION = 2e-3  # over a load: as good as none, which has no logarithm


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pbrl_bringup.concealed.stage.PUSHES", 1)
        patch.setattr("pbrl_bringup.concealed.stage.SECONDS", 10.0)
        yield draw_stage(np.random.default_rng(3))


def misfits(stage: Stage, concealed: dict[str, Any], variant: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the misfit of each window over its count without the effect and with it as told; nothing is fitted."""
    effect = EFFECTS[next(iter(concealed))]
    made, scene = play(stage, concealed), stage.with_concealed(concealed)
    told = told_values(concealed, scene, grip_turn(made))
    cuts = cut_windows(track_of(to_recording(made, scene), NAME), 2.0)
    free = baselines(BaselineOptions(stage.mass, 0.1, 0.1, 0.005), ["free"], np.zeros(2), stage.half, None)[0]
    law = {name: told[name] for name in effect.variants[variant] if name in told} | dict(effect.given(variant))

    def misfit(values: dict[str, float]) -> np.ndarray:
        row = free.rows(free.mean[None])[0]
        row[[COLUMN[name] for name in values]] = list(values.values())
        objective = Objective(replace(free, parameters=free.parameters[-1:], base=row), cuts, 0.15)
        nuisance = settle(objective, np.zeros((1, 1)))
        return objective.misfit(objective.residual(np.zeros((1, 1)), nuisance), nuisance)[0] / objective.counts

    return misfit({}), misfit(law)


@pytest.mark.parametrize("what", EXACT)
def test_the_told_values_predict_what_the_simulator_did(stage: Stage, what: str) -> None:
    variant, settings = EXACT[what]
    without, told = misfits(stage, {what.split(" ")[0]: settings}, variant)
    # Poses that come late show in the first window what was felt before it.
    assert told[1:].mean() < 1.1 < 1.5 < without[1:].mean()


def test_an_offset_is_along_the_same_axes_in_a_later_grasp_of_another_edge() -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pbrl_bringup.concealed.stage.PUSHES", 2)
        patch.setattr("pbrl_bringup.concealed.stage.SECONDS", 6.0)
        stage = draw_stage(np.random.default_rng(8))
    first, second = (np.array(push.contact) / stage.half for push in stage.pushes)
    assert np.abs(first - second).max() > 0.5
    settings = {"left": {"force": [3.0, -8.0, 0.0], "torque": [0.0, 0.0, 1.0], "start": 11.5, "rise": 0.3}}
    without, told = misfits(stage, {"wrench_bias": settings}, 1)
    assert told.mean() < 1.1 < 5.0 < without.mean()


@pytest.mark.parametrize("effect", DRAWS)
def test_what_is_told_is_of_the_library_and_of_the_effect(stage: Stage, effect: str) -> None:
    concealed = DRAWS[effect](np.random.default_rng(5), stage, 0.5)
    told = told_values(concealed, stage.with_concealed(concealed))
    own = {parameter.column for parameter in EFFECTS[effect].parameters(SCENE)}
    of_the_wheel = {"wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y"}
    assert told.keys() <= own | of_the_wheel and all(map(math.isfinite, told.values()))
    assert told.keys() & own or effect == "grasp_compliance"


@pytest.fixture(scope="module")
def priors(stage: Stage) -> Scene:
    scene = stage.with_concealed({})
    track = track_of(to_recording(play(stage, {}), scene), NAME)
    return scene_of(track, neutral_row())


@pytest.mark.parametrize("strength", [0.0, 1.0])
@pytest.mark.parametrize("effect", DRAWS)
def test_what_is_drawn_is_within_reach_of_what_the_library_believes(
    stage: Stage, priors: Scene, effect: str, strength: float
) -> None:
    """Beyond that a law that is right is held back, and another one named for what it lacks."""
    prior = {parameter.column: parameter for parameter in EFFECTS[effect].parameters(priors)}
    for seed in range(60):
        concealed = DRAWS[effect](np.random.default_rng(seed), stage, strength)
        told = told_values(concealed, stage.with_concealed(concealed))
        for column in told.keys() & prior.keys():
            if "mu_" in column and told[column] < NO_FRICTION:
                continue
            own = prior[column]
            away = abs((math.log(told[column]) if own.positive else told[column]) - own.mean)
            assert away <= min(FURTHEST * own.spread, own.furthest), (seed, column, told[column], away / own.spread)


def test_the_corners_of_a_patch_go_round(stage: Stage) -> None:
    for seed in range(5):
        drawn = DRAWS["floor_patch"](np.random.default_rng(seed), stage, 0.5)
        told = told_values(drawn, stage.with_concealed(drawn))
        place = EFFECTS["floor_patch"].where(told, SCENE)
        assert place is not None and place.frame == "world"
        away = np.linalg.norm(place.shape[:, None] - np.array(drawn["floor_patch"][0]["polygon"]), axis=-1)
        assert away.min(axis=0).max() < 1e-9 and away.min(axis=1).max() < 1e-9
        assert -0.5 * math.pi <= told["patch_theta"] <= 0.5 * math.pi


def test_places_on_the_body_are_where_the_body_stood(stage: Stage) -> None:
    told = told_values({"hidden_hinge": {NAME: {"point": [0.2, -0.3], "stiffness": 1e4}}}, stage.with_concealed({}))
    x, y, theta = stage.table["pose"]  # type: ignore[misc]
    away = np.array([told["pivot_x"] - x, told["pivot_y"] - y])
    c, s = math.cos(theta), math.sin(theta)
    np.testing.assert_allclose([c * away[0] + s * away[1], c * away[1] - s * away[0]], [0.2, -0.3])


def test_a_load_s_damping_and_a_catch_s_width_are_the_simulator_s(stage: Stage) -> None:
    load = {"mass": 5.0, "length": 0.3, "place": [0.1, 0.0]}
    for more, damping in (({}, SloshingLoadSettings(**load).damping_ratio), ({"damping_ratio": 0.2}, 0.2)):
        told = told_values({"sloshing_load": {NAME: {**load, **more}}}, stage.with_concealed({}))
        assert told["slosh_damping"] == damping
    catch = {"place": [1.0, 0.5], "point": [0.1, 0.2], "gap": 0.04, "force": 12.0}
    width = told_values({"detent": {NAME: catch}}, stage.with_concealed({}))["detent_width"]
    away = np.linspace(0.0, 0.08, 80_001)
    pull = [catch_force(distance, 0.04) for distance in away.tolist()]
    assert width == pytest.approx(away[np.argmax(pull)], abs=2e-6)


def test_a_post_is_told_as_large_as_it_is_drawn(stage: Stage) -> None:
    drawn = DRAWS["hidden_obstacle"](np.random.default_rng(2), stage, 0.5)
    corners = np.array(drawn["hidden_obstacle"][0]["polygon"])
    told = told_values(drawn, stage.with_concealed(drawn))
    assert told["obstacle_radius"] == pytest.approx(0.5 * np.hypot(*(corners[1] - corners[0])))


@pytest.mark.parametrize("quarters", range(-2, 3))
def test_a_post_s_turn_is_told_within_a_quarter_of_a_turn(quarters: int) -> None:
    turn = 0.3 + quarters * math.pi / 2.0
    c, s = math.cos(turn), math.sin(turn)
    corners = 0.05 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ np.array([[c, s], [-s, c]]) + [1.0, -2.0]
    scene: Any = None
    told = _obstacle({"polygon": corners.tolist()}, scene, 30.0)
    assert [told[f"obstacle_{name}"] for name in ("x", "y", "angle")] == pytest.approx([1.0, -2.0, 0.3])
