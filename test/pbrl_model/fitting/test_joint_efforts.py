"""Joint efforts in place of a wrist sensor: the same model comes out, as vague as the efforts are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag import Recording
from pbrl_bag.joint_efforts import JointSamples, wrench_from_efforts
from pbrl_bag.joint_efforts.stream import arm_of
from pbrl_bag.mapping import EffortSource
from pbrl_model.fitting.episodes import body_of, motions_of
from pbrl_model.fitting.fit import FitOptions, fit_recording
from pbrl_model.sensing.wrench_error import wrench_error

URDF = (Path(__file__).resolve().parents[3] / "urdf" / "krang" / "krang.urdf").read_text()
BENT = np.array([1.9, 0.2, 0.4, -0.7, 0.3, 1.2, -0.4, 0.9, 0.2])
NOISE, STAYS = 0.5, 3.0
"""How far off an effort is [N m], and for about how long [s]: the friction of a good gear."""
QUICK = {"draws": 125, "search_draws": 150}
SOURCE = EffortSource(
    topic="/joint_states",
    joints=tuple(f"LJ{k}" for k in range(1, 8)),
    tip="left_ft",
    description="/robot_description",
    noise=NOISE,
)


def by_efforts(recording: Recording, seed: int) -> Recording:
    """Return a recording whose wrench was felt by the arm's joints."""
    rng = np.random.default_rng(seed)
    felt = recording.wrenches["left"]
    angles = BENT + 0.1 * np.sin(np.outer(felt.time, 0.1 * np.arange(1, 10)))
    arm = arm_of(SOURCE, URDF, "test")
    wrench = np.column_stack([felt.force, felt.torque])
    needed = arm.torques(angles) - np.einsum("nik,ni->nk", arm.jacobians(angles), wrench)
    knots = np.arange(felt.time[0], felt.time[-1] + STAYS, STAYS)
    off = np.column_stack([np.interp(felt.time, knots, rng.normal(0.0, NOISE, len(knots))) for _ in SOURCE.joints])
    samples = JointSamples("/joint_states", SOURCE, felt.time.tolist(), (needed + off).tolist())
    samples.positions = {name: (felt.time.tolist(), angles[:, k].tolist()) for k, name in enumerate(arm.chain)}
    stream = wrench_from_efforts(samples, URDF, recording.grasps, [], "test")
    return replace(recording, wrenches={"left": stream})


def test_a_fit_on_efforts_agrees_with_the_sensors_and_is_wider(make_recording: Callable[..., Recording]) -> None:
    native = make_recording(5, seconds=9.0, rolling=4.0)
    poorer = by_efforts(native, seed=6)
    own, other = (fit_recording(each, FitOptions(**QUICK)).objects["table"] for each in (native, poorer))
    for name in ("mass", "wheel_x", "wheel_y", "mu_x"):
        column, wider = own.posterior.column(name), other.posterior.column(name)
        assert abs(column.mean() - wider.mean()) < 2.0 * wider.std(), name
    assert other.posterior.column("mass").std() > 1.05 * own.posterior.column("mass").std()
    assert any("the force is not a sensor's" in note for note in other.notes)
    assert not any("not a sensor's" in note for note in own.notes)


def test_the_error_is_that_of_the_worst_direction_in_the_plane(make_recording: Callable[..., Recording]) -> None:
    native = make_recording(5, seconds=3.0)
    motions, body = motions_of(native, "table"), body_of(native.bodies["table"], True)

    def error(*deviations: float, **changes: object) -> float:
        felt = replace(native.wrenches["left"], covariance=np.diag(np.square(deviations)), **changes)
        return wrench_error(replace(native, wrenches={"left": felt}), motions, body)

    assert wrench_error(native, motions, body) == 0.0, "a sensor's is not counted"
    vertical = {"frame": "world", "exerted_on": "object"}
    assert error(0.0, 0.0, 5.0, 0.0, 0.0, 0.0, **vertical) == pytest.approx(0.0, abs=1e-9)
    assert error(0.0, 0.0, 0.0, 0.0, 0.0, 2.0, **vertical) == pytest.approx(2.0 / np.sqrt(body.inertia_per_mass))
    even = error(3.0, 3.0, 3.0, 0.0, 0.0, 0.0)
    assert even > 3.0, "a force at the hand is a moment at the centre of mass, too"
    assert error(3.0, 3.0, 3.0, 0.0, 0.0, 0.0, **vertical) == pytest.approx(even, rel=0.02), "whatever the axes"
    assert error(3.0, 3.0, 3.0, np.nan, np.nan, np.nan) == pytest.approx(even), "a point has no torque"
