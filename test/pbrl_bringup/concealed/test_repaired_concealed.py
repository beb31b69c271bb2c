"""A repaired model in the simulator: what its sensors show is what the library's law says; casters are those told."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bullet_sim.client import Pose, yaw_quaternion
from bullet_sim.concealed.sensing import tag_camera, wrist_sensor
from bullet_sim.hand_push import push_by_hand
from bullet_sim.hand_recording import HandPath, HandPush
from bullet_sim.model_file import concealed_of
from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from pbrl_bringup.concealed.cases import grip_turn
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.concealed.stage import NAME, draw_stage, play
from pbrl_bringup.concealed.told import told_values
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.kernels.columns import COLUMN, UNIT, neutral_row
from pbrl_mismatch.kernels.sense_kernel import acting, feel
from pbrl_mismatch.repaired import saved_model
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_model.model_file import LearnedEffect, SavedModel, Sensor, Shape, learned, save_model
from pbrl_model.transforms import rotation_matrices, yaw_matrices

SQUARE = ((-0.4, -0.7), (0.4, -0.7), (0.4, 0.7), (-0.4, 0.7))
SHAPE = Shape(footprint=SQUARE, feet=SQUARE, com=(0.0, 0.0), inertia_per_mass=0.2)
ROOM = {"outline": [[-4, -4], [4, -4], [4, 4], [-4, 4]]}
TABLE = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [1.0, 0.0, 0.0]}
QUIET = {
    "wrist_ft": {"force_noise": [0, 0, 0], "torque_noise": [0, 0, 0], "force_resolution": 0, "torque_resolution": 0},
    "tags": {"sigma_xy": 0, "sigma_z": 0, "sigma_yaw": 0, "sigma_tilt": 0, "dropout": 0, "bias": 0, "latency": 0},
}
TURN = rotation_matrices(np.array([0.03, 0.02, -0.74, 0.67]))
"""A sensor that lies nearly on its side, as on Krang."""
RATE, BEGAN, READ = 400.0, 1.2, 0.6
"""Of physics [Hz]; when the body was first held [s], and when the sensor was read at rest before."""
AHEAD = HandPath(np.array([0.0, 1.5, 2.0]), np.array([[0, 0, 0], [0.3, 0, 0], [0.3, 0, 0]]))
BIAS = {"bias_x": 2.0, "bias_y": -1.0, "bias_torque": 0.4}


def file_of(folder: Path, effect: str, values: Mapping[str, float], sensor: Sensor | None = None) -> Path:
    rows = tuple(tuple(map(float, row)) for row in TURN)
    parameters = {name: learned(UNIT[name], np.full(3, value), value) for name, value in values.items()}
    model = SavedModel(
        object="table",
        shape=SHAPE,
        parameters={"mass": learned("kg", np.full(3, 30.0), 30.0)},
        effects=(LearnedEffect(effect=effect, parameters=parameters),),
        clock=(BEGAN, 4.0),
        sensor=sensor or Sensor(gripper="left", turn=rows),  # type: ignore[arg-type]
    )
    save_model(model, folder / "model_table.json")
    return folder / "model_table.json"


def scene_with(path: Path) -> Scene:
    plain = parse_settings({"room": ROOM, "bodies": {"table": TABLE}, "sensors": QUIET}, Scene, "test")
    concealed = concealed_of(path, plain.bodies)
    return parse_settings({**plain.model_dump(exclude_unset=True), "concealed": concealed}, Scene, "test")


def row_of(values: Mapping[str, float]) -> np.ndarray:
    row = neutral_row()
    row[[COLUMN[name] for name in values]] = list(values.values())
    return row


def shown(scene: Scene, force: np.ndarray, heading: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stamps (n,) and what a recording has (n, 3) of a wrench on the body (3,), world axes, from BEGAN on.

    The sensor is turned as on the body at `heading`; its reading at rest is taken off, its opposite acts.
    """
    axes = yaw_matrices(np.array([heading]))[0] @ TURN
    on, sensor = np.zeros(6), wrist_sensor(scene, "left", np.random.default_rng(0), 1e-3)
    on[:3], on[3:] = -axes.T @ [*force[:2], 0.0], -axes.T @ [0.0, 0.0, force[2]]
    stamps, found = [], []
    for k in range(int(4.0 * RATE)):
        felt = on if k / RATE > BEGAN - 0.1 else np.zeros(6)
        reading = sensor.measure(k / RATE, felt[:3], felt[3:])
        if reading is not None:
            stamps.append(reading.stamp)
            found.append([*reading.force, *reading.torque])
    table, time = np.array(found), np.array(stamps)
    table -= table[np.argmin(np.abs(time - READ))]
    forces, torques = -table[:, :3] @ axes.T, -table[:, 3:] @ axes.T
    return time, np.column_stack([forces[:, :2], torques[:, 2]])


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("wrench_bias", BIAS),
        ("wrench_bias", {**BIAS, "bias_start": 2.5}),
        ("wrench_bias", {"drift_x": 0.3, "drift_y": -0.2, "drift_torque": 0.1}),
        ("wrench_frame", {"force_scale": 1.3, "sensor_turn": 0.4, "torque_scale": -1.0}),
        ("wrench_frame", {"force_scale": 0.8, "torque_scale": 1.2}),
        ("wrench_frame", {"sensor_turn": -0.5}),
    ],
)
def test_a_simulated_sensor_shows_what_the_law_says(tmp_path: Path, effect: str, values: dict[str, float]) -> None:
    force, heading, said = np.array([12.0, -7.0, 1.5]), 0.8, np.empty(3)
    time, found = shown(scene_with(file_of(tmp_path, effect, values)), force, heading)
    # The library's axes are those of the body when it was first held; what it feels is turned back by the mount.
    c, s = np.cos(heading), np.sin(heading)
    for stamp, wrench in zip(time, found, strict=True):
        if stamp < BEGAN or abs(stamp - values.get("bias_start", 0.0)) < 0.06:
            continue
        feel(row_of(values), force, c, s, stamp, stamp - READ, said)
        in_world = [c * said[0] - s * said[1], s * said[0] + c * said[1], said[2]]
        np.testing.assert_allclose(wrench, in_world, atol=3e-3)


