"""One run of the PR2 in an office: commands in, physics, observations out. No ROS, no threads, no wall clock.

Same scene, same seed and same commands at the same steps: same observations, bit for bit.

Safety: what nobody repeats stops. A command holds for `TIMEOUT`; then the wheels are held, and the robot is at rest
within 0.3 s of the last command, whatever its speed was.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.clamp import GripperSpec
from bullet_sim.client import BulletClient
from bullet_sim.commands import CommandWatchdog
from bullet_sim.errors import SimError
from bullet_sim.fence import Fence, Watch
from bullet_sim.grippers import GraspOutcome, Grippers, no_such_side
from bullet_sim.observations import GraspState
from bullet_sim.world import BodyTruth
from pr2_cart_sim.description import ARM_JOINTS, NAME, SIDES
from pr2_cart_sim.errors import Pr2Error
from pr2_cart_sim.lasers import Nod
from pr2_cart_sim.observations import Observation
from pr2_cart_sim.people import Walker
from pr2_cart_sim.proximity import Clearance, Contact
from pr2_cart_sim.scene import OfficeScene
from pr2_cart_sim.sensing import TILT_JOINT, Sensing
from pr2_cart_sim.world import Office

Array = NDArray[np.float64]

STEP = 1 / 200
"""Physics step [s]: where halving it moves robot and cart by less than a millimetre in four seconds of turning."""

TIMEOUT = 0.1
"""Age [s] at which a command no longer counts: two of a controller's that runs at 20 Hz."""

CART_STOPS = 0.45
"""[s] for which the cart goes on at its speed, as far as it then comes when the base brakes: arms give to 25 kg, most
where it is swung round."""

FINGERS = GripperSpec(
    plate_start=0.162,
    plate_end=0.198,
    plate_width=0.023,
    opening=0.090,
    force=80.0,
    friction=0.6,
    torque_limit=1.5,
)
"""Of each hand: fingertips 36 x 23 mm, 90 mm apart when open, 80 N when closed; they reach along the frame's y."""


