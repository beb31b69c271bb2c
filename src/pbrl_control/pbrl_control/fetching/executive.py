"""Fetching: drive to an object, grasp it, make sure that it is held, do something with it. Pure; the time is given.

| phase | what happens | what ends it badly |
|---|---|---|
| locate | stands and looks; then plans a grasp and a way to it | something is not seen; no grasp can be driven to |
| retreat | backs off, where open grippers are among furniture | no room behind |
| stow | raises both arms, so that they clear tables | an arm does not get there |
| drive | follows the way; plans again where the object moves | tags or odometry lost, base stuck, too many ways |
| approach and on | as in `PushExecutive`; a slight pull before the course | see there, and `ConfirmedCourse` |

A grasp that fails before anything was moved is given up for another one, a few times.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pbrl_control.course import Course
from pbrl_control.errors import ControlError
from pbrl_control.fetching.choice import GivenGrips, GraspChoice
from pbrl_control.fetching.driving import Drive, WayLostError
from pbrl_control.fetching.grip_test import ConfirmedCourse, GripReading
from pbrl_control.fetching.settings import FetchSettings
from pbrl_control.fetching.surroundings import Surroundings
from pbrl_control.fetching.whereabouts import Whereabouts
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.grasping import GraspCandidate
from pbrl_control.kinematics import ARM_JOINTS, SIDES, RobotKinematics
from pbrl_control.navigation import KRANG_STOWED, MotionChecker, Struck
from pbrl_control.percept import Percept
from pbrl_control.planar import Array
from pbrl_control.push import GripperAnswer, Phase, PushCommand, PushExecutive
from pbrl_control.settings import ControllerSettings
from pbrl_control.types import PlanarTwist

STILL = PlanarTwist()
NEAR = 0.02  # [m] from furniture, seen from above, at which a gripper is among it


class FetchExecutive:
    """Runs one plan from anywhere in the room.

    Args:
        plan: what to grasp, and how; its own grips count only where `choice` says so.
        kinematics: of the robot.
        controller: settings of the body controller that obeys.
        settings: of the fetch.
        choice: which grasps to drive to; None: the plan's grips.
        course: what the object does once it is held for sure; None: it is let go again.
        seed: of grasp and route sampling.
        struck: obstacles that nobody sees, remembered beyond this fetch; None: none yet.

    Attributes:
        plan: as given.
        phase: where it is.
        candidate: the grasp that is being tried.
        troubles: why each way or grasp before this one was given up.
        confirmed: whether the grip has passed its test.

    Raises:
        ControlError: the controller is told not to stow idle arms.
    """

    def __init__(
        self,
        plan: GraspPlan,
        kinematics: RobotKinematics,
        controller: ControllerSettings | None = None,
        settings: FetchSettings | None = None,
        *,
        choice: GraspChoice | None = None,
        course: Course | None = None,
        seed: int = 0,
        struck: Struck | None = None,
    ) -> None:
        self.plan = plan
        self.phase = Phase.LOCATE
        self.candidate: GraspCandidate | None = None
        self.troubles: list[str] = []
        self._controller = controller or ControllerSettings()
        if not self._controller.stow_idle_arm:
            raise ControlError("fetch: expected a controller that stows idle arms, got stow_idle_arm: false")
        self._settings = settings or FetchSettings()
        self._choice = choice or GivenGrips(plan)
        self._course = course
        self._rng = np.random.default_rng(seed)
        self._where = Whereabouts(kinematics, self._settings.localizer)
        self._around = Surroundings(self._settings.smoothing, struck)
        self._drive: Drive | None = None
        self._push: PushExecutive | None = None
        self._test: ConfirmedCourse | None = None
        self._failed_stands: list[Array] = []
        self._attempts = 1
        self._looked = False  # since the base stands
        self._backed_off = 0
        self._failure = ""
        self._since: float | None = None  # of this phase
        self._steps: dict[Phase, Callable[[float, Percept], PushCommand]] = {
            Phase.LOCATE: self._locate,
            Phase.STOW: self._stow,
            Phase.DRIVE: self._follow,
            Phase.RETREAT: self._retreat,
        }

    @property
    def confirmed(self) -> bool:
        """Whether the grip has passed its test."""
        return self._test is not None and self._test.confirmed

    @property
    def readings(self) -> dict[str, GripReading]:
        """What the test of the last grip found, by gripper; empty before it."""
        return {} if self._test is None else self._test.readings

    def odometry(self, time: float, pose: Array) -> None:
        """Take in the pose (3,) of `base` in `odom` [m, rad] at a time [s]."""
        self._where.odometry(time, pose)

    def told(self, room: Array | None, fixed: dict[str, Array]) -> None:
        """Take in what wears no tag: see `Surroundings.told`."""
        self._around.told(room, fixed)

    def answer(self, answer: GripperAnswer) -> None:
        """Take in what came of a request."""
        if self._push is not None:
            self._push.answer(answer)

    def tick(self, now: float, percept: Percept) -> PushCommand:
        """Return what to do at `now` [s], given the latest percept; never raises for what it perceives."""
        if self.phase in (Phase.DONE, Phase.FAILED):
            return PushCommand(self.phase, self._failure or "done")
        self._since = now if self._since is None else min(now, self._since)
        self._where.take(now, percept)
        self._around.take(percept)
        try:
            return self._manipulate(now, percept) if self._push else self._steps[self.phase](now, percept)
        except WayLostError as error:
            return self._again(now, str(error))
        except ControlError as error:
            return self._fail(str(error))

    def _locate(self, now: float, percept: Percept) -> PushCommand:
        assert self._since is not None
        held = [f"{side} holds {grip.object!r}" for side, grip in sorted(percept.grips.items())]
        if held:
            raise ControlError(f"fetch: expected open grippers, got {', '.join(held)}; release first")
        waited, missing = now - self._since, self._missing(now, percept)
        if missing and waited > self._settings.look_timeout:
            raise ControlError(
                f"fetch: expected to see everything that driving needs, got none of {'; '.join(missing)} "
                f"for {waited:.1f} s; is its source running?" + self._before()
            )
        if missing or (waited < self._settings.look and not self._looked):
            return self._rest(f"waiting for {missing[0]}" if missing else "looking around")
        self._looked = True
        self._check_body()
        if self._low_grippers(now):
            self._backed_off += 1
            self._check_behind(now)
            self._looked = False
            self._enter(Phase.RETREAT)
            return self._rest("about to back off: grippers are among furniture")
        if self._unstowed()[1] > self._settings.stow_tolerance:
            self._enter(Phase.STOW)
            return self._rest("about to stow the arms")
        return self._set_out(now, percept)

    def _missing(self, now: float, percept: Percept) -> list[str]:
        """Return what is not known that planning needs, in words."""
        name, missing = self.plan.object, []
        if self._where.posture() is None:
            missing.append("joint positions")
        if name not in percept.bodies:
            missing.append(f"body {name!r} in the scene")
        elif self._around.age(name, now) > self._settings.tag_age:
            missing.append(f"tag {name!r}")
        missing += [f"tag {other!r}" for other in self._around.unplaced() if other != name]
        lost = self._where.fault(now)
        return [*missing, f"pose of the base ({lost})"] if lost else missing

    def _check_body(self) -> None:
        """Refuse a waist or torso that footprints and arms are not known for."""
        posture, settings = self._where.posture(), self._settings
        if posture is None:
            return
        for joint, wanted, angle in (
            ("waist", settings.waist, posture.waist),
            ("torso", settings.torso, posture.torso),
        ):
            if abs(angle - wanted) > settings.body_tolerance:
                raise ControlError(
                    f"{joint}: expected within {settings.body_tolerance} rad of {wanted}, where the room that the "
                    f"robot takes is known, got {angle:.3f}; move it there first"
                )

    def _low_grippers(self, now: float) -> list[str]:
        """Return which grippers are over or in something that they would hit as they are stowed."""
        top = self._around.height
        return [
            side
            for side, tip in self._where.tips(now).items()
            if any(tip[2] < top(name) + self._settings.headroom for name in self._around.beside(tip[:2], NEAR))
        ]

    def _check_behind(self, now: float) -> None:
        """Refuse to back off into something, or for ever."""
        settings, pose = self._settings, self._where.pose(now)
        if self._backed_off > 2 * settings.attempts or pose is None:
            raise ControlError(
                f"retreat: expected grippers clear of furniture after {self._backed_off - 1} times "
                f"{settings.back_off} m, they are not; move the arms by hand"
            )
        ahead = np.array([np.cos(pose[2]), np.sin(pose[2])])
        checker = MotionChecker(self._around.floor(), KRANG_STOWED, 0.0)
        fault = checker.drive_fault(pose[:2], pose[:2] - settings.back_off * ahead, float(pose[2]))
        if fault and not checker.pose_fault(pose):
            raise ControlError(
                f"retreat: expected {settings.back_off} m of free floor behind the robot to draw its grippers out, "
                f"got {fault}; make room"
            )

    def _retreat(self, now: float, percept: Percept) -> PushCommand:
        assert self._since is not None
        settings = self._settings
        if now - self._since >= settings.back_off / settings.back_off_speed:
            self._enter(Phase.LOCATE)
            return self._rest("backed off")
        return PushCommand(self.phase, "backing off", {"base": PlanarTwist(vx=-settings.back_off_speed)})

    def _unstowed(self) -> tuple[str, float]:
        """Return the joint that is furthest from where it is stowed, and by how much [rad]."""
        posture = self._where.posture()
        if posture is None:
            return "", float("inf")
        stowed = np.array(self._controller.stowed)
        off = {side: np.abs(posture.arm(side) - sign * stowed) for side, sign in zip(SIDES, (1.0, -1.0), strict=True)}
        side = max(SIDES, key=lambda each: float(off[each].max()))
        return ARM_JOINTS[side][int(off[side].argmax())], float(off[side].max())

    def _stow(self, now: float, percept: Percept) -> PushCommand:
        assert self._since is not None
        joint, off = self._unstowed()
        if off <= 0.5 * self._settings.stow_tolerance:
            self._enter(Phase.LOCATE)
            return self._rest("arms are stowed")
        if now - self._since > self._settings.stow_timeout:
            raise ControlError(
                f"stow: expected the arms within {self._settings.stow_tolerance} rad of their stowed posture in "
                f"{self._settings.stow_timeout:.0f} s, got {joint} {off:.2f} rad off; is it blocked?"
            )
        # What is not held is told to rest: the controller takes arms without a task to their stowed posture.
        return PushCommand(self.phase, f"stowing: {joint} has {off:.2f} rad to go", {self.plan.object: STILL})

    def _set_out(self, now: float, percept: Percept) -> PushCommand:
        """Choose a grasp and the way to it."""
        name, base, pose = self.plan.object, self._where.pose(now), self._around.pose(self.plan.object)
        assert base is not None and pose is not None
        floor, shape = self._around.floor(), percept.bodies[name]
        found = self._choice.search(name, shape, pose, base, floor, self._rng, self._settings.grasps)
        if not found.candidates:
            raise ControlError(
                f"fetch: expected a grasp of {name!r} that can be driven to, got none: {found.why()}; "
                f"move what is in the way, or allow other hands" + self._before()
            )
        fresh = [each for each in found.candidates if not self._tried(each)]
        self.candidate = min(fresh or found.candidates, key=self._drive_time)
        self._looked = False
        self._drive = Drive(self.candidate, floor, pose, self._controller.base, self._settings)
        self._enter(Phase.DRIVE)
        hands = " and ".join(self.candidate.sides)
        return self._rest(f"{self.candidate.path_length:.1f} m to drive, then to grasp {hands}")

    def _drive_time(self, candidate: GraspCandidate) -> float:
        """Return about how long the way takes [s]: a shorter one with half a turn more is no better."""
        limits, path = self._controller.base, candidate.path
        return path.length / min(limits.speed, limits.forward_speed) + path.turning / limits.yaw_rate

    def _tried(self, candidate: GraspCandidate) -> bool:
        apart = self._settings.apart
        return any(np.hypot(*(candidate.base_goal[:2] - stand)) < apart for stand in self._failed_stands)

    def _follow(self, now: float, percept: Percept) -> PushCommand:
        assert self._drive is not None and self.candidate is not None
        if percept.grips:
            raise ControlError(f"drive: expected open grippers, got {', '.join(sorted(percept.grips))} closed")
        twist, arrived, sentence = self._drive.step(now, self._where, self._around)
        if arrived:
            self._hand_over()
            return self._rest("before the edge")
        return PushCommand(self.phase, sentence, {"base": twist})

    def _hand_over(self) -> None:
        """Leave the rest to a push executive, whose course begins with the test of the grip."""
        assert self.candidate is not None
        plan = self.plan.model_copy(update={"grips": self.candidate.grips()})
        self._test = ConfirmedCourse(plan.object, self._settings.grip_test, self._course)
        self._push = PushExecutive(plan, self._test)
        self._enter(Phase.APPROACH)

    def _manipulate(self, now: float, percept: Percept) -> PushCommand:
        assert self._push is not None and self._drive is not None
        if self._push.phase == Phase.APPROACH:
            self._drive.check_object(self._around)
        command = self._push.tick(now, percept)
        self.phase = command.phase
        if command.phase != Phase.FAILED:
            return command
        if self.confirmed or percept.grips:
            return self._fail(command.status)
        return self._again(now, command.status)

    def _again(self, now: float, sentence: str) -> PushCommand:
        """Give this way or grasp up for another one, or all of it after too many."""
        if self._push is not None and self.candidate is not None:
            self._failed_stands.append(self.candidate.base_goal[:2])
        if self._attempts >= self._settings.attempts:
            tries = f"; gave up after {self._attempts} attempts" if self._attempts > 1 else ""
            return self._fail(sentence + tries)
        self._attempts += 1
        self.troubles.append(sentence)
        self._push = self._drive = self._test = None
        self._enter(Phase.LOCATE)
        return self._rest(f"{sentence}; trying again")

    def _before(self) -> str:
        return f" (before that: {self.troubles[-1]})" if self.troubles else ""

    def _fail(self, sentence: str) -> PushCommand:
        self._failure = sentence
        self._enter(Phase.FAILED)
        return PushCommand(self.phase, sentence)

    def _enter(self, phase: Phase) -> None:
        self.phase, self._since = phase, None

    def _rest(self, status: str) -> PushCommand:
        return PushCommand(self.phase, status, {"base": STILL})
