"""From recording to posterior: what was there is found, what is not said is not claimed, same seed same bytes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest

from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_model.distributions import LogNormal
from pbrl_model.errors import ModelError
from pbrl_model.fitting.calibration import TABLE, empty_windows
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.fitting.fit import FitOptions, fit_recording, target_of
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.geometry import mass_properties
from pbrl_model.parameters import BodyParameters, free_columns
from pbrl_model.predict import path_error, predict, predict_windows, unlearned
from pbrl_model.prior_options import MassOptions, PriorOptions
from pbrl_model.sensing.windows import whole_windows
from pbrl_model.verdicts import note_on_left_out

Maker = Callable[..., Recording]
QUICK = {"draws": 125, "search_draws": 150}
WHEEL = np.array([-0.65, 0.3])


@pytest.fixture(scope="module")
def recording(make_recording: Maker) -> Recording:
    return make_recording(0, seconds=9.0, rolling=6.0)


@pytest.mark.parametrize(
    ("seed", "fields"),
    [
        (0, {"seconds": 9.0, "rolling": 6.0}),
        (1, {"seconds": 9.0}),
        (2, {"seconds": 9.0, "rolling": 4.0, "viscous": 40.0}),
    ],
    ids=["rolling", "clean", "rolling and viscous"],
)
def test_locked_caster_is_found_whatever_else_resists(make_recording: Maker, seed: int, fields: dict) -> None:
    found = fit_recording(make_recording(seed, **fields), FitOptions(seed=seed, **QUICK)).objects["table"]
    place = np.array([found.posterior.column(name).mean() for name in ("wheel_x", "wheel_y")])
    assert np.linalg.norm(place - WHEEL) < 0.05
    assert found.heldout is not None
    assert found.heldout.after.rmse_position < 0.2 * found.heldout.before.rmse_position


def test_another_push_is_predicted(make_recording: Maker, recording: Recording) -> None:
    found = fit_recording(recording, FitOptions(**QUICK)).objects["table"]
    other = make_recording(5, seconds=8.0, rolling=6.0, contact=(-0.75, -0.25), speed=0.06)
    windows = whole_windows(motions_of(other, "table"))
    nominal = unlearned(other.bodies["table"]).to_vector()[None]
    before = path_error(windows, predict_windows(windows, nominal, found.body))
    after = path_error(windows, predict_windows(windows, found.posterior.rows(), found.body))
    assert after.final_position < 0.2 * before.final_position
    assert after.final_yaw < 0.2 * before.final_yaw


def test_a_hold_that_was_under_way_when_recording_began_is_left_out_and_said(
    make_recording: Maker, recording: Recording, held_twice: Maker
) -> None:
    second = make_recording(3, seconds=9.0, rolling=6.0)
    whole = held_twice(recording, second, 20.0)
    late = held_twice(recording, second, 20.0, heard_since=recording.grasps[0].start + 5.0)
    assert len(motions_of(whole, "table")) == 2
    (left,) = motions_of(late, "table")
    assert left.time[0] == second.grasps[0].start + 20.0
    np.testing.assert_allclose(left.wrench, motions_of(whole, "table")[1].wrench, atol=1e-9)
    assert not any("under way" in note for note in fit_recording(whole, FitOptions(**QUICK)).objects["table"].notes)
    assert any(
        "a hold was under way" in note for note in fit_recording(late, FitOptions(**QUICK)).objects["table"].notes
    )


def test_where_every_hold_was_under_way_it_is_said_what_to_do(recording: Recording) -> None:
    wrench = recording.wrenches["left"]
    keep = wrench.time >= 2.0
    heard = replace(wrench, time=wrench.time[keep], force=wrench.force[keep], torque=wrench.torque[keep])
    with pytest.raises(ModelError, match="start recording earlier"):
        motions_of(replace(recording, wrenches={"left": heard}), "table")


def test_report_is_the_contract_s(recording: Recording) -> None:
    fit = fit_recording(recording, FitOptions(**QUICK))
    report = json.loads(json.dumps(fit.to_report(), allow_nan=False))
    assert set(report) == {"recording", "objects", "seconds"}
    table = report["objects"]["table"]
    assert set(table) >= {"parameters", "log_evidence", "heldout"}
    assert set(table["parameters"]) == set(free_columns(FitOptions().model_class))
    assert all(set(value) == {"mean", "sd", "unit"} for value in table["parameters"].values())
    assert np.isfinite(table["log_evidence"]) and 0.0 < table["log_evidence_sd"] < 0.3
    assert table["heldout"]["rmse_position_m"]["after"] < table["heldout"]["rmse_position_m"]["before"]


def test_same_seed_same_bytes(recording: Recording) -> None:
    first, second, other = (fit_recording(recording, FitOptions(seed=seed, **QUICK)) for seed in (3, 3, 4))
    draws = [fit.objects["table"].posterior.draws.tobytes() for fit in (first, second, other)]
    assert draws[0] == draws[1] != draws[2]


def test_one_thread_makes_the_same_bytes_as_all(recording: Recording) -> None:
    everything = numba.get_num_threads()
    fits = []
    for threads in (1, everything):
        numba.set_num_threads(threads)
        fits.append(fit_recording(recording, FitOptions(**QUICK)).objects["table"].posterior.draws.tobytes())
    assert fits[0] == fits[1]


def test_the_thesis_s_route_gives_the_same_posterior(make_recording: Maker) -> None:
    short = make_recording(3, seconds=3.0, speed=0.2)
    common = {"model_class": "wheel", "holdout_share": 0.0, "search_draws": 100, "window": 1.5}
    ours = fit_recording(short, FitOptions(draws=250, **common)).objects["table"].posterior
    chains = {"sampler": "metropolis", "chains": 4, "burn_in": 150, "draws": 40, "thin": 3}
    theirs = fit_recording(short, FitOptions(engine="pymunk", **chains, **common)).objects["table"].posterior
    for name in ("mass", "wheel_x", "wheel_y"):
        one, other = ours.column(name).ravel(), theirs.column(name)
        # Means of chains scatter by what is left of a standard deviation in so few of their steps.
        error = np.hypot(other.mean(axis=1).std(ddof=1) / 2.0, one.std() / np.sqrt(ours.ess))
        assert one.mean() == pytest.approx(other.mean(), abs=4.0 * error + 0.1 * one.std())
        assert one.std() == pytest.approx(other.std(), rel=0.5)
    assert np.isnan(theirs.log_evidence) and np.isfinite(ours.log_evidence)


def test_a_force_that_the_model_does_not_have_is_said() -> None:
    assert note_on_left_out(np.full((4, 10, 2), 2.9), 1.0) == ()
    (note,) = note_on_left_out(np.full((4, 10, 2), 12.0), 1.0)
    assert "about 12 N" in note


@pytest.mark.parametrize("likelihood", ["one_step", "integrated"])
def test_the_thesis_s_likelihoods_run(recording: Recording, likelihood: str) -> None:
    found = fit_recording(recording, FitOptions(likelihood=likelihood, **QUICK)).objects["table"]
    assert np.isfinite(found.posterior.draws).all()
    assert found.heldout is None


@pytest.mark.parametrize("model_class", ["free", "wheel"])
def test_smaller_classes_learn_their_own_parameters(recording: Recording, model_class: str) -> None:
    found = fit_recording(recording, FitOptions(model_class=model_class, **QUICK)).objects["table"]
    assert found.names == free_columns(model_class)


def test_whole_episodes_can_be_left_out(recording: Recording) -> None:
    cut = 6.0
    grasp = recording.grasps[0]
    halves = (replace(grasp, end=cut), replace(grasp, start=cut + 0.01))
    # The second grasp needs a reading without contact before it: the sensor's stream is taken as compensated.
    stream = recording.wrenches["left"]
    free = stream.time < grasp.start - 0.1
    resting = np.concatenate([stream.force[free], stream.torque[free]], -1).mean(0)
    compensated = WrenchStream(
        stream.time, resting[:3] - stream.force, resting[3:] - stream.torque, exerted_on="object", frame="sensor"
    )
    twice = replace(recording, grasps=halves, wrenches={"left": compensated})
    found = fit_recording(twice, FitOptions(holdout_episodes=1, **QUICK)).objects["table"]
    assert found.heldout is not None and found.heldout.kind == "episodes" and found.heldout.count == 1
    with pytest.raises(ModelError, match="leave out fewer"):
        fit_recording(twice, FitOptions(holdout_episodes=2, **QUICK))


def door(radius: float = 0.3, seed: int = 0) -> Recording:
    """A handle pulled round a hinge, against friction: positions and forces, no orientation, no torque."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 9.0, 0.02)
    angle = 0.6 * (1 - np.cos(np.pi * np.clip(time - 0.5, 0, 8) / 8))
    rate, push = np.gradient(angle, time), 4.0
    place = np.stack([1.0 - radius * np.sin(angle), -0.3 - 0.0 * angle, 0 * time + 0.9], -1)
    place[:, 1] = -0.6 + radius * np.cos(angle)
    along = np.stack([-np.cos(angle), -np.sin(angle), 0 * angle], -1)
    acceleration = np.gradient(rate, time) * radius
    force = along * (push * np.tanh(rate / 0.005) + 3.0 * acceleration)[:, None]
    quaternion = np.full((len(time), 4), np.nan)
    poses = PoseStream(time, place + 5e-4 * rng.normal(size=place.shape), quaternion)
    footprint = np.array([[-0.02, -0.06], [0.02, -0.06], [0.02, 0.06], [-0.02, 0.06]])
    return Recording(
        path=Path("door"),
        bodies={"door": BodyGeometry("door", footprint, 0.4, 3.0, True, np.array([*place[0, :2], 0.0]))},
        object_poses={"door": poses},
        gripper_poses={"right": poses},
        wrenches={
            "right": WrenchStream(
                time,
                force + 0.1 * rng.normal(size=force.shape),
                np.full_like(force, np.nan),
                exerted_on="object",
                frame="world",
            )
        },
        grasps=(Grasp("right", "door", float(time[0]), float(time[-1]), np.zeros(2)),),
    )


