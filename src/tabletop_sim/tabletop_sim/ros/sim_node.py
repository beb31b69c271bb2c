"""The tabletop's simulator as a node: its own clock, joints, pictures of the table, and an arm that obeys.

Its pace is that of `bullet_sim.ros.paced`. The arm follows angles on `/ball_arm_position_controller/commands` (4
values: turn, shoulder, elbow, wrist), as ros2_control's forward controllers do.
"""

from __future__ import annotations

import threading
from typing import get_args

from std_msgs.msg import Float64MultiArray

from bullet_sim.ros.paced import PacedSimulator
from bullet_sim.ros.parameters import declare, refuse_unknown
from bullet_sim.ros.running import run_node
from tabletop_sim.messages import LATCHED, message_types
from tabletop_sim.scene import DeskScene, Vision, load_desk
from tabletop_sim.session import DeskSession

COMMANDS = "ball_arm_position_controller/commands"


class SimNode(PacedSimulator):
    """Steps a `DeskSession`, publishes what it gives, obeys the arm's topic.

    Args:
        stop: when it is set, `run` returns at its next step.

    Raises:
        SimError: a wrong parameter, or a scene that cannot be built.
    """

    def __init__(self, stop: threading.Event) -> None:
        super().__init__("sim_node", stop)
        scene, seed, gui = self._declare()
        self.session = DeskSession(scene, seed=seed, gui=gui)
        self.start(self.session, message_types(scene), scene.faults, seed, LATCHED)
        self.listen(Float64MultiArray, COMMANDS, lambda message: self.session.command_joints(message.data))

    def _declare(self) -> tuple[DeskScene, int, bool]:
        """Declare every parameter; return scene, seed and gui."""
        name = declare(self, "scene", "desk", "scene file, or the name of a desk of the workspace")
        text = (
            "rendered: pictures on /camera/overhead_0; noise: poses on /ar_tags/<item>/pose; empty: as the scene says"
        )
        vision = declare(self, "vision", "", text, choices=(*get_args(Vision), ""))
        seed = declare(self, "seed", 0, "seed of every random draw", (0, 2**31 - 1))
        gui = declare(self, "gui", False, "open Bullet's window")
        self.declare_pace()
        refuse_unknown(self)
        scene = load_desk(name)
        if vision:
            scene = scene.model_copy(update={"vision": scene.vision.model_copy(update={"source": vision})})
        return scene, seed, gui


def main() -> None:
    """Run the node; errors at start are one line and exit code 2."""
    run_node("sim_node", SimNode)


if __name__ == "__main__":
    main()
