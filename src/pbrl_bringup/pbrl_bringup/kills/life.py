"""One graph that runs beside a simulator which writes down what is true, and in which nodes are struck."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import Pose2D
from pbrl_msgs.action import ReachGoal
from pbrl_msgs.msg import NamoStatus

from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_text
from pbrl_bringup.graph import free_domain, load_graph, node_command, node_environment, wait_ready, with_parameters
from pbrl_bringup.kills.cases import CALLED_OFF, scene_text
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient, Heard
from pbrl_namo.executive.table import ENDED, State

GOAL = (4.3, 0.0)
STARTED = 120.0  # [s] for a graph on a busy machine
ANSWERED = 15.0  # [s] for an answer
SETTLED = 20_000  # [bytes] of a bag that is under way


class Life:
    """The NAMO graph with its recorder, in a domain of its own, from the first node to the last.

    Args:
        folder: for scene, logs, truth and bags; new.
        room: one of `cases.SCENES`.
        seed: of simulator and executive.

    Attributes:
        told: (wall clock [s], state, sentence) of each message of status.
        truths: file of each simulator that was started, and when [s].
        bags: folder of each recorder that was started, when it was under way, and when it was struck or stopped [s].
    """

    def __init__(self, folder: Path, room: str, seed: int) -> None:
        self.told: list[tuple[float, State, str]] = []
        self.truths: list[tuple[Path, float]] = []
        self.bags: list[tuple[Path, float, float]] = []
        self._folder, self._room = folder, room
        scene = folder / "scene.yaml"
        write_text(scene, scene_text(room))
        goal = "" if room == CALLED_OFF else f"{GOAL[0]} {GOAL[1]}"
        told = {"sim.scene": str(scene.resolve()), "sim.seed": str(seed), "namo.goal": f'"{goal}"'}
        self._graph = with_parameters(load_graph("namo"), {**told, "namo.seed": str(seed)}, ("recorder",))
        self._count: dict[str, int] = {}
        self._status: Heard | None = None
        self._heard = 0
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            domain = stack.enter_context(free_domain())
            self.programs = stack.enter_context(Programs(self._folder / "logs", node_environment(domain)))
            self.client = stack.enter_context(GraphClient(domain, self.programs.check))
            self._status = self.client.listen(NamoStatus, "/namo/status")
            for name in sorted(self._graph.nodes, key=lambda name: name == "namo"):  # sets out last
                if name == "namo":
                    self.under_way()
                self.start(name)
            wait_ready(self._graph, self.client, STARTED)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.stop_recording()
        self._stack.close()

    # Nodes

    def start(self, name: str) -> None:
        """Start a node, for the first time or again; a simulator writes a new truth, a recorder a new bag."""
        number = self._count[name] = self._count.get(name, -1) + 1
        node = self._graph.nodes[name]
        if name == "recorder":
            bag = self._folder / f"bag_{number}"
            node = node.model_copy(update={"parameters": {**node.parameters, "output": str(bag)}})
        command = node_command(name, node)
        if name == "sim":
            truth = (self._folder / f"truth_{number}").resolve()
            self.truths.append((truth, time.time()))
            command = [sys.executable, "-m", "pbrl_bringup.ros.truthful_sim", str(truth), *command[1:]]
        self.programs.start(name, command)

    def under_way(self) -> None:
        """Wait until the newest recorder records."""
        bag = self._folder / f"bag_{self._count['recorder']}"
        self.until(lambda: sum(file.stat().st_size for file in bag.glob("*.mcap")) > SETTLED, STARTED, "no recording")
        self.bags.append((bag, time.time(), float("inf")))

    def bury(self, name: str) -> float:
        """Kill a node, as a crash would, and clear it away; return when [s]."""
        when = self.programs.strike(name, signal.SIGKILL)
        if name == "recorder":
            bag, begun, _ = self.bags[-1]
            self.bags[-1] = (bag, begun, when)
        self.programs.stop(name)
        return when

    def stop_recording(self) -> None:
        """End the newest recording in order."""
        if self.bags and self.bags[-1][2] == float("inf") and "recorder" in self.programs.names:
            bag, begun, _ = self.bags[-1]
            self.bags[-1] = (bag, begun, time.time())
            self.programs.stop("recorder")

    # The mission

    def send_goal(self) -> None:
        """Send the goal by the action, in the room in which it is called off."""
        request = ReachGoal.Impl.SendGoalService.Request()
        request.goal_id.uuid = [len(self.told) % 256, *os.urandom(15)]
        request.goal = ReachGoal.Goal(goal=Pose2D(x=GOAL[0], y=GOAL[1], theta=float("nan")), seed=1)
        # Who was killed is still offered for a while: what is asked of him is not answered, and asked again.
        for patience in (ANSWERED, ANSWERED, STARTED):
            with suppress(BringupError):
                self.client.call(ReachGoal.Impl.SendGoalService, "/reach_goal/_action/send_goal", request, patience)
                return
        raise BringupError("/reach_goal: expected somebody who takes a goal, got no answer")

    def call_off(self) -> None:
        """Cancel every goal."""
        self.client.call(CancelGoal, "/reach_goal/_action/cancel_goal", CancelGoal.Request(), STARTED)

    def until(self, condition: Callable[[], bool], timeout: float, complaint: str) -> None:
        """Handle messages until a condition holds.

        Raises:
            BringupError: it does not in time, or a node has ended by itself.
        """
        self.client.wait_until(lambda: self._hear() or condition(), timeout, complaint)

    def _hear(self) -> bool:
        """Take note of the newest message, where there is one; always False."""
        status = self._status
        if status is not None and status.count != self._heard:
            self._heard = status.count
            told: NamoStatus = status.message
            self.told.append((time.time(), State(told.state), str(told.sentence)))
        return False

    @property
    def state(self) -> State | None:
        """Return what the executive said last that it is at."""
        return self.told[-1][1] if self.told else None

    def wait(self, seconds: float) -> None:
        """Handle messages for a while [s of the wall clock]."""
        end = time.time() + seconds
        self.until(lambda: time.time() >= end, seconds + STARTED, "the clock stands still")

    def reach(self, state: State, still: float, longest: float) -> bool:
        """Wait until a state is told of; return whether it is, before the mission ends or `longest` [s] is over.

        Raises:
            BringupError: the mission stands still, in one state for `still` [s]; or a node has ended by itself.
        """
        if self._room == CALLED_OFF and self.state != state:
            self._be_called_off(still)
        since = len(self.told) - 1 if self.state == state else len(self.told)
        end = time.monotonic() + longest

        def states() -> list[State]:
            return [each[1] for each in self.told[since:]]

        def decided() -> bool:
            return state in states() or any(each in ENDED for each in states()) or time.monotonic() > end

        def moved_on(before: State | None) -> bool:
            return decided() or self.state != before

        while not decided():
            self.until(partial(moved_on, self.state), still, f"no {state}: still {self.state or 'nothing'}")
        return state in states()

    def _be_called_off(self, timeout: float) -> None:
        """Set out, and call it off as soon as something is held."""
        since = len(self.told)
        self.send_goal()
        self.until(lambda: self.state in (State.CLEAR, *ENDED) and len(self.told) > since, timeout, "nothing is moved")
        self.call_off()
