"""The node as a user starts it: found through the ament index, in a ROS domain of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
import yaml
from ament_index_python.packages import get_package_prefix
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from pbrl_msgs.msg import Grasps, Scene
from pbrl_msgs.srv import ReleaseObject
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState, LaserScan
from std_msgs.msg import Float64MultiArray

from pr2_cart_sim.floor_plan import OfficePlan
from pr2_cart_sim.make_office import write_office

PATIENCE = 60.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def command(*parameters: str) -> list[str]:
    executable = Path(get_package_prefix("pr2_cart_sim")) / "lib" / "pr2_cart_sim" / "sim_node"
    return [str(executable), "--ros-args", *(word for each in parameters for word in ("-p", each))]


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    write_office(path, OfficePlan(rooms=2, people=1, furniture=(0, 0), movable=0), 1)
    scene = yaml.safe_load(path.read_text())
    scene["sensors"] = {"base_laser": {"increment": 0.05}, "tilt_laser": {"increment": 0.05}}
    path.write_text(yaml.safe_dump(scene))
    return path


@pytest.fixture
def environment(domain: int) -> dict[str, str]:
    return os.environ | {"ROS_DOMAIN_ID": str(domain)}


@pytest.fixture
def listener(domain: int) -> Iterator[Node]:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("listener", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    yield node
    executor.shutdown()
    thread.join()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


@pytest.fixture
def node(scene_file: Path, environment: dict[str, str]) -> Iterator[subprocess.Popen]:
    process = subprocess.Popen(
        command(f"scene:={scene_file}", "rate:=0.0"), env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    yield process
    process.terminate()  # killed, it would leave shared memory behind that disturbs the next of its domain
    try:
        process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()


def wait_for(node: Node, kind: type, topic: str, want: Callable = lambda message: True, qos: object = 10):
    """Give the first message that `want` accepts."""
    found, arrived = [], threading.Event()

    def hear(message) -> None:
        if not arrived.is_set() and want(message):
            found.append(message)
            arrived.set()

    subscription = node.create_subscription(kind, topic, hear, qos)
    assert arrived.wait(PATIENCE), f"nothing on {topic}"
    node.destroy_subscription(subscription)
    return found[0]


def test_a_robot_of_standard_topics(node, listener, ask):
    grid = wait_for(listener, OccupancyGrid, "/map", qos=LATCHED)
    assert len(grid.data) == grid.info.width * grid.info.height
    assert [body.name for body in wait_for(listener, Scene, "/scene", qos=LATCHED).bodies] == ["cart"]
    assert len(wait_for(listener, Grasps, "/grasps", qos=LATCHED).grasps) == 2
    names = wait_for(listener, JointState, "/joint_states").name
    assert len(names) == 18
    for topic, frame in (("/scan", "base_laser_link"), ("/tilt_scan", "laser_tilt_link")):
        scan = wait_for(listener, LaserScan, topic)
        assert scan.header.frame_id == frame
        assert len(scan.ranges) == 1 + round((scan.angle_max - scan.angle_min) / scan.angle_increment)
    assert wait_for(listener, PoseStamped, "/cart_pose/hands").pose.position.x == pytest.approx(1.134, abs=0.02)
    drive, arm = Twist(), Float64MultiArray(data=[0.1] + 6 * [0.0])
    drive.linear.y = -0.1
    base = listener.create_publisher(Twist, "/cmd_vel", 1)
    left = listener.create_publisher(Float64MultiArray, "/left_arm_velocity_controller/commands", 1)
    wrong = listener.create_publisher(Float64MultiArray, "/torso_velocity_controller/commands", 1)
    left_alone = ask(listener.create_client(ReleaseObject, "/release"), ReleaseObject.Request(gripper="left"))
    assert left_alone.success or "holds nothing" in left_alone.message  # where the first answer was lost
    wait_for(listener, Grasps, "/grasps", lambda message: len(message.grasps) == 1, LATCHED)
    bad = Float64MultiArray(data=[0.1, 0.2])
    repeat = listener.create_timer(0.005, lambda: (base.publish(drive), left.publish(arm), wrong.publish(bad)))
    wait_for(listener, Odometry, "/odom", lambda message: message.twist.twist.linear.y < -0.07)
    pan = names.index("l_shoulder_pan_joint")
    wait_for(listener, JointState, "/joint_states", lambda message: message.velocity[pan] > 0.09)
    listener.destroy_timer(repeat)
    wait_for(listener, JointState, "/joint_states", lambda message: abs(message.velocity[pan]) < 1e-3)
    assert node.poll() is None
    node.send_signal(signal.SIGINT)
    out, err = node.communicate(timeout=PATIENCE)
    assert node.returncode == 0
    assert b"Traceback" not in out + err


def test_errors_at_start_are_one_line_and_exit_2(environment):
    done = subprocess.run(command("scene:=nonsense"), env=environment, capture_output=True, timeout=PATIENCE, text=True)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("sim_node: office 'nonsense'")
