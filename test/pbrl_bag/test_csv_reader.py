"""CSV through a mapping: units, signs, frames; and files that are not what they should be."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag import BagError, cut_episodes, read_recording

HERE = Path(__file__).resolve().parent
EXCERPT = HERE / "data" / "ikea_cabinet_excerpt.csv"
MAPPING = HERE.parents[1] / "config" / "mappings" / "pr2_cabinet.yaml"

SMALL = """
time: {column: t, unit: ms}
world: lab
frames:
  bench: {position: [1.0, 2.0, 0.0], quaternion: [0.0, 0.0, 0.7071067811865476, 0.7071067811865476]}
bodies:
  box: {footprint: [[0, 0], [1, 0], [1, 1], [0, 1]], height: 0.5, nominal_mass: 3.0}
object_poses:
  box: {position: [x, y, 0.0], yaw: a, unit: cm, angle_unit: deg, frame: bench}
wrenches:
  left: {force: [fx, 0.0, 0.0], torque: [0.0, 0.0, tz], unit: lbf, sign: -1, exerted_on: object, axes: bench}
grasps:
  - {gripper: left, object: box, start: 0.1, end: 0.3}
"""
ROWS = ["t,x,y,a,fx,tz"] + [f"{100 * i},{10 * i},0,{i},{i},{2 * i}" for i in range(5)]


def read(tmp_path: Path, rows: list[str], mapping: str = SMALL):
    (tmp_path / "data.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "map.yaml").write_text(mapping)
    return read_recording(tmp_path / "data.csv", tmp_path / "map.yaml")


def refusal(tmp_path: Path, rows: list[str], mapping: str = SMALL) -> str:
    with pytest.raises(BagError) as caught:
        read(tmp_path, rows, mapping)
    assert "\n" not in str(caught.value)
    assert "data.csv" in str(caught.value)
    return str(caught.value)


def test_a_real_pull_reads_as_handle_path_and_force_on_the_door() -> None:
    recording = read_recording(EXCERPT, MAPPING)
    with EXCERPT.open() as file:
        rows = list(csv.DictReader(file))
    door, felt = recording.object_poses["door"], recording.wrenches["right"]
    np.testing.assert_allclose(door.position[:, 0], [float(row["hook_x_m"]) for row in rows])
    np.testing.assert_allclose(felt.force[:, 1], [-float(row["wrist_fy_N"]) for row in rows])
    assert np.isnan(door.quaternion).all()
    assert np.isnan(felt.torque).all()
    assert (felt.frame, felt.exerted_on) == ("world", "object")
    (episode,) = cut_episodes(recording)
    assert (episode.start, episode.end) == (door.time[0], door.time[-1])
    assert episode.grippers == ("right",)
    np.testing.assert_array_equal(episode.contacts["right"], [0.0, 0.0])
    # The pull does work on the door: force along the motion, summed over the path, is positive.
    middle = 0.5 * (felt.force[1:] + felt.force[:-1])
    assert np.sum(middle * np.diff(door.position, axis=0)) > 0.0


def test_units_signs_and_frames_end_up_in_si_and_world(tmp_path: Path) -> None:
    recording = read(tmp_path, ROWS)
    box, felt = recording.object_poses["box"], recording.wrenches["left"]
    np.testing.assert_allclose(box.time, [0.0, 0.1, 0.2, 0.3, 0.4])
    # The bench is turned by 90 degrees: its x axis is the lab's y axis.
    np.testing.assert_allclose(box.position, [[1.0, 2.0 + 0.1 * i, 0.0] for i in range(5)], atol=1e-12)
    yaw = 2.0 * np.arctan2(box.quaternion[:, 2], box.quaternion[:, 3])
    np.testing.assert_allclose(yaw, math.pi / 2 + np.deg2rad(np.arange(5)))
    np.testing.assert_allclose(felt.force, [[0.0, -4.4482216152605 * i, 0.0] for i in range(5)], atol=1e-12)
    np.testing.assert_allclose(felt.torque[:, 2], [-2.0 * i for i in range(5)])
    np.testing.assert_allclose(recording.bodies["box"].pose, [1.0, 2.0, math.pi / 2])
    assert [(grasp.start, grasp.end) for grasp in recording.grasps] == [(0.1, 0.3)]


def test_what_is_to_be_ignored_is_not_read(tmp_path: Path) -> None:
    mapping = SMALL.replace("yaw: a,", "yaw: a, ignore_orientation: true,")
    mapping = mapping.replace("torque: [0.0, 0.0, tz],", "torque: [0.0, 0.0, tz], ignore_torque: true,")
    mapping = mapping.replace("nominal_mass: 3.0", "nominal_mass: 3.0, pose: [0, 0, 0]")
    recording = read(tmp_path, ["t,x,y,no_angle,fx,no_torque", *ROWS[1:]], mapping)
    assert np.isnan(recording.object_poses["box"].quaternion).all()
    assert np.isnan(recording.wrenches["left"].torque).all()


def test_half_of_a_recording_can_be_looked_at(tmp_path: Path) -> None:
    """What is asked to be read as far as it goes may hold a gripper that felt nothing."""
    mapping = SMALL[: SMALL.index("wrenches:")] + SMALL[SMALL.index("grasps:") :]
    assert "wrenches.left" in refusal(tmp_path, ROWS, mapping)
    recording = read_recording(tmp_path / "data.csv", tmp_path / "map.yaml", complete=False)
    assert set(recording.object_poses) == {"box"} and "there is no wrench in it" in recording.notes


def test_streams_cannot_be_written_to(tmp_path: Path) -> None:
    box = read(tmp_path, ROWS).object_poses["box"]
    with pytest.raises(ValueError, match="read-only"):
        box.position[0, 0] = 1.0


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([], ["empty"]),
        ([""], ["empty"]),
        (ROWS[:1], ["zero length"]),
        (ROWS[:2], ["at least 2 rows"]),
        ([ROWS[0].replace("fx", "fy"), *ROWS[1:]], ["'fx'", "did you mean"]),
        ([ROWS[0].replace("fx", "x"), *ROWS[1:]], ["'x'", "twice"]),
        ([*ROWS[:3], "200,20,0,2,nan,4"], ["line 4", "fx", "'nan'"]),
        ([*ROWS[:3], "200,20,0,2,,4"], ["line 4", "fx", "''"]),
        ([*ROWS[:3], "200,20,0,2,inf,4"], ["line 4", "fx", "'inf'"]),
        ([*ROWS[:3], "200,20,zero,2,1,4"], ["line 4", "y", "'zero'"]),
        ([*ROWS[:3], "200,20,0"], ["line 4", "expected 6 cells, got 3"]),
        ([*ROWS[:3], "50,20,0,2,1,4"], ["line 4", "t", "backwards", "0.05"]),
        ([*ROWS[:3], "100,20,0,2,1,4"], ["line 4", "stands still"]),
        ([*ROWS[:3], "200,900,0,2,1,4"], ["object_poses.box", "t = 0.200000 s", "position", "jumps"]),
        ([*ROWS[:3], "200,20,0,180,1,4"], ["object_poses.box", "t = 0.200000 s", "orientation", "jumps"]),
        ([row.replace(",", ";") for row in ROWS], ["expected column 't'"]),
    ],
)
def test_a_malformed_file_is_refused_by_line_and_column(tmp_path: Path, rows: list[str], words: list[str]) -> None:
    message = refusal(tmp_path, rows)
    for word in words:
        assert word in message


def test_another_delimiter_can_be_said(tmp_path: Path) -> None:
    recording = read(tmp_path, [row.replace(",", ";") for row in ROWS], SMALL + 'delimiter: ";"\n')
    assert len(recording.object_poses["box"].time) == 5


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("time: {column: t, unit: ms}", "", ["expected `time`"]),
        ("force: [fx, 0.0, 0.0], torque: [0.0, 0.0, tz]", "topic: /ft", ["wrenches.left", "/ft", "`force`"]),
        ("position: [x, y, 0.0], yaw: a", "topic: /box", ["object_poses.box", "/box", "`position`"]),
        (", yaw: a", "", ["bodies.box", "theta"]),
        ("end: 0.3", "end: 9.0", ["between 0 and 0.400 s"]),
        ("object: box,", "object: bax,", ["'bax'"]),
        ("grasps:\n  - {gripper: left, object: box, start: 0.1, end: 0.3}", "", ["grasps"]),
        ("gripper: left, object: box", "gripper: right, object: box", ["wrenches.right"]),
    ],
)
def test_a_mapping_that_does_not_fit_is_refused(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    assert old in SMALL
    (tmp_path / "data.csv").write_text("\n".join(ROWS) + "\n")
    (tmp_path / "map.yaml").write_text(SMALL.replace(old, new))
    with pytest.raises(BagError) as caught:
        read_recording(tmp_path / "data.csv", tmp_path / "map.yaml")
    for word in words:
        assert word in str(caught.value)


def test_csv_without_a_mapping_is_refused() -> None:
    with pytest.raises(BagError, match="needs a mapping"):
        read_recording(EXCERPT)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "data.csv").write_bytes(b"t,x\n\xff\xfe\x00\x01,2\n")
    (tmp_path / "map.yaml").write_text(SMALL)
    with pytest.raises(BagError, match="UTF-8"):
        read_recording(tmp_path / "data.csv", tmp_path / "map.yaml")
