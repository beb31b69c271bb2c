"""Tags all the way: rendered by the simulator, found by the library, in one process and without middleware."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from scipy.spatial.transform import Rotation

from bullet_sim.client import Pose
from bullet_sim.errors import SimError
from bullet_sim.scene import Scene, with_tags
from bullet_sim.tag_sheet import load_tag_sheet as simulators_sheet
from bullet_sim.tag_sheet import worn_tags as simulators_tags
from krang_sim.errors import KrangError
from krang_sim.hand_session import HandSession, straight_push
from krang_sim.messages import message_types, to_messages
from krang_sim.observations import CameraPicture, Observation, TagReading, Transforms
from krang_sim.session import KrangSession
from pbrl_bringup.benches.tags import KINDS, WAYS, Reading, Trial, figure, furnished, rows_of, run_trial, summary
from pbrl_bringup.commands.bench import BENCHES
from pbrl_bringup.paths import config_file
from pbrl_bringup.rendered_tags import reader_of, tag_reader
from pbrl_model.tags.sheet import load_tag_sheet, worn_tags

DESK = {"kind": "office_table", "size": [0.75, 1.5], "height": 0.7775, "nominal_mass": 33.0, "pose": [1.19, -0.25, 0.4]}


def make_scene(**sections: Any) -> Scene:
    room = {"outline": [[-1.5, -2.0], [3.5, -2.0], [3.5, 2.0], [-1.5, 2.0]]}
    tags = {"source": "rendered", "rate": 10.0, "latency": 0.05}
    cameras = {"oversampling": 1}
    return Scene.model_validate(
        {"room": room, "bodies": {"desk": DESK}, "sensors": {"tags": tags, "cameras": cameras}} | sections
    )


def run(session: KrangSession, seconds: float) -> list[Observation]:
    seen: list[Observation] = []
    while session.time < seconds:
        session.command_base(0.1, 0.2)
        seen += session.step()
    return seen


def truth(session: KrangSession) -> dict[str, Pose]:
    positions, quaternions = session.robot.link_poses(["left_ft", "right_ft"])
    poses = {"desk": session.world.pose("desk")}
    for side, place, turn in zip(("left", "right"), positions, quaternions, strict=True):
        poses[f"{side}_gripper"] = Pose(place, turn)
    return poses


def test_both_sides_read_the_same_sheet():
    theirs, ours = simulators_sheet(), load_tag_sheet(config_file("params", "tags"))
    assert theirs.model_dump() == ours.model_dump()
    bodies = ("a", "b", "c")
    simulated, read = simulators_tags(theirs, bodies), worn_tags(ours, bodies)
    assert {n: [m.model_dump() for m in mounts] for n, mounts in simulated.items()} == {
        n: [m.model_dump() for m in mounts] for n, mounts in read.items()
    }


@pytest.mark.parametrize("seed", [0, 1])
def test_tags_say_where_things_are_while_the_robot_stands(seed):
    scene = make_scene()
    with KrangSession(scene, seed=seed, read_tags=reader_of(scene)) as session:
        seen = [session.step() for _ in range(40)]
        readings = [each for step in seen for each in step if isinstance(each, TagReading)]
        places = truth(session)
    assert {each.tag for each in readings} == set(places)
    for each in readings:
        assert each.time == 0.0025  # when the picture was taken, not when it came
        assert np.linalg.norm(each.position - places[each.tag].position) < 0.008
        turn = Rotation.from_quat(each.quaternion) * Rotation.from_quat(places[each.tag].quaternion).inv()
        assert abs(turn.as_rotvec()[2]) < np.deg2rad(1.0)
    first = next(number for number, step in enumerate(seen) if any(isinstance(each, TagReading) for each in step))
    assert (first + 1) * 0.0025 == pytest.approx(0.0025 + 0.05, abs=0.0026)


def test_without_a_reader_pictures_come_and_calibrations_with_them():
    with KrangSession(make_scene(), seed=0) as session:
        seen = run(session, 0.12)
        assert session.cameras == 6
        types = message_types(session.tagged, session.cameras)
    pictures = [each for each in seen if isinstance(each, CameraPicture)]
    assert [each.camera for each in pictures] == list(range(6))
    assert not any(isinstance(each, TagReading) for each in seen)
    (frames,) = (each for each in seen if isinstance(each, Transforms) and each.static)
    told = dict(zip(frames.children, frames.positions, strict=True))
    for picture in pictures:
        np.testing.assert_array_equal(told[picture.frame], picture.position)
        for topic, message in to_messages(picture):
            assert types[topic] is type(message)
            assert message.header.frame_id == picture.frame
            assert deserialize_message(serialize_message(message), type(message)) == message
    info, image = (message for _, message in to_messages(pictures[0]))
    assert (image.height, image.width, image.step, len(image.data)) == (960, 1280, 1280, 960 * 1280)
    assert info.k[0] == pictures[0].matrix[0, 0] and list(info.d) == pictures[0].distortion.tolist()
    assert "/ar_tags/desk/pose" not in types


def test_same_seed_same_bytes_and_another_seed_other_ones():
    def pictures(seed: int) -> list[bytes]:
        with KrangSession(make_scene(), seed=seed) as session:
            return [each.image.tobytes() for each in run(session, 0.06) if isinstance(each, CameraPicture)]

    first = pictures(3)
    assert len(first) == 6
    assert first == pictures(3)
    assert first != pictures(4)


def test_plates_and_cameras_do_not_touch_the_world():
    """The same commands move robot and table to the same places, to the last bit, whatever the tags are made of."""
    ends = []
    for source in ("noise", "rendered"):
        with KrangSession(with_tags(make_scene(), source), seed=5) as session:
            run(session, 1.0)
            ends.append(np.concatenate([np.concatenate([p.position, p.quaternion]) for p in truth(session).values()]))
    np.testing.assert_array_equal(ends[0], ends[1])


def test_a_tag_glued_on_askew_is_read_askew():
    concealed = {"pose_bias": {"desk": {"offset": [0.05, 0.0], "turn": 0.1}}}
    scene = make_scene(concealed=concealed)
    with KrangSession(scene, seed=0, read_tags=reader_of(scene)) as session:
        readings = [each for each in run(session, 0.06) if isinstance(each, TagReading) and each.tag == "desk"]
        true = session.world.pose("desk")
    off = true.matrix.T @ (readings[0].position - true.position)
    np.testing.assert_allclose(off, [0.05, 0.0, 0.0], atol=0.008)


def test_what_pictures_cannot_do_is_refused():
    late = make_scene(concealed={"time_offset": {"desk": {"delay": 0.1}}})
    with pytest.raises(KrangError, match=r"time_offset\.desk"):
        KrangSession(late, seed=0)
    with pytest.raises(KrangError, match="expected rendered for a reader of pictures"):
        KrangSession(with_tags(make_scene(), "noise"), seed=0, read_tags=tag_reader(("desk",)))
    assert reader_of(with_tags(make_scene(), "noise")) is None


def test_the_hand_has_no_cameras():
    with HandSession(make_scene(), seed=0, publish=lambda news: None) as session:
        push = straight_push("desk", (-0.375, 0.0), (1.0, 0.0), 0.05, 1.0)
        with pytest.raises(SimError, match="expected noise here, got rendered"):
            session.push(push)


def test_a_trial_of_the_bench_reads_everything_every_way():
    assert "tags" in BENCHES
    trial = run_trial(np.random.default_rng(7))
    assert {(each.way, each.kind) for each in trial.readings} == {(way, kind) for way in WAYS for kind in KINDS}
    assert trial.pictures == 6
    by_way = {way: [r for r in trial.readings if r.way == way and r.kind == "table"] for way in WAYS}
    assert np.linalg.norm(by_way["pictures alone"][0].error[:3]) < 0.003
    assert furnished(np.random.default_rng(7)) == furnished(np.random.default_rng(7))


def test_rows_count_what_was_missed_and_misread():
    def reading(way: str, kind: str, x: float) -> Reading:
        return Reading(way, kind, np.array([x, 0.0, 0.0, 0.001]), 0.0)

    good = [reading(way, kind, 0.001) for way in WAYS for kind in KINDS]
    missed = [Reading("rendered", "table", np.full(4, np.nan), np.nan), *good[1:]]
    wrong = [reading("rendered", "gripper", 0.5), *good]
    trials = [Trial(good, 0.1, 0.1, 6), Trial(missed, 0.1, 0.1, 6), Trial(wrong, 0.1, 0.1, 6)]
    rows = {row.what: row for row in rows_of(trials)}
    assert rows["readings more than 10 cm off"].value == 1.0
    assert rows["tables whose tag was read, share"].value == pytest.approx(2 / 3)
    assert rows["a table's place from rendered tags, error in x, y, z together, 95 %"].value == pytest.approx(0.001)
    assert summary(trials)["table, rendered"]["xy_mm_rms"] == pytest.approx(1.0)
    picture = CameraPicture(0.0, 0, np.zeros((48, 64), np.uint8), np.eye(3), np.zeros(5), np.zeros(3), np.zeros(4))
    assert figure(trials, picture, {"table": [np.eye(4)[:, :2]]}).axes
