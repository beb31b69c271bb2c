"""Which part does the work of which state, made when the state is entered."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from pbrl_control.kinematics import RobotKinematics
from pbrl_control.percept import Percept
from pbrl_control.planar import Array
from pbrl_control.push import Phase
from pbrl_control.settings import ControllerSettings
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.asking import Asking
from pbrl_namo.executive.driving import DriveToGoal
from pbrl_namo.executive.jobs import Answer, Job
from pbrl_namo.executive.manipulating import Manipulation
from pbrl_namo.executive.mission import Mission
from pbrl_namo.executive.opening_check import stretch_of
from pbrl_namo.executive.readying import GetReady
from pbrl_namo.executive.releasing import Release
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.step import BasePart, Part, Resting, Step, still_held
from pbrl_namo.executive.table import MAY_HOLD, RELEASING, Event, State
from pbrl_namo.executive.thinker import Question, Thinker
from pbrl_namo.executive.view import Look, RoomView
from pbrl_namo.scene import NamoScene

OpeningCheck = Callable[[NamoScene, Array], bool]
"""Says whether the robot can get from where it is in a scene to most of the points (k, 2) of a region, in `world`."""


class Parts:
    """Makes them.

    Args:
        view: of robot and room.
        kinematics: of the robot.
        thinker: who is asked.
        opening: says whether there is an opening; None: nobody can tell.
        controller: settings of the body controller that obeys.
        settings: of everything else.
        gone: who is waited for, in words; empty: nobody.
    """

    def __init__(
        self,
        view: RoomView,
        kinematics: RobotKinematics,
        thinker: Thinker,
        opening: OpeningCheck | None,
        controller: ControllerSettings,
        settings: ExecutiveSettings,
        gone: Callable[[], str],
    ) -> None:
        self._view, self._kinematics, self._thinker, self._opening = view, kinematics, thinker, opening
        self._controller, self._settings, self._gone = controller, settings, gone

    def make(self, state: State, now: float, mission: Mission, reason: str) -> Part:
        """Return what does the work of a state that is entered at `now` [s].

        Raises:
            ControlError: it cannot be begun, and why.
            NamoError: likewise.
        """
        view, settings = self._view, self._settings
        if state == State.LOOK:
            return Look(view, settings)
        if state == State.GET_READY:
            return GetReady(view, self._controller, settings)
        if state == State.NAVIGATE:
            mission.manipulation = self._manipulation(now, mission)
        if state in (State.NAVIGATE, State.GRASP, State.CLEAR):
            assert mission.manipulation is not None
            return mission.manipulation.part(state)
        if state in RELEASING:
            held = mission.manipulation
            return Release(settings.release, () if held is None else held.candidate.sides)
        if state == State.DRIVE_TO_GOAL:
            assert mission.planned.way is not None
            return DriveToGoal(mission.planned.way, view, self._controller.base, settings)
        if state == State.PAUSED:
            return Paused(self._gone, settings.pause_timeout, settings.pause_settle)
        if state in (State.DONE, State.FAILED, State.CANCELLED):
            return Resting(reason or "done", Phase.DONE if state == State.DONE else Phase.FAILED)
        return self._ask(state, now, mission)

    def _ask(self, state: State, now: float, mission: Mission) -> Part:
        view, jobs = self._view, self._settings.jobs
        job: Job
        take: Callable[[Answer], Step]
        if state == State.PLANNING:
            job, take, what, timeout = mission.plan_job(now, view), partial(self._planned, mission), "a plan", jobs.plan
        elif state == State.GET_GRASP_POINT:
            job, take, what, timeout = mission.grasp_job(now, view), mission.take_grasp, "a grasp", jobs.grasp
        elif state == State.UPDATE_MODEL:
            job, take, what, timeout = mission.learn_job(), mission.take_learned, "a learned model", jobs.learn
        else:
            job, take, what, timeout = mission.mismatch_job(), mission.take_mismatch, "a diagnosis", jobs.mismatch
        phase = Phase.SETTLE if state in MAY_HOLD else Phase.LOCATE
        return Asking(Question(self._thinker, job, timeout, self._settings.jobs), take, what, phase)

    def _planned(self, mission: Mission, answer: Answer) -> Step:
        """Return what comes of a plan; where none leads past what nobody sees, that is doubted, once a goal.

        The base may have been held up by nothing: wheels that slipped, commands that came late. If it is there, it
        stops the base again.
        """
        step, struck = mission.take_plan(answer), self._view.around.struck
        doubted = any(change.event == Event.DOUBTED for change in mission.account.log)
        if step.event != Event.NO_WAY or not struck.outlines or doubted:
            return step
        unseen = " and ".join(struck.outlines)
        struck.forget()
        return Step(f"{step.status}; planned anew without {unseen}, which only the base has felt", Event.DOUBTED)

    def _manipulation(self, now: float, mission: Mission) -> Manipulation:
        move, candidate, check = mission.planned.move, mission.grasp.candidate, self._opening
        assert move is not None and candidate is not None
        targets = np.asarray(move.targets, dtype=float).reshape(-1, 2)
        scene = self._view.scene(now, mission.goal, mission.left_alone())

        def opened(_: float, percept: Percept) -> bool:
            scene = self._view.held_scene(percept, move.object, mission.goal)
            return check is not None and scene is not None and check(_without(scene, move.then), targets)

        settings = self._settings
        if move.object in scene.movable:
            settings = settings.model_copy(update={"stretch": stretch_of(move, scene, settings.stretch)})
        return Manipulation(
            move,
            candidate,
            self._view,
            self._kinematics,
            self._controller,
            settings,
            None if check is None else opened,
        )


class Paused(BasePart):
    """Rests until whoever is gone is back, and until the robot stands.

    Args:
        gone: who is waited for, in words; empty: nobody any more.
        timeout: [s] at most.
        settle: [s] that nobody is gone any more.
    """

    def __init__(self, gone: Callable[[], str], timeout: float, settle: float) -> None:
        self._gone, self._timeout, self._settle = gone, timeout, settle
        self._since: float | None = None
        self._back: float | None = None

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        self._since = now if self._since is None or now < self._since else self._since
        held, gone = still_held(percept), self._gone()
        phase = Phase.SETTLE if held else Phase.LOCATE
        if not gone:
            self._back = now if self._back is None or now < self._back else self._back
            if now - self._back < self._settle:
                return Step("whoever was gone is back: at rest first", None, phase)
            return Step(held, Event.STILL_HELD) if held else Step("whoever was gone is back", Event.LINK_BACK)
        self._back = None
        if now - self._since > self._timeout:
            return Step(f"{gone}, for more than {self._timeout:.0f} s", Event.PAUSED_TOO_LONG)
        return Step(f"waiting: {gone}", None, phase)


def _without(scene: NamoScene, names: tuple[str, ...]) -> NamoScene:
    """Return a scene without some movable things: they will have to go too, but later.

    Raises:
        NamoError: there is no thing of a name.
    """
    for name in names:
        if name not in scene.movable:
            raise NamoError(f"plan: expected things that are in the scene, got {name!r}")
    return scene.without(names)
