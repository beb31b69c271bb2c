"""The repaired model's file simulates what the diagnosis simulated, and a baseline read from it leaves nothing out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, MismatchError, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.repaired import load_repaired, predict_repaired, rows_of, saved_model, simulate_recorded
from pbrl_mismatch.search.fitted import Fitted, cut_stages, fit_baseline, fit_from, scene_of
from pbrl_mismatch.search.hypothesis import BaselineOptions, Hypothesis, baselines
from pbrl_mismatch.search.predictive import predictive_test
from pbrl_mismatch.search.told_baseline import baseline_from_model, is_model_file, told_baselines
from pbrl_model.arviz_bridge import save_posterior
from pbrl_model.model_file import LearnedEffect, SavedModel, posterior_of, save_model
from pbrl_model.rollout import rollout

OPTIONS = DiagnoseOptions(windows=(1.0,), keep=(4,), iterations=(8,), survivors=(), workers=1)
SPREADS = {"inertia_spread": 0.1, "delay_spread": 0.005}


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("viscous_drag", 3), "table")


def peaked(made: Hypothesis, u: np.ndarray) -> Any:
    """Return what stands for a hypothesis fitted to coordinates (1, K), sure to one in a hundred."""
    peak = SimpleNamespace(coordinates=u, covariance=lambda row: 1e-4 * np.eye(u.shape[1]))
    return SimpleNamespace(hypothesis=made, peak=peak, row=made.rows(u)[0], draws=None)


def hypothesis(track: Any, kind: str, *effects: str) -> Hypothesis:
    told = BaselineOptions(20.0, 0.1, 0.1, 0.005)
    made = baselines(told, [kind], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    for name in effects:
        made = made.with_effect(EFFECTS[name], scene_of(track, made.rows(made.mean[None])[0]), 0)
    return made


@pytest.fixture(scope="module")
def fitted(track: Any) -> Fitted:
    made = hypothesis(track, "free", "viscous_drag")
    return fit_from(made, cut_stages(track, OPTIONS), made.mean[None], OPTIONS)


@pytest.fixture(scope="module")
def saved(track: Any, fitted: Fitted) -> SavedModel:
    return saved_model(np.random.default_rng(0), fitted, track, ["a note"])


def test_the_file_simulates_what_the_fit_simulated(
    saved: SavedModel, fitted: Fitted, track: Any, tmp_path: Path
) -> None:
    save_model(saved, tmp_path / "model_table.json")
    read = load_repaired(tmp_path / "model_table.json")
    cuts = cut_windows(track, 2.0)
    assert np.array_equal(simulate_recorded(read, cuts), poses(fitted.row[None], cuts)[0])


def test_draws_are_those_of_the_posterior(saved: SavedModel, fitted: Fitted, track: Any) -> None:
    again = saved_model(np.random.default_rng(0), fitted, track, ["a note"])
    assert again == saved, "same seed, same draws"
    many = saved_model(np.random.default_rng(1), fitted, track, draws=20_000)
    drawn = fitted.hypothesis.coordinates(rows_of(many, draws=True))
    scale = np.sqrt(np.diag(fitted.peak.covariance(0)))
    assert np.abs((np.cov(drawn.T) - fitted.peak.covariance(0)) / np.outer(scale, scale)).max() < 0.04


@pytest.mark.parametrize("effect", list(EFFECTS))
def test_every_effect_survives_the_file(track: Any, tmp_path: Path, effect: str) -> None:
    for variant in range(len(EFFECTS[effect].variants)):
        base = hypothesis(track, "caster")
        made = base.with_effect(EFFECTS[effect], scene_of(track, base.rows(base.mean[None])[0]), variant)
        u = made.sample_prior(np.random.default_rng(4), 1)
        told = saved_model(np.random.default_rng(2), peaked(made, u), track)
        save_model(told, tmp_path / "model.json")
        read = load_repaired(tmp_path / "model.json")
        assert read.names == (effect,)
        assert np.array_equal(rows_of(read)[0], made.rows(u)[0], equal_nan=True)


def test_without_effects_a_prediction_is_pbrl_model_s(track: Any) -> None:
    made = hypothesis(track, "ground")
    at = np.array([[np.log(18.0), 0.0, 0.0, np.log(0.02)]])
    model = saved_model(np.random.default_rng(0), peaked(made, at), track)
    wrench = np.array([6.0, 3.0, 1.0]) * np.sin(np.linspace(0, 6, 300))[:, None]
    start = np.array([0.3, -0.2, 0.7, 0.05, 0.0, 0.1])
    row = posterior_of(model).rows()[0].copy()
    row[[0, 11]] = 18.0, 0.02
    shape = model.shape
    for turning in (False, True):
        ours = predict_repaired(model, start, wrench, body_wrench=turning)[0]
        theirs = rollout(row[None], start[None], wrench[None], shape.inertia_per_mass, shape.com, body_wrench=turning)[
            0, 0
        ]
        assert np.abs(ours - theirs).max() < (2e-3 if turning else 1e-9), np.abs(ours - theirs).max()


def test_a_force_at_a_contact_turns_the_body_by_its_lever(saved: SavedModel) -> None:
    wrench, start = np.tile([0.0, 4.0, 0.0], (100, 1)), np.zeros(6)
    lever = 0.5
    moved = np.tile([0.0, 4.0, 4.0 * lever], (100, 1))
    contact = np.array(saved.shape.com) + np.array([lever, 0.0])
    at_contact = predict_repaired(saved, start, wrench, contact=contact, body_wrench=True)
    assert np.allclose(at_contact, predict_repaired(saved, start, moved, body_wrench=True), atol=1e-9)


def test_a_pin_is_at_rest_where_a_prediction_begins(track: Any) -> None:
    made = hypothesis(track, "free", "hidden_hinge")
    at = made.mean[None].copy()
    at[0, made.columns.index("pivot_off_x")] = 2.0 * made.spread[made.columns.index("pivot_off_x")]
    model = saved_model(np.random.default_rng(0), peaked(made, at), track)
    assert rows_of(model)[0, COLUMN["pivot_off_x"]] == pytest.approx(0.01)
    path = predict_repaired(model, np.array([0.4, -0.3, 0.9, 0.0, 0.0, 0.0]), np.zeros((100, 3)))[0]
    np.testing.assert_allclose(path, np.tile(path[0], (101, 1)), atol=1e-9)


def test_drag_slows_a_prediction_and_draws_scatter_about_the_best(saved: SavedModel) -> None:
    start, wrench = np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0]), np.zeros((200, 3))
    best = predict_repaired(saved, start, wrench)
    drag, mass = (saved.all_parameters()[name].best for name in ("drag_linear", "mass"))
    # m v' = -c v from v = 1/2 m/s in implicit steps of 10 ms, each pose moved by the velocity before: a geometric sum.
    kept = 1.0 / (1.0 + 0.01 * drag / mass)
    assert abs(best[0, -1, 0] - 0.5 * 0.01 * (1.0 - kept**200) / (1.0 - kept)) < 1e-6
    drawn = predict_repaired(saved, start, wrench, draws=True)
    assert drawn.shape == (200, 201, 3)
    assert abs(drawn[:, -1, 0].mean() - best[0, -1, 0]) < 4.0 * drawn[:, -1, 0].std() / np.sqrt(200) + 1e-3


def test_a_sensor_s_faults_act_on_what_it_measured_and_on_nothing_else(track: Any, fitted: Fitted) -> None:
    model = saved_model(np.random.default_rng(0), fitted, track)
    bias = model.parameters["delay"].model_copy(update={"unit": "N", "best": 2.0})
    fault = LearnedEffect(effect="wrench_bias", parameters={"bias_x": bias})
    faulty = model.model_copy(update={"effects": (*model.effects, fault)})
    start, wrench = np.zeros(6), np.tile([5.0, 0.0, 0.0], (100, 1))
    clean = predict_repaired(model, start, wrench - [2.0, 0.0, 0.0], body_wrench=True)
    assert np.allclose(predict_repaired(faulty, start, wrench, body_wrench=True, measured=True), clean, atol=1e-3)
    really = predict_repaired(model, start, wrench, body_wrench=True)
    assert np.array_equal(predict_repaired(faulty, start, wrench, body_wrench=True), really)
    # An offset that comes on in the middle has acted for the second half, and a drift for as long as there was to act.
    start_at = model.parameters["delay"].model_copy(update={"unit": "s", "best": 0.495})  # between two steps
    late = LearnedEffect(effect="wrench_bias", parameters={"bias_x": bias, "bias_start": start_at})
    drift = LearnedEffect(effect="wrench_bias", parameters={"drift_x": bias.model_copy(update={"unit": "N/s"})})
    clock = np.arange(100)[:, None] / 100.0
    for effect, off in ((late, clock >= 0.5), (drift, clock)):
        told = model.model_copy(update={"effects": (*model.effects, effect)})
        clean = predict_repaired(model, start, wrench - 2.0 * off * [1.0, 0.0, 0.0], body_wrench=True)
        assert np.allclose(predict_repaired(told, start, wrench, body_wrench=True, measured=True), clean, atol=1e-4)
    with pytest.raises(MismatchError, match="set body_wrench"):
        predict_repaired(faulty, start, wrench, measured=True)


def test_what_the_baseline_has_is_no_mismatch_and_is_kept(
    track: Any, fitted: Fitted, saved: SavedModel, tmp_path: Path
) -> None:
    stages = cut_stages(track, OPTIONS)
    free = fit_baseline(np.random.default_rng(0), track, hypothesis(track, "free"), stages, OPTIONS)
    assert predictive_test(free.peak, 0).p_value < 1e-3
    save_model(saved, tmp_path / "model.json")
    told = baseline_from_model(tmp_path / "model.json", **SPREADS)
    assert told.object == "table" and told.effects == ("viscous_drag",) and told.hypothesis.effects == ()
    assert set(told.hypothesis.columns) == set(fitted.hypothesis.columns)
    found = fit_baseline(np.random.default_rng(0), track, told.hypothesis, stages, OPTIONS)
    assert predictive_test(found.peak, 0).p_value > 1e-3
    drag = COLUMN["drag_linear"]
    assert abs(np.log(found.row[drag] / fitted.row[drag])) < 0.1
    # A model that is repaired on top of a repaired one has what both found.
    scene = scene_of(track, found.row)
    made = told.hypothesis.with_effect(EFFECTS["wrench_bias"], scene, 0)
    twice = saved_model(np.random.default_rng(0), peaked(made, made.mean[None]), track)
    assert twice.names == ("viscous_drag", "wrench_bias")
    assert set(twice.effects[0].parameters) == set(saved.effects[0].parameters)
    save_model(twice, tmp_path / "twice.json")
    assert baseline_from_model(tmp_path / "twice.json", **SPREADS).effects == twice.names


def test_what_a_pin_was_off_its_rest_says_nothing_of_the_next_recording(track: Any, tmp_path: Path) -> None:
    made = hypothesis(track, "free", "hidden_hinge")
    save_model(
        saved_model(np.random.default_rng(0), peaked(made, made.mean[None] + made.spread), track), tmp_path / "m.json"
    )
    told = baseline_from_model(tmp_path / "m.json", **SPREADS).hypothesis
    believed = {each.column: each for each in told.parameters}
    own = {each.column: each for each in made.parameters}
    for column in ("pivot_off_x", "pivot_off_y"):
        assert (believed[column].mean, believed[column].spread) == (0.0, own[column].spread)
    assert believed["pivot_x"].spread < 0.1 * own["pivot_x"].spread


def test_a_posterior_of_fit_is_a_baseline_too(track: Any, fitted: Fitted, tmp_path: Path) -> None:
    plain = saved_model(np.random.default_rng(0), fitted, track).model_copy(update={"effects": ()})
    posterior = posterior_of(plain)
    save_posterior(posterior, tmp_path / "posterior_table.nc")
    told = baseline_from_model(tmp_path / "posterior_table.nc", **SPREADS)
    mass = next(each for each in told.hypothesis.parameters if each.column == "mass")
    assert abs(mass.mean - np.log(posterior.flat[:, 0]).mean()) < mass.spread
    assert {"mass", "inertia_factor", "delay"} == set(told.hypothesis.columns)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda text: text.replace('"viscous_drag"', '"viscous_drug"'), "did you mean 'viscous_drag'?"),
        (lambda text: text.replace('"drag_turn"', '"drag_trun"'), "did you mean 'drag_turn'?"),
        (lambda text: text.replace('"N s/m"', '"lbf"'), "expected the unit N s/m"),
        (lambda text: "{}", "expected a model of format"),
    ],
)
def test_a_file_that_cannot_be_simulated_is_refused(
    saved: SavedModel, tmp_path: Path, spoil: Callable[[str], str], said: str
) -> None:
    path = tmp_path / "model.json"
    save_model(saved, path)
    path.write_text(spoil(path.read_text()))
    with pytest.raises(MismatchError) as caught:
        baseline_from_model(path, **SPREADS)
    assert said in str(caught.value) and str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_models_are_told_of_what_was_held(saved: SavedModel, tmp_path: Path) -> None:
    save_model(saved, tmp_path / "table.json")
    save_model(saved.model_copy(update={"object": "chair"}), tmp_path / "chair.json")
    both = DiagnoseOptions(models=(tmp_path / "table.json", tmp_path / "chair.json"))
    assert set(told_baselines(["table"], both)) == {"table", "chair"}
    assert told_baselines(["table"], DiagnoseOptions()) == {}
    with pytest.raises(MismatchError, match="expected a model of what was held, 'sofa', got one of 'table' and of 'ch"):
        told_baselines(["sofa"], both)
    twice = DiagnoseOptions(models=(tmp_path / "table.json", tmp_path / "table.json"))
    with pytest.raises(MismatchError, match="expected one model of 'table', got a second"):
        told_baselines(["table"], twice)


def test_a_name_of_a_kind_is_no_file(tmp_path: Path) -> None:
    assert is_model_file("out/model_table.json") and is_model_file("posterior.nc") and not is_model_file("wheel+ground")
    with pytest.raises(MismatchError, match="another ending"):
        baseline_from_model(tmp_path / "model.yaml", **SPREADS)


@pytest.mark.parametrize(
    ("start", "wrench", "said"),
    [
        (np.zeros(5), np.zeros((3, 3)), "a state of 6 numbers"),
        (np.zeros(6), np.zeros((3, 2)), "wrenches"),
        (np.zeros(6), np.full((3, 3), np.nan), "finite"),
        (np.zeros(6), np.zeros((0, 3)), "wrenches"),
    ],
)
def test_a_prediction_from_nonsense_is_refused(saved: SavedModel, start: Any, wrench: Any, said: str) -> None:
    with pytest.raises(MismatchError, match=said):
        predict_repaired(saved, start, wrench)
