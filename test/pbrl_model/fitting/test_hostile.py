"""Recordings that nothing can be learned from: one line that says where and what, or the data do not say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.errors import BagError
from pbrl_bag.types import PoseStream, Recording, WrenchStream
from pbrl_model.errors import ModelError
from pbrl_model.fitting.fit import FitOptions, fit_recording
from pbrl_model.prior_options import parse_prior_options

Maker = Callable[..., Recording]
QUICK = {"draws": 40, "search_draws": 60}


@pytest.fixture(scope="module")
def recording(make_recording: Maker) -> Recording:
    return make_recording(0, seconds=4.0)


def grasp(recording: Recording, **fields: object) -> Recording:
    return replace(recording, grasps=(replace(recording.grasps[0], **fields),))


def poses(recording: Recording, **fields: np.ndarray) -> Recording:
    return replace(recording, object_poses={"table": replace(recording.object_poses["table"], **fields)})


def hand(recording: Recording, **fields: np.ndarray) -> Recording:
    return replace(recording, gripper_poses={"left": replace(recording.gripper_poses["left"], **fields)})


def wrench(recording: Recording, **fields: np.ndarray) -> Recording:
    return replace(recording, wrenches={"left": replace(recording.wrenches["left"], **fields)})


def table(recording: Recording, **fields: object) -> Recording:
    return replace(recording, bodies={"table": replace(recording.bodies["table"], **fields)})


def some(stream: PoseStream, keep: np.ndarray) -> dict[str, np.ndarray]:
    return {"time": stream.time[keep], "position": stream.position[keep], "quaternion": stream.quaternion[keep]}


def put(values: np.ndarray, row: int, value: float) -> np.ndarray:
    out = values.copy()
    out[row] = value
    return out


BREAKS: dict[str, tuple[Callable[[Recording], Recording], str]] = {
    "empty episode": (lambda r: grasp(r, end=r.grasps[0].start), "zero length"),
    "one sample": (lambda r: grasp(r, end=r.grasps[0].start + 0.06), "at least 2 poses"),
    "backwards episode": (lambda r: grasp(r, end=r.grasps[0].start - 1.0), "zero length"),
    "never seen": (
        lambda r: poses(r, **some(r.object_poses["table"], r.object_poses["table"].time < 1.0)),
        "at least 2 poses",
    ),
    "no poses": (
        lambda r: poses(r, **some(r.object_poses["table"], r.object_poses["table"].time < -1.0)),
        "empty stream",
    ),
    "no readings": (
        lambda r: replace(r, wrenches={"left": WrenchStream(np.empty(0), np.empty((0, 3)), np.empty((0, 3)))}),
        "empty stream",
    ),
    "force NaN": (lambda r: wrench(r, force=put(r.wrenches["left"].force, 400, np.nan)), "finite readings"),
    "torque inf": (lambda r: wrench(r, torque=put(r.wrenches["left"].torque, 400, np.inf)), "finite readings"),
    "zero wrench": (
        lambda r: replace(
            r,
            wrenches={
                "left": WrenchStream(
                    r.wrenches["left"].time,
                    0.0 * r.wrenches["left"].force,
                    0.0 * r.wrenches["left"].force,
                    exerted_on="object",
                    frame="world",
                )
            },
        ),
        "zero throughout",
    ),
    "position NaN": (lambda r: poses(r, position=put(r.object_poses["table"].position, 50, np.nan)), "pose of table"),
    "position inf": (lambda r: poses(r, position=put(r.object_poses["table"].position, 50, np.inf)), "pose of table"),
    "orientation inf": (
        lambda r: poses(r, quaternion=put(r.object_poses["table"].quaternion, 50, np.inf)),
        "finite orientation",
    ),
    "hand NaN": (lambda r: hand(r, position=put(r.gripper_poses["left"].position, 50, np.nan)), "left gripper"),
    "time NaN": (lambda r: poses(r, time=put(r.object_poses["table"].time, 50, np.nan)), "finite times"),
    "time backwards": (lambda r: poses(r, time=put(r.object_poses["table"].time, 50, 0.5)), "times in order"),
    "outline crosses": (lambda r: table(r, footprint=r.bodies["table"].footprint[[0, 2, 1, 3]]), "table: footprint"),
    "outline NaN": (lambda r: table(r, footprint=put(r.bodies["table"].footprint, 0, np.nan)), "finite corners"),
    "outline flat": (lambda r: table(r, footprint=r.bodies["table"].footprint * [1.0, 0.0]), "table: footprint"),
    "mass negative": (lambda r: table(r, nominal_mass=-3.0), "nominal mass above zero"),
    "mass infinite": (lambda r: table(r, nominal_mass=np.inf), "nominal mass above zero"),
    "no geometry": (lambda r: replace(r, bodies={}), "geometry: expected that of table"),
}


@pytest.mark.parametrize("fault", BREAKS)
def test_a_fault_is_said_in_one_line(recording: Recording, fault: str) -> None:
    break_it, message = BREAKS[fault]
    with pytest.raises((ModelError, BagError), match=message) as caught:
        fit_recording(break_it(recording), FitOptions(**QUICK))
    assert "\n" not in str(caught.value)


def test_an_orientation_that_was_missed_is_no_fault(recording: Recording) -> None:
    quaternion = put(recording.object_poses["table"].quaternion, 50, np.nan)
    found = fit_recording(poses(recording, quaternion=quaternion), FitOptions(model_class="free", **QUICK))
    assert np.isfinite(found.objects["table"].posterior.draws).all()


WHEEL_ELSEWHERE = {
    "wheel_x": {"distribution": "uniform", "lower": 0.6, "upper": 0.62},
    "wheel_y": {"distribution": "uniform", "lower": -0.3, "upper": -0.28},
    "mu_x": {"distribution": "uniform", "lower": 0.8, "upper": 0.82},
    "mu_y": {"distribution": "uniform", "lower": 0.8, "upper": 0.82},
}


def test_a_prior_that_excludes_the_data_is_said(recording: Recording) -> None:
    priors = parse_prior_options({"parameters": WHEEL_ELSEWHERE})
    found = fit_recording(recording, FitOptions(priors=priors, **QUICK)).objects["table"]
    assert any("no parameters that the prior allows explain the motion" in note for note in found.notes)


@pytest.mark.parametrize("force", [3.0, 0.01])
def test_a_table_that_stood_still_is_not_known(recording: Recording, force: float) -> None:
    stream, seen = recording.wrenches["left"], recording.object_poses["table"]
    acting = np.zeros_like(stream.force)
    acting[stream.time > recording.grasps[0].start, 0] = force
    still = replace(
        recording,
        wrenches={"left": replace(stream, force=acting, torque=0.0 * acting, exerted_on="object")},
        object_poses={
            "table": PoseStream(
                seen.time,
                seen.position[:1] + 0.003 * np.random.default_rng(0).normal(size=seen.position.shape),
                np.tile([0.0, 0.0, 0.0, 1.0], (len(seen.time), 1)),
            )
        },
    )
    found = fit_recording(still, FitOptions(**QUICK)).objects["table"]
    said = " ".join(found.notes)
    assert "the data do not say how table moves" in said and "wheel_x" in said
