"""Costmaps as a node: scans, map and poses in; Nav2's /local_costmap/costmap and /global_costmap/costmap out.

The local costmap lies around the robot and comes with every scan; the global one covers the map and comes at `rate`.
Both are in `map`, and stamped with the time of the last scan in them: when the laser is silent, they get old, and
whoever drives by them stops. /tilt_scan is of a laser that nods, and sees what hangs over the floor; without one, the
level laser is all there is. What lasers see of robot and cart is left out. The service /costmaps/clear takes out what
is marked where robot and cart are, and what was seen too seldom; /costmaps/forget_unseen what nobody has seen of late.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_control.planar import Array, compose, on_floor
from pbrl_control.ros.qos import LATCHED, NEWEST
from pbrl_planner.cart.kept_out import with_kept_out
from pbrl_planner.cart.shoulders import with_shoulders
from pbrl_planner.cart.tracker import CartTracker
from pbrl_planner.costmap import CostField, Costmap, Recovery, StaticMap
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import field_to_msg, map_from_msg, scan_from_msg
from pbrl_planner.ros.frames import Frames, NotYetError
from pbrl_planner.ros.hearing import BASE, SAID, Hearing
from pbrl_planner.ros.running import declare_settings, run_node
from pbrl_planner.ros.saying import NOTHING_TO_CLEAR

WAITING = 5
"""Scans of the nodding laser that wait at most for /tf to say how it stood."""
MOVING = QoSProfile(depth=100)
STATIC = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class CostmapNode(Node):
    """Both costmaps.

    Attributes:
        tracker: what is known of where robot and cart are.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("costmap_node", **options)
        self._settings = declare_settings(self)
        rate = declare(self, "rate", 2.0, "rate of the global costmap, on the node's clock [Hz]", (0.1, 20.0))
        refuse_unknown(self)
        self.tracker, self._frames = CartTracker(), Frames()
        self._static: StaticMap | None = None
        self._nods: deque[LaserScan] = deque(maxlen=WAITING)
        self._left_aside = ""
        self._local = Costmap(self._settings.local_costmap)
        self._global: Costmap | None = None
        self._local_out = self.create_publisher(OccupancyGrid, "local_costmap/costmap", LATCHED)
        self._global_out = self.create_publisher(OccupancyGrid, "global_costmap/costmap", LATCHED)
        diagnostics = Diagnostics(self, lambda: self._left_aside)
        self._hearing = Hearing(self, diagnostics, self.tracker, self._begin_again)
        diagnostics.subscribe(TFMessage, "/tf_static", self._frames.hear, STATIC)
        diagnostics.subscribe(OccupancyGrid, "map", self._on_map, LATCHED)
        diagnostics.subscribe(LaserScan, "scan", self._on_scan, NEWEST)
        diagnostics.subscribe(TFMessage, "/tf", self._on_frames, MOVING, needed=False)
        diagnostics.subscribe(LaserScan, "tilt_scan", self._on_nod, NEWEST, needed=False)
        self.create_service(Trigger, "costmaps/clear", self._clear)
        self.create_service(Trigger, "costmaps/forget_unseen", self._forget_unseen)
        self.create_timer(1.0 / rate, self._tell_global)

    def _begin_again(self) -> None:
        self._local = Costmap(self._settings.local_costmap)
        if self._static is not None:
            self._global = Costmap.over(self._static, self._settings.global_costmap)

    def _on_map(self, message: OccupancyGrid) -> None:
        try:
            self._static = map_from_msg(message)
            self._global = Costmap.over(self._static, self._settings.global_costmap)
        except PlannerError as error:
            self.get_logger().error(f"/map is left aside: {error}")
            return
        rows, columns = self._static.cells.shape
        self.get_logger().info(f"map of {columns} by {rows} cells of {self._static.resolution:g} m")
        self._tell_global()

    def _on_scan(self, message: LaserScan) -> None:
        try:
            scan = scan_from_msg(message)
            pose = self.tracker.pose(scan.time)
            if pose is None:
                raise PlannerError(f"/scan: expected to know where the robot is; still waiting for {self._wanting()}")
            laser = compose(pose, self._frames.planar(message.header.frame_id, BASE))
            own = self.tracker.own(scan.time)
            self._local.recentre(float(pose[0]), float(pose[1]))
            for costs in (self._local, self._global):
                if costs is not None:
                    costs.observe(scan, laser, own)
        except PlannerError as error:
            self._left_aside = f"a scan was left aside: {error}"
            self.get_logger().warning(f"left aside: {error}", throttle_duration_sec=SAID)
            return
        self._left_aside = ""
        self._local_out.publish(field_to_msg(self._field(self._local, scan.time, own)))

    def _on_frames(self, message: TFMessage) -> None:
        self._frames.hear_moving(message)
        waiting, self._nods = list(self._nods), deque(maxlen=WAITING)
        for scan in waiting:
            self._on_nod(scan)

    def _on_nod(self, message: LaserScan) -> None:
        """Take in a scan of the laser that nods, as soon as it is known how it and the robot stood."""
        try:
            scan = scan_from_msg(message)
            pose = self.tracker.pose(scan.time)
            if pose is None:
                raise PlannerError(f"/tilt_scan: expected to know where the robot is; waiting for {self._wanting()}")
            laser = on_floor(pose) @ self._frames.pose(message.header.frame_id, BASE, scan.time)
            own = self.tracker.own(scan.time)
            for costs in self._maps():
                costs.observe_nodding(scan, laser, own)
        except NotYetError:
            self._nods.append(message)
        except PlannerError as error:
            self.get_logger().warning(f"left aside: {error}", throttle_duration_sec=SAID)

    def _wanting(self) -> str:
        return self.tracker.missing or "odometry as old as the scan"

    def _tell_global(self) -> None:
        """Publish the global costmap; before the first scan it is the map's alone."""
        if self._global is None:
            return
        # Where scans cease, nothing is forgotten: nobody has looked.
        now = self._global.time if math.isfinite(self._global.time) else self._now()
        try:
            field = self._field(self._global, now, self.tracker.own(now))
        except PlannerError as error:  # the robot or the cart is told to be where nobody can be
            self._left_aside = f"the global costmap was not told: {error}"
            self.get_logger().warning(self._left_aside, throttle_duration_sec=SAID)
            return
        self._global_out.publish(field_to_msg(field))

    def _field(self, costs: Costmap, now: float, own: list[Array]) -> CostField:
        return with_kept_out(with_shoulders(costs.field(now), self._static, own), self.tracker.kept_out)

    def _clear(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        own = self.tracker.own(self._now())
        try:
            steps = [step for each in self._maps() for step in (each.clear_inside(own), each.clear_unconfirmed())]
        except PlannerError as error:
            response.success, response.message = False, str(error)
            return response
        return self._told(steps, response)

    def _forget_unseen(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # Where scans cease, nothing is forgotten: nobody has looked.
        age = self._settings.navigation.unseen
        return self._told([each.clear_unseen(each.time, age) for each in self._maps() if each.time > 0.0], response)

    def _told(self, steps: list[Recovery], response: Trigger.Response) -> Trigger.Response:
        words = "; ".join(f"{step.what}: {len(step.places)} cells" for step in steps if len(step.places))
        response.success, response.message = True, words or NOTHING_TO_CLEAR
        self.get_logger().info(response.message)
        self._tell_global()
        return response

    def _maps(self) -> list[Costmap]:
        return [each for each in (self._local, self._global) if each is not None]

    def _now(self) -> float:
        return self.tracker.now(self.get_clock().now().nanoseconds * 1e-9)


def main() -> None:
    """Run the node until it is told to stop."""
    run_node("costmap_node", CostmapNode)


if __name__ == "__main__":
    main()
