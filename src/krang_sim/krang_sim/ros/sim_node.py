"""Krang's simulator as a node: its own clock, all topics of the robot, commands, grasp and release.

Its pace is that of `bullet_sim.ros.paced`. Runs that must be bit for bit the same do without nodes:
`./pbrl simulate` steps the same session in one process.
"""

from __future__ import annotations

import threading
from pathlib import Path
from typing import get_args

from geometry_msgs.msg import Twist
from std_msgs.msg import Float64MultiArray

from bullet_sim.ros.commands import base_twist
from bullet_sim.ros.paced import PacedSimulator
from bullet_sim.ros.parameters import declare, refuse_unknown
from bullet_sim.ros.running import run_node
from bullet_sim.scene import Scene, TagSource, load_scene, with_model, with_tags
from krang_sim.errors import KrangError
from krang_sim.messages import message_types
from krang_sim.session import KrangSession


class SimNode(PacedSimulator):
    """Steps a `KrangSession`, publishes what it gives, obeys the command topics.

    Args:
        stop: when it is set, `run` returns at its next step.

    Raises:
        SimError: a wrong parameter, or a scene that cannot be built.
    """

    def __init__(self, stop: threading.Event) -> None:
        super().__init__("sim_node", stop)
        scene, seed, gui = self._declare()
        self.session = KrangSession(scene, seed=seed, gui=gui)
        self.start(self.session, message_types(self.session.tagged, self.session.cameras), scene.faults, seed)
        self.obey_arms(self.session)
        self.listen(Twist, "cmd_vel", self._command_base)
        self.listen(Float64MultiArray, "body_velocity_controller/commands", self._command_body)

    def _declare(self) -> tuple[Scene, int, bool]:
        """Declare every parameter; return scene, seed and gui."""
        scene = declare(self, "scene", "locked_caster", "scene file, or the name of a scene of the workspace")
        model = declare(self, "model", "", "file of a learned model: the body of its name behaves so; empty: none")
        text = "rendered: pictures on /camera/overhead_<i> for tag_detector_node; empty: as the scene says"
        tags = declare(self, "tags", "", text, choices=(*get_args(TagSource), ""))
        seed = declare(self, "seed", 0, "seed of every random draw", (0, 2**31 - 1))
        gui = declare(self, "gui", False, "open Bullet's window")
        self.declare_pace()
        refuse_unknown(self)
        loaded = with_model(load_scene(scene), Path(model)) if model else load_scene(scene)
        return with_tags(loaded, tags) if tags else loaded, seed, gui

    def _command_base(self, message: Twist) -> None:
        forward, _, turning = base_twist(message)
        self.session.command_base(forward, turning)
        if self.session.halted:
            self.get_logger().warning(self.session.halted, throttle_duration_sec=1.0)

    def _command_body(self, message: Float64MultiArray) -> None:
        if len(message.data) != 2:
            raise KrangError(f"body command: expected 2 values, waist and torso, got {len(message.data)}")
        self.session.command_body(*message.data)


def main() -> None:
    """Run the node; errors at start are one line and exit code 2."""
    run_node("sim_node", SimNode)


if __name__ == "__main__":
    main()
