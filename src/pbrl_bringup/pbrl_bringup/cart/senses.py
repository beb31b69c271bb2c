"""From what the PR2's simulator publishes to what planner and local controller are given; nothing else reaches them."""

from __future__ import annotations

from functools import singledispatchmethod

import numpy as np

from bullet_sim.observations import GraspState, JointStates, KnownScene, RobotDescription
from pbrl_control.cart import CartBody, CartPercept, CartSight, choose_sight
from pbrl_control.cart.whereabouts import Whereabouts
from pbrl_control.fence import TOLD
from pbrl_control.planar import Array, compose, on_floor, placed
from pbrl_control.pr2_arms import Pr2Arms
from pbrl_planner.cart.kept_out import with_kept_out
from pbrl_planner.cart.outline import GRIP, frame_at_grip, pr2_with
from pbrl_planner.cart.shoulders import with_shoulders
from pbrl_planner.costmap import CostField, Costmap, CostmapSettings, EvidenceSettings, RangeScan, Recovery, StaticMap
from pr2_cart_sim.observations import BaseOdometry, CartReading, KnownMap, Localisation, Scan

LASER, NODDING = "base_laser_link", "laser_tilt_link"
LOCAL = CostmapSettings()
WHOLE = CostmapSettings(mark_range=6.0, clear_range=8.0, unseen=126, evidence=EvidenceSettings(memory=60.0))
"""Of the floor that is planned on: what was seen of it is remembered for about as long as a room is left."""
SIGHT_AGE, MISFIT = 0.25, 0.03
"""As old [s] and as far off [m] a reading of the cart may be before the next source is asked."""


