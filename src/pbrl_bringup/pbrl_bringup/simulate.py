"""A push without middleware: simulator, controller and recorder in one process, as fast as the machine goes.

The observations become the same messages on the same topics as from `sim_node`, and the controller is
ticked as in its node: with each joint state. What is left out is the transport, so the same scene,
plan and seed make the same bag, byte for byte.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from std_msgs.msg import String

from bullet_sim.scene import Scene
from krang_sim.messages import stamp, to_messages
from krang_sim.observations import Observation
from krang_sim.session import KrangSession
from pbrl_bag.writer import BagWriter
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import new_folder_place, removed_afterwards
from pbrl_bringup.manipulation import Manipulation
from pbrl_bringup.paths import config_file
from pbrl_bringup.rendered_tags import reader_of
from pbrl_control.kinematics import SIDES
from pbrl_control.loop import LoopCommand
from pbrl_control.push import Phase, PushCommand
from pbrl_control.push_plan import PushPlan
from pbrl_control.ros.conversions import arm_to_msg, base_to_msg, twist_to_msg
from pbrl_control.settings import ControllerSettings, load_section

AFTERWARDS = 0.5  # [s] recorded after the end, so that tags that are under way arrive
LONGEST = 180.0  # [s] of simulated time; a push that takes longer hangs
FALLEN = math.radians(20.0)  # a body that ends further off level than this is not what a planar model is about


@dataclass(frozen=True)
class SimulatedPush:
    """What came of it.

    Attributes:
        bag: the folder of the recording.
        phase: "done" or "failed".
        status: a sentence; of a failed push, why.
        seconds: simulated time [s].
        messages: how many were recorded.
    """

    bag: Path
    phase: str
    status: str
    seconds: float
    messages: int


def simulate_push(
    scene: Scene,
    plan: PushPlan,
    seed: int,
    bag: Path,
    *,
    gui: bool = False,
    advance: Callable[[float, str], None] | None = None,
) -> SimulatedPush:
    """Perform a push plan in a scene and record it.

    Args:
        scene: with its concealed part, which reaches the simulator only.
        plan: the push.
        seed: of world and sensors.
        bag: folder of the recording, made at the end; it must not exist.
        gui: open Bullet's window.
        advance: called now and then with the simulated time [s] and the phase.

    Raises:
        BringupError: `bag` exists or cannot be made, the plan's object is not in the scene, or the push did not end.
        SimError: the scene cannot be built.
        ControlError: the plan does not fit the robot.
    """
    _check_fit(scene, plan)
    new_folder_place(bag)
    unfinished = bag.with_name(f".{bag.name}.part")
    settings = load_section(config_file("params", "body_controller"), ControllerSettings, "settings")
    reader = reader_of(scene)
    with KrangSession(scene, seed=seed, gui=gui, read_tags=reader) as session, removed_afterwards(unfinished):
        # The name inside the bag is the folder's, so the folder is made under its own name elsewhere.
        with BagWriter(unfinished / bag.name, live=False) as writer:
            end = _run(_Run(session, plan, settings, writer), advance or (lambda time, phase: None))
        fallen = fallen_body(session)
        (unfinished / bag.name).replace(bag)
        phase, status = (Phase.FAILED, fallen) if fallen else (end.phase, end.status)
        return SimulatedPush(bag, str(phase), status, session.time, writer.message_count)


def fallen_body(session: KrangSession) -> str:
    """Say which body tipped over, or return nothing: its recording is no push of a body that stays on the floor."""
    for name in session.world.furniture:
        off = math.acos(max(-1.0, min(1.0, float(session.world.pose(name).matrix[2, 2]))))
        if off > FALLEN:
            return (
                f"{name} tipped over, it ends {math.degrees(off):.0f} degrees off level; push it more gently or lower"
            )
    return ""


def _check_fit(scene: Scene, plan: PushPlan) -> None:
    """Raise BringupError where a plan is about something else than what stands in the scene."""
    if plan.object not in scene.bodies:
        near = difflib.get_close_matches(plan.object, scene.bodies, 1)
        advice = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(scene.bodies) or 'none'}"
        raise BringupError(f"push {plan.name}: scene {scene.name} has no object {plan.object!r}; {advice}")
    if plan.push_time > LONGEST:
        raise BringupError(f"push {plan.name}: expected at most {LONGEST:.0f} s of segments, got {plan.push_time:g} s")


def _run(run: _Run, advance: Callable[[float, str], None]) -> PushCommand:
    """Step until the push has ended and the last tags have arrived."""
    stop: float | None = None
    while stop is None or run.session.time < stop:
        run.step()
        if run.session.time > LONGEST:
            raise BringupError(
                f"{run.plan.name}: expected the push to end within {LONGEST:.0f} s, it is in {run.phase}"
            )
        if stop is None and run.last is not None and run.last.finished:
            stop = run.session.time + AFTERWARDS
        advance(run.session.time, run.phase)
    assert run.last is not None
    return run.last


def status_text(command: PushCommand) -> str:
    """Return what `/push/status` says at this moment."""
    return f"failed: {command.status}" if command.phase == Phase.FAILED else str(command.phase)


def type_name(message: Any) -> str:
    """Return the name of a message's type, e.g. "geometry_msgs/msg/PoseStamped"."""
    package = type(message).__module__.partition(".")[0]
    return f"{package}/msg/{type(message).__name__}"


class _Run(Manipulation):
    """One session, its controller and its recording."""

    def __init__(self, session: KrangSession, plan: PushPlan, settings: ControllerSettings, writer: BagWriter) -> None:
        super().__init__(session, plan, settings)
        self._writer = writer

    def noted(self, observation: Observation) -> None:
        """Record what is observed."""
        for topic, message in to_messages(observation):
            self.record(topic, message)

    def commanded(self, command: LoopCommand) -> None:
        """Record a command as the nodes publish it."""
        if self.last is None or command.push.phase != self.last.phase:
            self.record("/push/status", String(data=status_text(command.push)))
        for target, twist in command.push.twists.items():
            self.record("/object_twist_command", twist_to_msg(target, twist, stamp(self.session.time)))
        self.record("/cmd_vel", base_to_msg(command.body.base_v, command.body.base_w))
        for side in SIDES:
            self.record(f"/{side}_arm_velocity_controller/commands", arm_to_msg(command.body.arm(side)))

    def record(self, topic: str, message: Any) -> None:
        """Write one message at the present time."""
        self._writer.write(topic, type_name(message), message, round(self.session.time * 1e9))