class Pr2Session:
    """The PR2 in an office, one physics step at a time.

    Attributes:
        office: everything that there is.
        robot: in it.
        fence: about what may not be entered; None: there is nothing.
    """

    def __init__(self, scene: OfficeScene, *, seed: int, gui: bool = False, step: float = STEP) -> None:
        """Build the scene and put the robot into it.

        Args:
            scene: what to build, concealed part included.
            seed: of every random draw. World, people and senses draw from streams of their own.
            gui: open Bullet's window.
            step: physics step [s].

        Raises:
            SimError: a scene that cannot be built, a body where the robot stands, an unknown posture, a bad step, or
                nothing between the fingers where the scene says that they hold something.
        """
        world_seed, sense_seed = np.random.SeedSequence(seed).spawn(2)
        self._client = BulletClient(step=step, gui=gui)
        try:
            self._build(scene, np.random.default_rng(world_seed), np.random.default_rng(sense_seed))
        except BaseException:
            self._client.close()
            raise
        if self._client.window is not None:
            x, y, theta = scene.robot.pose
            self._client.window.look_at((x, y, 0.8), 6.0, theta, -0.7)

    def _build(self, scene: OfficeScene, world_rng: Generator, sense_rng: Generator) -> None:
        self.office = Office(self._client, scene, world_rng)
        self.robot = self.office.robot
        specs = dict.fromkeys(SIDES, FINGERS)
        links = {side: self.robot.links[f"{side}_ft"] for side in SIDES}
        self._grippers = Grippers(self.office.world, NAME, links, specs)
        self._sensing = Sensing(self.office, scene, specs, sense_rng)
        self._commands = CommandWatchdog(
            {"base": 3, "left": 7, "right": 7, "torso": 1, "head": 2}, timeout=TIMEOUT, refusal=Pr2Error
        )
        self._nod = Nod(scene.sensors.tilt_laser)
        furniture = self.office.world.furniture
        told = self.office.world.scene
        self.fence = Fence(self._client, self.robot, told, furniture, CART_STOPS) if scene.keep_out else None
        self._watch = Watch(self.fence)
        self._news: list[Observation] = self._sensing.latched()
        if scene.robot.holds is not None:
            for side in SIDES:
                outcome = self.grasp(side, scene.robot.holds)
                if not outcome.success:
                    raise SimError(f"robot.holds: expected {scene.robot.holds} between the fingers: {outcome.message}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._client.time

    def command_base(self, vx: float, vy: float, w: float) -> None:
        """Ask for a velocity forward and to the left [m/s] and a rate of turning left [rad/s]; holds for `TIMEOUT`.

        Raises:
            Pr2Error: a value that is not finite; as for the other commands, the one before stays in force.
        """
        self._commands.set("base", (vx, vy, w), self.time)

    def command_arm(self, side: str, velocity: Sequence[float]) -> None:
        """Ask for the velocities (7,) [rad/s] of an arm's joints, shoulder pan first; holds for `TIMEOUT`."""
        if side not in SIDES:
            raise Pr2Error(no_such_side(side))
        self._commands.set(side, velocity, self.time)

    def command_torso(self, velocity: float) -> None:
        """Ask for the velocity [m/s] of the torso's lift; holds for `TIMEOUT`."""
        self._commands.set("torso", (velocity,), self.time)

    def command_head(self, pan: float, tilt: float) -> None:
        """Ask for the velocities [rad/s] of the head; holds for `TIMEOUT`."""
        self._commands.set("head", (pan, tilt), self.time)

    def grasp(self, side: str, object_name: str = "") -> GraspOutcome:
        """Close the gripper `side` on `object_name`, or, without a name, on the edge between its fingers.

        Returns:
            Success, or a refusal with the distance to the nearest edge.
        """
        outcome = self._grippers.grasp(side, object_name)
        if outcome.success:
            held = {hold.gripper: hold.object for hold in self._grippers.holds()}
            self._sensing.note_grasp(side, held[side])
        return self._told(outcome)

    def release(self, side: str) -> GraspOutcome:
        """Open the gripper `side`."""
        return self._told(self._grippers.release(side))

    def _told(self, outcome: GraspOutcome) -> GraspOutcome:
        if outcome.success:
            self._tell_grasps()
        return outcome

    def _tell_grasps(self) -> None:
        self._news.append(GraspState(self.time, self._grippers.holds()))

    def step(self) -> list[Observation]:
        """Advance by one physics step.

        Returns:
            What is published now; with the first step also what is known from the start (description, scene, map,
            static frames, grasps), stamped zero.
        """
        now, robot, commands = self.time, self.robot, self._commands
        base = commands.current("base", now)
        allowed = self._watch.allowed(now, base, self.held)
        held_back = not (allowed.base and commands.fresh("base", now))
        robot.command_base(*(base if allowed.base else np.zeros(3)), brake=held_back)
        robot.command_joints("torso_lift_joint", commands.current("torso", now))
        robot.command_joints("head_pan_joint", commands.current("head", now))
        robot.command_joints("laser_tilt_mount_joint", [self._nod.rate(float(robot.joint_state()[0][TILT_JOINT]))])
        for side in SIDES:
            wanted = commands.current(side, now)
            robot.command_joints(ARM_JOINTS[side][0], wanted if allowed.joints else np.zeros(len(wanted)))
        robot.drive()
        self._grippers.apply()
        self.office.step()
        if self._grippers.drop_lost():
            self._tell_grasps()
        news, self._news = self._news, []
        return news + self._sensing.observe(self.time, self._grippers.holds())

    @property
    def held(self) -> tuple[str, ...]:
        """Names of what the grippers hold."""
        return tuple(hold.object for hold in self._grippers.holds())

    @property
    def halted(self) -> str:
        """Say that the fence holds the robot back, in a sentence; empty where it does not."""
        return self._watch.halted

    def truth(self, name: str) -> BodyTruth:
        """Give a body's true pose and velocity: for scoring only, never for a topic.

        Raises:
            SimError: no body has this name.
        """
        return self.office.world.truth(name)

    def robot_truth(self) -> tuple[Array, Array]:
        """Give the base's true pose (3,) in `world` and its rates (3,) along `world`'s axes: for scoring only."""
        return self.robot.base_state()

    @property
    def people(self) -> dict[str, Walker]:
        """Where everybody truly is: for scoring only."""
        return self.office.crowd.walkers

    @property
    def contacts(self) -> list[Contact]:
        """What robot and cart have touched so far: for scoring only."""
        return self.office.proximity.contacts

    @property
    def clearance(self) -> Clearance:
        """How near robot and cart have come to people and things so far: for scoring only."""
        return self.office.proximity.clearance

    def close(self) -> None:
        """End the Bullet client; a second call does nothing."""
        self._client.close()
