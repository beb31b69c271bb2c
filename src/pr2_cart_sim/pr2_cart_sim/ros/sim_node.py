"""The PR2's simulator as a node: its own clock, all topics of the robot, commands, grasp and release.

Its pace is that of `bullet_sim.ros.paced`. Commands: `/cmd_vel` (forward, left, turning), the arms' velocity
controllers, `/torso_velocity_controller/commands` (1 value) and `/head_velocity_controller/commands` (pan, tilt).
"""

from __future__ import annotations

import threading
from typing import get_args

from geometry_msgs.msg import Twist
from std_msgs.msg import Float64MultiArray

from bullet_sim.ros.commands import base_twist
from bullet_sim.ros.paced import PacedSimulator
from bullet_sim.ros.parameters import declare, refuse_unknown
from bullet_sim.ros.running import run_node
from pr2_cart_sim.errors import Pr2Error
from pr2_cart_sim.messages import LATCHED, MESSAGE_TYPES
from pr2_cart_sim.scene import OfficeScene, load_office, with_board
from pr2_cart_sim.sensor_settings import BoardSource
from pr2_cart_sim.session import Pr2Session


class SimNode(PacedSimulator):
    """Steps a `Pr2Session`, publishes what it gives, obeys the command topics.

    Args:
        stop: when it is set, `run` returns at its next step.

    Raises:
        SimError: a wrong parameter, or a scene that cannot be built.
    """

    def __init__(self, stop: threading.Event) -> None:
        super().__init__("sim_node", stop)
        scene, seed, gui = self._declare()
        self.session = Pr2Session(scene, seed=seed, gui=gui)
        self.start(self.session, MESSAGE_TYPES, scene.faults, seed, LATCHED)
        self.obey_arms(self.session)
        self.listen(Twist, "cmd_vel", self._command_base)
        self.listen(Float64MultiArray, "torso_velocity_controller/commands", self._command_torso)
        self.listen(Float64MultiArray, "head_velocity_controller/commands", self._command_head)

    def _declare(self) -> tuple[OfficeScene, int, bool]:
        """Declare every parameter; return scene, seed and gui."""
        scene = declare(self, "scene", "office", "scene file, or the name of an office of the workspace")
        text = "how the cart's checkerboard is seen; empty: as the scene says"
        board = declare(self, "checkerboard", "", text, choices=(*get_args(BoardSource), ""))
        seed = declare(self, "seed", 0, "seed of every random draw", (0, 2**31 - 1))
        gui = declare(self, "gui", False, "open Bullet's window")
        self.declare_pace()
        refuse_unknown(self)
        loaded = load_office(scene)
        return with_board(loaded, board) if board else loaded, seed, gui

    def _command_base(self, message: Twist) -> None:
        self.session.command_base(*base_twist(message))
        if self.session.halted:
            self.get_logger().warning(self.session.halted, throttle_duration_sec=1.0)

    def _command_torso(self, message: Float64MultiArray) -> None:
        if len(message.data) != 1:
            raise Pr2Error(f"torso command: expected 1 value, got {len(message.data)}")
        self.session.command_torso(message.data[0])

    def _command_head(self, message: Float64MultiArray) -> None:
        if len(message.data) != 2:
            raise Pr2Error(f"head command: expected 2 values, pan and tilt, got {len(message.data)}")
        self.session.command_head(*message.data)


def main() -> None:
    """Run the node; errors at start are one line and exit code 2."""
    run_node("sim_node", SimNode)


if __name__ == "__main__":
    main()