@pytest.mark.parametrize("late", [0.25, -0.25])
def test_what_is_late_acts_when_the_law_says(tmp_path: Path, late: float) -> None:
    scene = scene_with(file_of(tmp_path, "time_offset", {"time_offset": late}))
    sensor, camera = (make(scene, np.random.default_rng(0)) for make in (_left, tag_camera))
    stamps, forces, dt, true = [], [], 0.01, 2.0
    for k in range(int(4.0 * RATE)):  # what acts on the body grows by a newton a second
        reading = sensor.measure(k / RATE, np.array([-k / RATE, 0.0, 0.0]), np.zeros(3))
        if reading is not None:
            stamps.append(reading.stamp)
            forces.append(-reading.force[0] + sensor.bias[0])
    camera.capture(true, {"table": Pose(np.array([1.0, 0.0, 0.7]), yaw_quaternion(0.0))})
    (seen,) = camera.deliver(true + 1.0)
    clock = np.arange(0.5, 3.5, dt)
    felt = np.column_stack([np.interp(clock, stamps, forces), np.zeros((len(clock), 2))])
    step, found = int(np.argmin(np.abs(clock - seen.stamp))), np.empty(3)
    mount, states = np.tile([1.0, 0.0, 0.0, 0.0, 0.5], (len(clock), 1)), np.zeros((len(clock), 6))
    body = np.array([0.1, 0.0, 0.0, dt])
    acting(
        row_of({"time_offset": late}),
        felt,
        mount,
        states,
        step,
        0,
        len(clock) - 1,
        clock[step],
        body,
        np.zeros(2),
        found,
    )
    # A reading is the mean since the last one, 4 ms ago in the middle.
    assert found[0] == pytest.approx(true, abs=0.01)


def _left(scene: Scene, rng: np.random.Generator) -> Any:
    return wrist_sensor(scene, "left", rng, 1e-3)


def test_what_is_told_of_a_recording_comes_back_as_what_was_concealed(tmp_path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pbrl_bringup.concealed.stage.PUSHES", 1)
        patch.setattr("pbrl_bringup.concealed.stage.SECONDS", 6.0)
        stage = draw_stage(np.random.default_rng(3))
        made = play(stage, {})
    track = track_of(to_recording(made, stage.with_concealed({})), NAME)
    free = baselines(BaselineOptions(stage.mass, 0.1, 0.1, 0.005), ["free"], np.zeros(2), stage.half, None)[0]
    fitted: Any = SimpleNamespace(hypothesis=free, peak=None, row=free.rows(free.mean[None])[0], draws=free.mean[None])
    sensor = saved_model(np.random.default_rng(0), fitted, track).sensor
    assert sensor is not None and sensor.gripper == made.side
    for settings in (
        {"wrench_bias": {"left": {"force": [3.0, -8.0, 0.0], "torque": [0.0, 0.0, 1.0], "start": 4.0, "rise": 0.3}}},
        {"wrench_frame": {"left": {"scale": 1.6, "turn": [0.0, 0.0, 0.5]}}},
        {"time_offset": {"left": {"delay": 0.25}}},
    ):
        (effect, told), *_ = settings.items()
        values = told_values(settings, stage.with_concealed(settings), grip_turn(made))
        values = {name: value for name, value in values.items() if not name.startswith(("wheel", "mu_"))}
        path = file_of(tmp_path, effect, values, sensor)
        again = concealed_of(path, stage.with_concealed({}).bodies, NAME)[effect][made.side]
        for key, value in told["left"].items():
            if key == "rise":
                assert again["start"] + 0.5 * again["rise"] == pytest.approx(4.15)
            elif key != "start":
                # As well as the first poses of the gripper tell its axes.
                np.testing.assert_allclose(again[key], value, atol=0.15)


def test_casters_that_are_told_are_made_again(tmp_path: Path) -> None:
    make = {"trail": 0.04, "radius": 0.03, "swivel_friction": 0.06, "contact_width": 0.01, "scrub_length": 0.015}
    plain = {"room": ROOM, "bodies": {"table": TABLE}, "concealed": {"caster_swivel": {"table": make}}}
    concealed = plain["concealed"]
    values = told_values(concealed, parse_settings(plain, Scene, "test"))  # type: ignore[arg-type]
    again = scene_with(file_of(tmp_path, "caster_swivel", values))
    for key in ("trail", "swivel_friction", "contact_width", "scrub_length"):
        assert getattr(again.concealed.caster_swivel["table"], key) == pytest.approx(make[key]), key
    assert told_values(again.concealed.model_dump(include={"caster_swivel"}), again) == pytest.approx(values)
    pushed = push_by_hand(again, [HandPush("table", (-0.4, 0.3), AHEAD)], seed=1)
    assert pushed.status == "done"
    moved = pushed.bodies["table"].pose
    assert 0.2 < np.hypot(*(moved[-1, :2] - moved[0, :2])) < 0.4
