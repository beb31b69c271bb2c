"""The loop against the simulator, in one process: the demo's push, end to end."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bullet_sim.scene import load_scene
from krang_sim import observations as seen
from krang_sim.session import KrangSession
from pbrl_control.admittance import grip_wrench
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.loop import ControlLoop
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.push import GripperAnswer, Phase
from pbrl_control.push_plan import PushPlan, load_plan

PERIOD = 0.01


class Eyes:
    """The latest of every stream, from observations."""

    def __init__(self) -> None:
        self.posture: Posture | None = None
        self.streams: dict[str, dict] = {"tags": {}, "wrenches": {}, "grips": {}, "bodies": {}}

    def take(self, observation: object) -> None:
        match observation:
            case seen.JointStates(names=names, position=position):
                self.posture = Posture.from_joint_states(names, position.tolist())
            case seen.WristReading(side=side, force=force, torque=torque):
                self.streams["wrenches"][side] = np.concatenate((force, torque))
            case seen.TagReading(time=time, tag=tag, position=position, quaternion=quaternion):
                self.streams["tags"][tag] = Tag(time, position, quaternion)
            case seen.GraspState(holds=holds):
                grips = {hold.gripper: Grip(hold.object, hold.contact_point[:2]) for hold in holds}
                self.streams["grips"] = grips
            case seen.KnownScene(bodies=bodies):
                self.streams["bodies"] = {body.name: BodyShape(body.footprint, body.height) for body in bodies}

    def percept(self) -> Percept:
        return Percept(self.posture, **{name: dict(stream) for name, stream in self.streams.items()})


def drive(session: KrangSession, kinematics: RobotKinematics, plan: PushPlan) -> tuple[ControlLoop, np.ndarray]:
    """Run a plan; return the loop, and a row for each tick held: yaw, force along and across, joint room, x, y."""
    loop, eyes, due, rows = ControlLoop(kinematics, plan), Eyes(), 0.0, []
    side = plan.grips[0].gripper
    while session.time < 40.0 and loop.executive.phase not in (Phase.DONE, Phase.FAILED):
        for observation in session.step():
            eyes.take(observation)
        if session.time + 1e-9 < due or eyes.posture is None:
            continue
        due = session.time + PERIOD
        command = loop.tick(session.time, eyes.percept())
        session.command_base(command.body.base_v, command.body.base_w)
        for name in SIDES:
            session.command_arm(name, command.body.arm(name).tolist())
        for request in command.push.requests:
            grip = session.grasp(request.side, request.object) if request.action == "grasp" else session.release(side)
            loop.answer(GripperAnswer(request.action, request.side, grip.success, grip.message, grip.distance))
        if side in eyes.streams["grips"]:
            x, y, yaw = session.truth(plan.object).planar
            bends = np.abs(eyes.posture.arm(side)[[1, 3, 5]])
            gripper = kinematics.grippers(eyes.posture)[side]
            wrench = grip_wrench(side, gripper, loop.executive._bias[side].remove(eyes.streams["wrenches"][side]))
            rows.append([yaw, *np.abs(wrench[:2]), 2.094 - bends.max(), x, y])
    return loop, np.array(rows)


def test_a_table_with_a_locked_caster_is_turned(kinematics: RobotKinematics, root: Path) -> None:
    plan = load_plan(root / "config/params/pushes/turn_table.yaml")
    scene = load_scene(root / "config/scenes/locked_caster.yaml")
    with KrangSession(scene, seed=5) as session:
        loop, rows = drive(session, kinematics, plan)
        assert loop.executive.phase == Phase.DONE
        assert session.time < 20.0
    yaw, along, across, room, _, _ = rows.T
    assert 0.3 < np.abs(yaw - yaw[0]).max() < 0.8
    assert along.max() < 100.0, "rubber slips at 320 N"
    assert across.max() < 56.0, "what the wrist carries"
    assert room.min() > 0.1, "no bend near its stop while it holds"


def test_a_cart_with_fixed_wheels_turns_about_their_axle_and_slides_along_them(
    kinematics: RobotKinematics, root: Path
) -> None:
    plan = load_plan(root / "config/params/pushes/push_cart.yaml")
    plan = plan.model_copy(update={"segments": plan.segments[:3]})
    scene = load_scene(root / "config/scenes/utility_cart.yaml")
    with KrangSession(scene, seed=5) as session:
        loop, rows = drive(session, kinematics, plan)
        assert loop.executive.phase == Phase.DONE
    yaw, along, across, _, x, y = rows.T
    assert np.abs(yaw - yaw[0]).max() > 0.5
    assert max(along.max(), across.max()) < 56.0, "what the wrist carries"
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], -1)
    axle = np.stack([x, y], -1) + 0.308 * ahead
    steps, middle = np.diff(axle, axis=0), (ahead[1:] + ahead[:-1]) / 2
    along_wheels = np.abs(np.sum(steps * middle, axis=1)).sum()
    across_wheels = np.abs(middle[:, 0] * steps[:, 1] - middle[:, 1] * steps[:, 0]).sum()
    assert along_wheels > 0.2, "the wheels roll"
    assert across_wheels < 0.02 * along_wheels, "and hold"
