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
from geometry_msgs.msg import Twist
from pbrl_msgs.msg import Grasps, Scene
from pbrl_msgs.srv import GraspObject, ReleaseObject
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

PATIENCE = 60.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def command(*parameters: str) -> list[str]:
    executable = Path(get_package_prefix("krang_sim")) / "lib" / "krang_sim" / "sim_node"
    return [str(executable), "--ros-args", *(word for each in parameters for word in ("-p", each))]


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    table = {"kind": "office_table", "size": [0.75, 1.5], "height": 0.7775, "nominal_mass": 33.0}
    scene = {
        "room": {"outline": [[-3.0, -3.0], [5.0, -3.0], [5.0, 3.0], [-3.0, 3.0]]},
        "bodies": {"desk": table | {"pose": [1.19, -0.25, 0.0]}},
    }
    path = tmp_path / "desk.yaml"
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
def start(scene_file: Path, environment: dict[str, str]) -> Iterator[Callable[..., subprocess.Popen]]:
    running: list[subprocess.Popen] = []

    def launch(*parameters: str) -> subprocess.Popen:
        process = subprocess.Popen(
            command(f"scene:={scene_file}", *parameters),
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        running.append(process)
        return process

    yield launch
    for process in running:
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


def test_grasp_service_refuses_with_the_distance(start, listener, ask):
    start()
    grasp, release = listener.create_client(GraspObject, "/grasp"), listener.create_client(ReleaseObject, "/release")
    answer = ask(grasp, GraspObject.Request(gripper="left", object="desk"))
    assert not answer.success
    assert answer.distance == pytest.approx(0.195, abs=0.01)
    assert f"{answer.distance:.3f} m" in answer.message
    answer = ask(release, ReleaseObject.Request(gripper="left"))
    assert not answer.success
    assert "holds nothing" in answer.message


def test_commands_move_the_robot_and_late_listeners_get_the_scene(start, listener):
    start("rate:=1.0")  # at its fastest, a busy machine sends the next command after its watchdog's 0.1 s are over
    names = wait_for(listener, JointState, "/joint_states").name
    assert len(names) == 18
    drive, arm = Twist(), Float64MultiArray(data=[0.1] + 6 * [0.0])
    drive.linear.x = 0.15
    base = listener.create_publisher(Twist, "/cmd_vel", 1)
    left = listener.create_publisher(Float64MultiArray, "/left_arm_velocity_controller/commands", 1)
    repeat = listener.create_timer(0.005, lambda: (base.publish(drive), left.publish(arm)))

    def moves(joint: str, speed: float) -> Callable:
        return lambda message: message.velocity[names.index(joint)] > 0.9 * speed

    wait_for(listener, JointState, "/joint_states", moves("lwheel", 0.15 / 0.267))
    wait_for(listener, JointState, "/joint_states", moves("LJ1", 0.1))
    listener.destroy_timer(repeat)
    wait_for(listener, JointState, "/joint_states", lambda message: max(map(abs, message.velocity)) < 1e-3)
    scene = wait_for(listener, Scene, "/scene", qos=LATCHED)
    assert [body.name for body in scene.bodies] == ["desk"]
    assert wait_for(listener, Grasps, "/grasps", qos=LATCHED).grasps == []


def test_a_bad_command_is_warned_about_and_survived(start, listener):
    process = start("rate:=0.0")
    wait_for(listener, Clock, "/clock")
    wrong = Float64MultiArray(data=[0.1, 0.2, 0.3])
    topics = ("/left_arm_velocity_controller/commands", "/body_velocity_controller/commands")
    outlets = [listener.create_publisher(Float64MultiArray, topic, 1) for topic in topics]
    listener.create_timer(0.01, lambda: [outlet.publish(wrong) for outlet in outlets])
    wait_for(listener, Clock, "/clock", lambda message: message.clock.sec >= 2)
    assert process.poll() is None


def test_arguments_that_ros_cannot_read_are_no_traceback(environment):
    done = subprocess.run(command("rate"), env=environment, capture_output=True, timeout=PATIENCE, text=True)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stderr.splitlines()[-1].startswith("sim_node: ")


@pytest.mark.parametrize("duration", ["0.5", "1"])
def test_runs_for_its_duration_and_ends_quietly(start, duration):
    process = start("rate:=0", f"duration:={duration}")
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out, err) == (0, b"", b"")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_quietly(start, listener, number):
    process = start("rate:=0.0")
    wait_for(listener, Clock, "/clock")
    process.send_signal(number)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert b"Traceback" not in out + err


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ("scene:=nonsense", "scene 'nonsense'"),
        ("sceen:=desk", "did you mean 'scene'?"),
        ("rate:=-1.0", "rate: expected 0 to 1000"),
        ("rate:=.nan", "rate: expected 0 to 1000"),
        ("rate:=fast", "rate: expected float"),
        ("seed:=-4", "seed: expected 0 to 2147483647"),
        ("gui:=1", "gui: expected bool"),
    ],
)
def test_errors_at_start_are_one_line_and_exit_2(parameter, words, environment):
    done = subprocess.run(command(parameter), env=environment, capture_output=True, timeout=PATIENCE, text=True)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("sim_node: ")
    assert words in done.stderr