@pytest.mark.parametrize(
    ("told", "taken"), [({}, 1.5), ({"sigma": 0.5}, 1.5), ({"sigma": 0.2}, 0.2), ({"sigma": 2}, 2)]
)
def test_how_well_a_doors_mass_is_known_can_be_told(told: dict[str, float], taken: float) -> None:
    """What it weighs at its handle is else taken for less sure than what it weighs; the usual file tells the usual."""
    options = FitOptions(model_class="hinge", priors=PriorOptions(mass=MassOptions(**told)))
    likelihood = WindowedLikelihood(mass_properties(TABLE.footprint), empty_windows(np.random.default_rng(0), "hinge"))
    assert target_of(TABLE, likelihood, options).prior.parts["mass"] == LogNormal(TABLE.nominal_mass, taken)


def test_hinge_of_a_door() -> None:
    found = fit_recording(door(), FitOptions(model_class="hinge", **QUICK)).objects["door"]
    mean = dict(zip(found.names, found.posterior.mean(), strict=True))
    assert mean["hinge_radius"] == pytest.approx(0.3, abs=0.015)
    assert [mean["hinge_x"], mean["hinge_y"]] == pytest.approx([1.0, -0.6], abs=0.02)
    np.testing.assert_array_equal(found.posterior.column("mu_x"), found.posterior.column("mu_y"))


