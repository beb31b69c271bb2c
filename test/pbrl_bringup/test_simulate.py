"""A push in one process: what a graph records, byte for byte the same for the same seed, and learnable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bullet_sim.scene import load_scene
from krang_sim.session import KrangSession
from pbrl_bag import cut_episodes, describe, read_recording
from pbrl_bringup.errors import BringupError
from pbrl_bringup.simulate import SimulatedPush, fallen_body, simulate_push
from pbrl_control.push_plan import PushPlan, Segment, load_plan


def short_plan() -> PushPlan:
    """The demo's plan, cut short."""
    return load_plan("turn_table").model_copy(update={"segments": (Segment(twist=(0.2, 0.0, 0.0), duration=1.2),)})


def simulate(folder: Path, seed: int = 3) -> SimulatedPush:
    return simulate_push(load_scene("locked_caster"), short_plan(), seed, folder / "bag")


@pytest.fixture(scope="module")
def push(tmp_path_factory: pytest.TempPathFactory) -> SimulatedPush:
    return simulate(tmp_path_factory.mktemp("simulated"))


def test_the_push_is_done_and_recorded_whole(push: SimulatedPush) -> None:
    info = describe(push.bag)
    assert (push.phase, push.messages) == ("done", info.message_count)
    assert info.finished
    (episode,) = cut_episodes(read_recording(push.bag))
    moved = episode.poses.position[-1, :2] - episode.poses.position[0, :2]
    assert episode.grippers == ("left",)
    assert np.hypot(*moved) > 0.05


def test_the_same_seed_makes_the_same_bytes(push: SimulatedPush, tmp_path: Path) -> None:
    again = simulate(tmp_path)
    for file in sorted(push.bag.iterdir()):
        assert file.read_bytes() == (again.bag / file.name).read_bytes()


def test_topics_are_a_running_graph_s(push: SimulatedPush) -> None:
    assert {topic.name: topic.type for topic in describe(push.bag).topics} == {
        "/clock": "rosgraph_msgs/msg/Clock",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/odom": "nav_msgs/msg/Odometry",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
        "/robot_description": "std_msgs/msg/String",
        "/scene": "pbrl_msgs/msg/Scene",
        "/grasps": "pbrl_msgs/msg/Grasps",
        "/wrist_ft/left": "geometry_msgs/msg/WrenchStamped",
        "/wrist_ft/right": "geometry_msgs/msg/WrenchStamped",
        "/ar_tags/table_a/pose": "geometry_msgs/msg/PoseStamped",
        "/ar_tags/left_gripper/pose": "geometry_msgs/msg/PoseStamped",
        "/ar_tags/right_gripper/pose": "geometry_msgs/msg/PoseStamped",
        "/markers": "visualization_msgs/msg/MarkerArray",
        "/cmd_vel": "geometry_msgs/msg/Twist",
        "/left_arm_velocity_controller/commands": "std_msgs/msg/Float64MultiArray",
        "/right_arm_velocity_controller/commands": "std_msgs/msg/Float64MultiArray",
        "/object_twist_command": "geometry_msgs/msg/TwistStamped",
        "/push/status": "std_msgs/msg/String",
    }


def test_nothing_is_left_of_a_simulation_that_is_stopped(tmp_path: Path) -> None:
    def stop(time: float, phase: str) -> None:
        if time > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_push(load_scene("locked_caster"), short_plan(), 0, tmp_path / "bag", advance=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("tilt", "fallen"), [(0.0, False), (0.2, False), (0.6, True), (np.pi, True)])
def test_a_body_that_tipped_over_is_said(tilt: float, fallen: bool) -> None:
    with KrangSession(load_scene("free_table"), seed=0) as session:
        client = session.world.client
        lean = [0.0, np.sin(tilt / 2), 0.0, np.cos(tilt / 2)]
        client.api.resetBasePositionAndOrientation(client.body("table_a"), [2.0, 0.0, 0.8], lean)
        sentence = fallen_body(session)
    assert ("table_a tipped over" in sentence) == fallen
    assert (f"{np.degrees(tilt):.0f} degrees" in sentence) == fallen


def test_an_existing_recording_is_kept(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag/precious").touch()
    with pytest.raises(BringupError, match="exists"):
        simulate(tmp_path)
    assert (tmp_path / "bag/precious").exists()