class CartSenses:
    """The latest of every stream, and both costmaps, in `map` as far as the robot knows where that is.

    Args:
        resolution: of the cells that are planned on [m].

    Attributes:
        whereabouts: of the base.
        room: outline (k, 2) of the floor [m]; None: not told yet.
        body: outlines of robot and cart; None: the cart is not told yet.
        whole: the floor that is planned on; None: no map has come yet.
        local: what lasers see around the robot.
    """

    def __init__(self, resolution: float) -> None:
        self.whereabouts = Whereabouts()
        self.room: Array | None = None
        self.body: CartBody | None = None
        self.whole: Costmap | None = None
        self.local = Costmap(LOCAL)
        self._settings = CostmapSettings(**{**WHOLE.model_dump(), "resolution": resolution})
        self._static: StaticMap | None = None
        self._arms: Pr2Arms | None = None
        self._laser = np.zeros(3)
        self._joints: JointStates | None = None
        self._held: dict[str, str] = {}
        self._at_grip: dict[str, Array] = {}
        self._carts: dict[str, Array] = {}
        self._sights: dict[str, CartSight] = {}
        self._kept_out: list[Array] = []

    @singledispatchmethod
    def hear(self, observation: object) -> None:
        """Take in an observation; what is of no use here is left alone."""

    def percept(self, now: float) -> CartPercept | None:
        """Return what the local controller is given at `now` [s]; None: something has never come yet."""
        pose, sight = self.whereabouts.pose(now), self.sight(now)
        if pose is None or self._arms is None or self._joints is None or not self._sights:
            return None
        self.local.recentre(float(pose[0]), float(pose[1]))
        chosen = sight or self._newest()
        return CartPercept(
            pose,
            # The pose is led on by odometry's twist, for less than 20 ms.
            now if now - self.whereabouts.time < 0.05 else self.whereabouts.time,
            chosen.articulation,
            0.0,
            chosen.time,
            self.local.time,
            self._marked(self.local, now),
            ("left" in self._held, "right" in self._held),
            chosen.misfit,
            chosen.grip_offset(GRIP),
            self._arms.state(self._joints.names, self._joints.position),
            self._joints.time,
        )

    def state(self, now: float) -> Array | None:
        """Return x, y, heading and articulation (4,) of robot and cart at `now` [s]; None: not known."""
        pose, sight = self.whereabouts.pose(now), self.sight(now)
        return None if pose is None or sight is None else np.append(pose, sight.articulation)

    def sight(self, now: float) -> CartSight | None:
        """Return the reading of the cart that is relied upon at `now` [s]: the hands' as long as it can be."""
        readings = [self._sights.get(source) for source in ("hands", "checkerboard")]
        return choose_sight(now, readings, SIGHT_AGE, MISFIT)

    def floor(self, now: float) -> CostField | None:
        """Return costs of the whole floor at `now` [s]; None: no map has come yet."""
        return None if self.whole is None else self._marked(self.whole, now)

    def recover(self, now: float) -> list[Recovery]:
        """Take out of both costmaps what is marked where robot and cart are, and what was seen too seldom."""
        own = self._own(now)
        maps = [each for each in (self.local, self.whole) if each is not None]
        return [step for each in maps for step in (each.clear_inside(own), each.clear_unconfirmed())]

    def forget_unseen(self, now: float, age: float) -> list[Recovery]:
        """Take out of both costmaps what nobody has seen for so long [s]: who stood there may have walked on."""
        return [each.clear_unseen(now, age) for each in (self.local, self.whole) if each is not None]

    def _marked(self, costs: Costmap, now: float) -> CostField:
        """Return a costmap's field with room for shoulders, and with what nothing may enter."""
        return with_kept_out(with_shoulders(costs.field(now), self._static, self._own(now)), self._kept_out)

    def _newest(self) -> CartSight:
        """Return the newest reading of the cart, however old."""
        return max(self._sights.values(), key=lambda each: each.time)

    def _own(self, time: float) -> list[Array]:
        """Return outlines of robot and cart in `map` at a time [s]; none where nothing is known of them."""
        pose, sight = self.whereabouts.pose(time), self.sight(time)
        if pose is None or self.body is None:
            return []
        if sight is None and self._held and self._sights:
            sight = self._newest()
        return self.body.seen_outlines(pose, None if sight is None else sight.pose)

    @hear.register
    def _(self, observation: RobotDescription) -> None:
        self._arms = Pr2Arms(observation.urdf)
        self._laser = self._arms.planar_pose(LASER)

    @hear.register
    def _(self, observation: KnownScene) -> None:
        self.room = observation.room
        self._carts = {body.name: body.footprint for body in observation.bodies if body.movable}
        self._kept_out = [
            placed(body.footprint, body.pose) for body in observation.bodies if body.name.startswith(TOLD)
        ]

    @hear.register
    def _(self, observation: KnownMap) -> None:
        grid = observation.grid
        self._static = StaticMap(grid.cells, grid.resolution, grid.origin)
        self.whole = Costmap.over(self._static, self._settings)

    @hear.register
    def _(self, observation: GraspState) -> None:
        self._held = {hold.gripper: hold.object for hold in observation.holds}
        for name in set(self._held.values()) & set(self._carts):
            self.body = CartBody.of(pr2_with(self._carts[name]))
            self._at_grip[name] = frame_at_grip(self._carts[name])

    @hear.register
    def _(self, observation: JointStates) -> None:
        self._joints = observation

    @hear.register
    def _(self, observation: BaseOdometry) -> None:
        self.whereabouts.moved(observation.time, observation.pose, observation.twist)

    @hear.register
    def _(self, observation: Localisation) -> None:
        self.whereabouts.localised(observation.time, observation.pose)

    @hear.register
    def _(self, observation: CartReading) -> None:
        at_grip = self._at_grip.get(observation.cart)
        if at_grip is not None:
            pose = compose(observation.pose, at_grip)
            self._sights[observation.source] = CartSight(observation.time, observation.source, pose, observation.misfit)

    @hear.register
    def _(self, observation: Scan) -> None:
        pose = self.whereabouts.pose(observation.time)
        if pose is None:
            return
        scan = RangeScan(
            observation.time, observation.angle_min, observation.increment, observation.span, observation.ranges
        )
        own = self._own(observation.time)
        maps = [each for each in (self.local, self.whole) if each is not None]
        if observation.laser == "base":
            self.local.recentre(float(pose[0]), float(pose[1]))
            for costs in maps:
                costs.observe(scan, compose(pose, self._laser), own)
        elif self._arms is not None and self._joints is not None:
            nodding = on_floor(pose) @ self._arms.frame_pose(NODDING, self._joints.names, self._joints.position)
            for costs in maps:
                costs.observe_nodding(scan, nodding, own)
