"""A recording that is written reads the same; what a bag cannot hold is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag import BagError, Grasp, Recording, WrenchStream, read_recording, write_recording


@pytest.fixture
def recording(push_bag: Path) -> Recording:
    return read_recording(push_bag)


def same(one: Recording, other: Recording) -> None:
    for group in ("object_poses", "gripper_poses", "wrenches"):
        assert getattr(one, group).keys() == getattr(other, group).keys()
        for name, stream in getattr(one, group).items():
            for column, value in vars(stream).items():
                found = getattr(getattr(other, group)[name], column)
                if isinstance(value, np.ndarray):
                    np.testing.assert_allclose(found, value, rtol=0.0, atol=1e-9)
                else:
                    assert found == value
    assert one.bodies.keys() == other.bodies.keys()
    for name, body in one.bodies.items():
        for field, value in vars(body).items():
            np.testing.assert_array_equal(getattr(other.bodies[name], field), value)
    np.testing.assert_array_equal(one.room, other.room)
    assert len(one.grasps) == len(other.grasps)
    for grasp, found in zip(one.grasps, other.grasps, strict=True):
        assert (grasp.gripper, grasp.object) == (found.gripper, found.object)
        np.testing.assert_allclose([found.start, found.end], [grasp.start, grasp.end], atol=1e-9)
        np.testing.assert_array_equal(found.contact, grasp.contact)


def test_what_is_written_reads_the_same(recording: Recording, tmp_path: Path) -> None:
    same(recording, read_recording(write_recording(recording, tmp_path / "copy")))


def test_grasps_that_meet_and_one_that_ends_early(recording: Recording, tmp_path: Path) -> None:
    first = recording.grasps[0]
    middle = 0.5 * (first.start + first.end)
    contact = np.array([0.1, -0.2])
    holds = (
        Grasp("left", first.object, first.start, middle, contact),
        Grasp("left", first.object, middle, middle + 0.3, -contact),
    )
    changed = replace(recording, grasps=holds)
    same(changed, read_recording(write_recording(changed, tmp_path / "copy")))


def test_the_same_recording_makes_the_same_bytes(recording: Recording, tmp_path: Path) -> None:
    folders = [write_recording(recording, tmp_path / name / "bag") for name in ("one", "two") if _made(tmp_path / name)]
    assert len({next(folder.glob("*.mcap")).read_bytes() for folder in folders}) == 1


def _made(folder: Path) -> bool:
    folder.mkdir()
    return True


@pytest.mark.parametrize("change", [{"exerted_on": "object"}, {"frame": "world"}])
def test_wrenches_that_are_not_raw_are_refused(recording: Recording, tmp_path: Path, change: dict[str, str]) -> None:
    felt = {side: replace(stream, **change) for side, stream in recording.wrenches.items()}
    with pytest.raises(BagError, match="raw wrench in the sensor's axes"):
        write_recording(replace(recording, wrenches=felt), tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_an_error_that_stays_is_refused_and_not_left_out(recording: Recording, tmp_path: Path) -> None:
    felt = {side: replace(stream, covariance=np.eye(6)) for side, stream in recording.wrenches.items()}
    with pytest.raises(BagError, match="left: expected the wrench of a sensor, got one with the covariance"):
        write_recording(replace(recording, wrenches=felt), tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_missing_numbers_and_missing_streams_are_refused(recording: Recording, tmp_path: Path) -> None:
    felt = recording.wrenches["left"]
    blind = WrenchStream(felt.time, felt.force, np.full_like(felt.torque, np.nan))
    with pytest.raises(BagError, match="finite numbers"):
        write_recording(replace(recording, wrenches={"left": blind}), tmp_path / "bag")
    hand = recording.gripper_poses["left"]
    lost = replace(hand, quaternion=np.full_like(hand.quaternion, np.nan))
    with pytest.raises(BagError, match="left: expected finite numbers"):
        write_recording(replace(recording, gripper_poses={"left": lost}), tmp_path / "bag")
    with pytest.raises(BagError, match="at least one stream"):
        write_recording(replace(recording, wrenches={}, object_poses={}, gripper_poses={}), tmp_path / "bag")