def test_prediction_is_on_the_grid(recording: Recording) -> None:
    (motion,) = motions_of(recording, "table")
    body = fit_recording(recording, FitOptions(**QUICK)).objects["table"].body
    rows = np.stack([unlearned(recording.bodies["table"]).to_vector(), BodyParameters(mass=50.0).to_vector()])
    found = predict(motion, rows, body)
    assert found.poses.shape == (2, len(motion.time), 3) and found.mean.shape == (len(motion.time), 3)
    np.testing.assert_allclose(found.poses[:, 0], np.tile(motion.state[0, :3], (2, 1)), atol=1e-9)


def still(recording: Recording, force: float) -> Recording:
    """The same streams, but the object never moved and the wrist felt a steady force, or nothing."""
    stream, poses = recording.wrenches["left"], recording.object_poses["table"]
    rng = np.random.default_rng(0)
    held = stream.time > recording.grasps[0].start
    acting = np.zeros_like(stream.force)
    acting[held, 0] = force
    wrench = replace(stream, force=acting, torque=np.zeros_like(acting), exerted_on="object")
    fixed = PoseStream(
        poses.time,
        poses.position[:1] + 0.003 * rng.normal(size=poses.position.shape),
        np.tile([0.0, 0.0, 0.0, 1.0], (len(poses.time), 1)),
    )
    return replace(recording, wrenches={"left": wrench}, object_poses={"table": fixed})


def test_nothing_felt_is_an_error(recording: Recording) -> None:
    with pytest.raises(ModelError, match="zero throughout"):
        fit_recording(still(recording, 0.0), FitOptions(**QUICK))


def test_an_object_that_never_moved_is_not_claimed_to_be_known(recording: Recording) -> None:
    found = fit_recording(still(recording, 3.0), FitOptions(**QUICK)).objects["table"]
    assert any("do not say" in note for note in found.notes)
    spread = np.hypot(found.posterior.column("wheel_x").std(), found.posterior.column("wheel_y").std())
    assert spread > 0.1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"model_clas": "wheel"}, r"unknown option 'model_clas'; did you mean 'model_class'\?"),
        ({"model_class": "wheels"}, "model_class"),
        ({"window": 0.0}, "window"),
        ({"draws": 0}, "draws"),
        ({"sampler": "gibbs"}, "sampler"),
        ({"engine": "bullet"}, "engine"),
        ({"seed": -1}, "seed"),
        ({"holdout_share": 1.5}, "holdout_share"),
        ({"left_out_force": float("nan")}, "left_out_force"),
    ],
)
def test_options_that_make_no_sense_are_refused_in_a_line(options: dict, message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        FitOptions(**options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("break_it", "options", "message"),
    [
        (lambda r: r, {"objects": ("chair",)}, "'chair'"),
        (lambda r: replace(r, grasps=()), {}, "at least one grasp"),
        (lambda r: replace(r, grasps=(replace(r.grasps[0], end=r.grasps[0].start + 0.3),)), {}, "at least 0.5 s"),
        (lambda r: replace(r, object_poses={}), {}, "object poses"),
    ],
)
def test_recordings_that_cannot_be_learned_from(
    recording: Recording, break_it: Callable[[Recording], Recording], options: dict, message: str
) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        fit_recording(break_it(recording), FitOptions(**options, **QUICK))
    assert "\n" not in str(caught.value)
