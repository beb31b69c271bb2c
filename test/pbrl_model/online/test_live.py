"""A recording that grows: what is forgotten is not needed, and another clock begins anew."""

from __future__ import annotations

import numpy as np
import pytest
from geometry_msgs.msg import Point, PoseStamped, WrenchStamped
from pbrl_msgs.msg import Body, Grasp, Grasps, Scene

from pbrl_bag.builder import RecordingBuilder
from pbrl_bag.errors import BagError
from pbrl_model.online.live import LiveRecording

TAG, WRIST, HAND = "/ar_tags/table/pose", "/wrist_ft/left", "/ar_tags/left_gripper/pose"


def at(message, seconds: float, frame: str = "world"):
    message.header.stamp.sec, message.header.stamp.nanosec = int(seconds), round((seconds % 1) * 1e9)
    message.header.frame_id = frame
    return message


def scene() -> Scene:
    outline = [Point(x=x, y=y) for x, y in ((-0.5, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.5, 0.3))]
    return Scene(bodies=[Body(name="table", footprint=outline, height=0.7, nominal_mass=20.0, movable=True)])


def held(seconds: float, *names: str) -> Grasps:
    return at(Grasps(grasps=[Grasp(gripper="left", object=name) for name in names]), seconds)


def pose(seconds: float) -> PoseStamped:
    message = at(PoseStamped(), seconds)
    message.pose.position.x, message.pose.orientation.w = 0.01 * seconds, 1.0
    return message


def stream(start: float, stop: float):
    for time in np.arange(start, stop, 0.1).tolist():
        yield TAG, pose(time)
        yield HAND, pose(time)
        yield WRIST, at(WrenchStamped(), time, "left_ft")


def session(start: float):
    """Yield ten seconds of messages: grasped after three, let go after eight."""
    yield "/scene", at(scene(), start)
    yield "/grasps", held(start)
    yield from stream(start, start + 3.0)
    yield "/grasps", held(start + 3.0, "table")
    yield from stream(start + 3.0, start + 8.0)
    yield "/grasps", held(start + 8.0)
    yield from stream(start + 8.0, start + 10.0)


def test_it_is_the_recording_of_the_same_messages() -> None:
    live, builder = LiveRecording(), RecordingBuilder()
    for topic, message in session(100.0):
        live.add(topic, message)
        builder.add(topic, message)
    found, expected = live.recording(), builder.build("what is heard")
    (one,), (other,) = found.grasps, expected.grasps
    assert (one.start, one.end, one.object) == (other.start, other.end, other.object) and live.held
    assert live.now == pytest.approx(109.9)
    for name in ("object_poses", "gripper_poses", "wrenches"):
        for one, other in zip(getattr(found, name).values(), getattr(expected, name).values(), strict=True):
            np.testing.assert_array_equal(one.time, other.time)


def test_what_lies_round_a_grasp_is_not_forgotten_before_its_end_is() -> None:
    live = LiveRecording()
    for topic, message in session(100.0):
        if message.header.stamp.sec >= 107:
            break
        live.add(topic, message)
    live.forget(105.0)
    time = live.recording().wrenches["left"].time
    assert np.all((time >= 105.0 - 1e-9) | ((time >= 100.5 - 1e-9) & (time <= 103.5 + 1e-9)))
    assert np.sum(time < 104.0) == 31 and np.sum(time > 104.9) == 21
    live.add("/grasps", held(107.0))
    for topic, message in stream(107.0, 110.0):
        live.add(topic, message)
    live.forget(106.0)  # the last second of the hold is still to be learned from
    time = live.recording().wrenches["left"].time
    assert np.sum(time < 104.0) == 31 and time[31] == pytest.approx(106.0)
    live.forget(107.0)
    assert live.recording().wrenches["left"].time[0] == pytest.approx(107.0)


def test_what_was_let_go_of_long_ago_and_is_out_of_sight_is_not_missed() -> None:
    live = LiveRecording()
    for topic, message in session(100.0):
        live.add(topic, message)
    live.add("/grasps", held(113.0, "chair"))
    for topic, message in stream(110.0, 125.0):
        live.add(topic.replace("table", "chair"), message)
    live.forget(107.0)
    with pytest.raises(BagError, match="which has no geometry"):
        live.recording()  # the chair is held, and nobody said what it looks like
    both = scene()
    both.bodies.append(Body(name="chair", footprint=both.bodies[0].footprint, height=0.7, nominal_mass=5.0))
    live.add("/scene", both)
    assert set(live.recording().object_poses) == {"table", "chair"}
    live.forget(115.0)
    recording = live.recording()
    assert set(recording.object_poses) == {"chair"}
    # When the gripper was free is still known: its wrist is read between two holds.
    assert [(grasp.object, grasp.start) for grasp in recording.grasps] == [("table", 103.0), ("chair", 113.0)]


def test_time_that_goes_back_begins_anew() -> None:
    live = LiveRecording()
    for start in (100.0, 20.0):
        for topic, message in session(start):
            live.add(topic, message)
    assert live.clocks == 1
    recording = live.recording()
    assert recording.wrenches["left"].time[0] == pytest.approx(20.0)
    assert [(grasp.start, grasp.end) for grasp in recording.grasps] == [(23.0, 28.0)]


def test_a_straggler_is_left_out_and_a_repetition_changes_nothing() -> None:
    live = LiveRecording()
    for topic, message in session(100.0):
        live.add(topic, message)
    for message in (pose(109.5), pose(109.9)):
        live.add(TAG, message)
    live.add("/grasps", held(109.0))
    live.add("/somewhere", pose(1.0))
    assert (live.left_out, live.clocks) == (2, 0)
    assert len(live.recording().object_poses["table"].time) == 100


def test_a_wrong_message_is_an_error_that_names_its_topic() -> None:
    live = LiveRecording()
    assert not live.held and live.now == float("-inf")
    with pytest.raises(BagError, match=TAG):
        live.add(TAG, at(WrenchStamped(), 1.0))
    with pytest.raises(BagError, match="got no message"):
        live.recording()
