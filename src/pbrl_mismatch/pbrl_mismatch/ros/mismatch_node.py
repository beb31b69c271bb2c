"""Raises `/mismatches` as soon as an object's model no longer foretells what is heard, and says why a little later.

Where several things explain it, `/run_next_experiment` asks whoever offers `/push` for the push that would tell most of
them apart; what is heard of it goes into a new diagnosis.
"""

from __future__ import annotations

import json
from typing import Any

from pbrl_msgs.msg import Mismatches, ObjectModels
from pbrl_msgs.srv import PushObject
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.running import run_node
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.online.found import Found
from pbrl_mismatch.online.monitor import MismatchMonitor
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.ros.conversions import mismatches_to_msg, push_to_msg, stamp_of
from pbrl_mismatch.ros.markers import mismatch_markers
from pbrl_mismatch.ros.watcher import Watcher
from pbrl_model.errors import ModelError
from pbrl_model.ros.conversions import models_from_msg
from pbrl_model.ros.listener import MEMORY, RecordingListener

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
KNOWN = {
    "mass_spread": ("how well the mass that was told is known, as a standard deviation of its logarithm", (1e-3, 3.0)),
    "grasp_spread": ("how well the gripper's direction is known [rad]; 0: exactly", (0.0, 1.0)),
    "outline_spread": ("how well each side of the outline is known [m]; 0: exactly", (0.0, 1.0)),
}
"""Parameters that say what a diagnosis may take for given: a sentence and the bounds of each."""


class MismatchNode(Node):
    """Watches `/object_models` and the streams; publishes `/mismatches`, alarms at once and diagnoses later.

    Raises:
        BagError: a wrong parameter.
        MismatchError: one that does not fit the others.
    """

    def __init__(self, context: Context | None = None, **options: Any) -> None:
        super().__init__("mismatch_node", context=context, **options)
        defaults = MonitorOptions()
        chance = "chance of a false alarm within `horizon` of pushing"
        horizon = "time for which that is promised [s]"
        keep = "how much of what was heard a diagnosis is given, in whole holds [s]"
        gather = "time heard after an alarm before the diagnosis begins [s]"
        monitor = MonitorOptions(
            false_alarm=declare(self, "false_alarm", defaults.false_alarm, chance, (1e-9, 0.5)),
            horizon=declare(self, "horizon", defaults.horizon, horizon, (10.0, 1e7)),
            rest=declare(self, "rest", defaults.rest, "least time between two alarms about an object [s]", (1.0, 1e6)),
            keep=declare(self, "keep", defaults.keep, keep, (5.0, 600.0)),
            gather=declare(self, "gather", defaults.gather, gather, (0.0, 60.0)),
        )
        diagnosing = declare(self, "diagnose", True, "whether to say what was left out, not only that something was")
        without: list[str] = declare(self, "without", [], "effects that the library does without", choices=EFFECTS)
        usual, most = DiagnoseOptions(), "effects at most that are sought together"
        known = {
            name: declare(self, name, getattr(usual, name), text, limits) for name, (text, limits) in KNOWN.items()
        }
        together = declare(self, "most_together", usual.most_together, most, (1, 3))
        workers = declare(self, "workers", 1, "threads of a diagnosis", (1, 256))
        seed = declare(self, "seed", 0, "seed of every random draw", (0, 2**31 - 1))
        waits = "longest wait for the answer to a push that was asked for [s]"
        self._patience = declare(self, "patience", 600.0, waits, (0.1, 1e5))
        period = declare(self, "period", 0.1, "time between two looks at what has come [s]", (0.01, 1.0))
        memory = declare(self, "memory", MEMORY, "most that is kept of messages for a diagnosis [MB]", (1.0, 100_000.0))
        refuse_unknown(self)
        own = {**known, "most_together": together, "workers": workers, "seed": seed}
        chosen = DiagnoseOptions(without=tuple(without), **own)
        self._doing, self._alarms = "watches; no alarm so far", 0
        self._mismatches = self.create_publisher(Mismatches, "mismatches", LATCHED)
        self._markers = self.create_publisher(MarkerArray, "mismatches/markers", LATCHED)
        self.listener = RecordingListener(f"{self.get_name()}_listener", context, memory, self.get_namespace())
        self._watcher = Watcher(
            MismatchMonitor(monitor),
            self.listener,
            chosen if diagnosing else None,
            self._changed,
            self.get_logger().warning,
            period,
        )
        diagnostics = Diagnostics(self, lambda: self._doing, numbers=self._numbers)
        self.listener.tell(diagnostics)
        diagnostics.subscribe(ObjectModels, "object_models", self._take_models, LATCHED)
        # In groups of their own: a push may take minutes, in which the node has to go on. One thread runs all of them.
        self._pusher = self.create_client(PushObject, "push", callback_group=ReentrantCallbackGroup())
        group = MutuallyExclusiveCallbackGroup()
        self.create_service(Trigger, "run_next_experiment", self._run_next_experiment, callback_group=group)
        self._watcher.start()
        self.listener.start()

    def _numbers(self) -> dict[str, object]:
        return {"objects with an alarm": self._alarms, "messages heard": self.listener.count()}

    def _take_models(self, message: ObjectModels) -> None:
        try:
            self._watcher.give(models_from_msg(message))
        except ModelError as error:
            self.get_logger().warning(f"/object_models: {' '.join(str(error).split())}")

    async def _run_next_experiment(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Have the push made that would tell most, and diagnose its object anew; answers when the push is done."""
        push = self._watcher.next_push
        if push is None:
            response.message = "nothing is to be told apart: no diagnosis so far left two explanations and a push"
            return response
        if not self._pusher.service_is_ready():
            response.message = "expected somebody who offers /push, a robot or a simulator; nobody does"
            return response
        # No hold that ends sooner is this push, not even one whose end is still on its way here.
        ends = self.listener.newest() + float(push["duration"])
        done = await self._pushed(push_to_msg(push))
        if done is None:
            late = f"the push of {push['object']} has not ended within {self._patience:g} s"
            response.message = f"{late} (patience): see whether whoever makes it still runs, then ask again"
            return response
        response.success, response.message = done.success, done.message
        if done.success:
            self._watcher.diagnose_again(push["object"], ends)
            response.message = f"pushed: {json.dumps(dict(push))}; a new diagnosis of {push['object']} follows"
        return response

    async def _pushed(self, push: PushObject.Request) -> PushObject.Response | None:
        """Have a push made; None where it does not end in time: who makes it may have died, and then never answers."""
        call = self._pusher.call_async(push)
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        late = self.create_timer(self._patience, call.cancel, clock=clock)
        try:
            return await call
        finally:
            self.destroy_timer(late)

    def _changed(self, entries: tuple[Found, ...], stamp: float) -> None:
        self._alarms = len(entries)
        self._doing = f"alarm: {', '.join(entry.alarm.object for entry in entries)}" if entries else "watches; no alarm"
        self._mismatches.publish(mismatches_to_msg(entries, stamp))
        self._markers.publish(mismatch_markers(entries, stamp_of(stamp)))

    def destroy_node(self) -> None:
        """Stop watching and listening with the node."""
        self._watcher.stop()
        self.listener.stop()
        super().destroy_node()


def main() -> None:
    """Run the node until it is told to stop; errors at start are one line and exit code 2."""
    run_node(
        "mismatch_node",
        MismatchNode,
        (
            ModelError,
            MismatchError,
        ),
    )


if __name__ == "__main__":
    main()
