"""Recordings of pushed furniture without a robot: a hand takes an edge, pushes, lets go, takes the next.

A push of 20 s costs about a second of one core. Same scene, pushes and seed: same recording, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from shapely.geometry import LinearRing, Point

from bullet_sim.catalogue import Fixture
from bullet_sim.client import STEP, BulletClient
from bullet_sim.concealed.options import GRIPPERS
from bullet_sim.concealed.sensing import tag_camera, wrist_sensor
from bullet_sim.errors import SimError, nearest
from bullet_sim.furniture import Furniture
from bullet_sim.hand import Hand, HandSpec
from bullet_sim.hand_recording import (
    Activity,
    BodyTrack,
    GraspChange,
    HandPush,
    HandRecording,
    Limits,
    TagTrack,
    WrenchTrack,
)
from bullet_sim.scene import Scene
from bullet_sim.sensors import TagReading, Ticker, WristReading
from bullet_sim.world import World

Array = NDArray[np.float64]
Heard = Callable[[float, WristReading | None, list[TagReading], tuple[GraspChange, ...]], None]
"""(time [s], reading of the wrist if there is one, readings of tags, changes of what is held)."""

STANDING = 1.2
"""[s] with open plates before each grasp: the sensor's weight and bias are read then."""

HOLDING = 0.5
"""[s] for which the hand keeps its place after a path."""

CARRYING = 1.5
"""[s] on the way to the next grasp."""

AFTERWARDS = 0.5
"""[s] after the last release, so that tags that are under way arrive."""

TRUTH_RATE = 100.0
"""[Hz] of what is kept for scoring."""

LONGEST = 600.0
"""[s] of simulated time."""

FALLEN = math.radians(20.0)
"""[rad] off level from which a body has tipped over."""


def push_by_hand(
    scene: Scene,
    pushes: Sequence[HandPush],
    *,
    seed: int,
    hand: HandSpec | None = None,
    side: str = "left",
    step: float = STEP,
    limits: Limits | None = None,
) -> HandRecording:
    """Push bodies of a scene by hand, one grasp after the other, and record it.

    Args:
        scene: what stands in the room, what is concealed and what the sensors are like; its robot is left out.
        pushes: what to do.
        seed: of world and sensors, which draw from streams of their own.
        hand: what the hand is like.
        side: which gripper it plays.
        step: physics step [s].
        limits: at which a push is given up, which the status says; None: none.

    Raises:
        SimError: no pushes, an unknown body or gripper, a contact far from the body, or a scene that cannot be built.
    """
    check_pushes(scene, pushes, side)
    world_seed, sensor_seed = np.random.SeedSequence(seed).spawn(2)
    with BulletClient(step=step) as client:
        world = World(client, scene, np.random.default_rng(world_seed))
        run = HandRun(world, pushes[0], hand or HandSpec(), side, np.random.default_rng(sensor_seed))
        run.limits = limits
        status = run.perform(pushes)
        return run.recording(status)


def check_pushes(scene: Scene, pushes: Sequence[HandPush], side: str = "left") -> None:
    """Raise SimError where pushes do not fit a scene."""
    if side not in GRIPPERS:
        raise SimError(f"hand: expected a gripper 'left' or 'right', got {side!r}")
    if not pushes:
        raise SimError("hand: expected at least one push, got none")
    for push in pushes:
        if push.body not in scene.bodies:
            raise SimError(f"hand: no body {push.body!r} in scene {scene.name}; {nearest(push.body, scene.bodies)}")
        if isinstance(scene.bodies[push.body], Fixture):
            raise SimError(f"hand: expected a body that can move, {push.body!r} is built in")
        away = LinearRing(scene.bodies[push.body].footprint).distance(Point(push.contact))
        if not away < 0.05:
            raise SimError(
                f"hand: expected a contact within 5 cm of the outline of {push.body!r}, got {list(push.contact)}, "
                f"{away:.2f} m away"
            )
    total = sum(push.path.duration for push in pushes)
    if total > LONGEST:
        raise SimError(f"hand: expected at most {LONGEST:.0f} s of pushes, got {total:.0f} s")


def edge_grasp(body: Furniture, contact: tuple[float, float], depth: float) -> tuple[float, float, float]:
    """Give where a hand takes an edge: (x, y) [m] of the middle of the patch, and its approach [rad], body's frame.

    Args:
        body: with edges.
        contact: (2,) [m] near its outline.
        depth: of edge between the plates [m].
    """
    outline = body.slab_at(np.array([*contact, 0.0])).outline
    ends = np.roll(outline, -1, axis=0)
    along = ends - outline
    share = np.clip(np.sum((np.array(contact) - outline) * along, 1) / np.sum(along**2, 1), 0.0, 1.0)
    places = outline + share[:, None] * along
    number = int(np.argmin(np.hypot(*(places - contact).T)))
    inwards = np.array([-along[number, 1], along[number, 0]]) / np.hypot(*along[number])
    x, y = places[number] + depth / 2 * inwards
    return float(x), float(y), math.atan2(inwards[1], inwards[0])


class HandRun:
    """One recording in the making.

    Args:
        world: the scene.
        first: push to come, beside whose grasp the hand begins.
        spec: what the hand is like.
        side: which gripper it plays.
        rng: of the sensors.
        heard: called after every physics step with the readings that came, and with changes of the grasp.

    Attributes:
        limits: at which a push is given up; None: none.
    """

    limits: Limits | None = None

    def __init__(
        self, world: World, first: HandPush, spec: HandSpec, side: str, rng: Generator, heard: Heard | None = None
    ) -> None:
        camera_rng, wrist_rng = rng.spawn(2)
        self._world, self._spec, self._side, self._heard = world, spec, side, heard
        self._camera = tag_camera(world.scene, camera_rng)
        self._wrist = wrist_sensor(world.scene, side, wrist_rng, world.client.step_time)
        *place, height = self._grasp_place(first)
        self._hand = Hand(world.client, spec, (place[0], place[1], place[2]), height)
        self._tagged = [name for name, body in world.scene.bodies.items() if not isinstance(body, Fixture)]
        self._truth = Ticker(TRUTH_RATE)
        self._grasps = [GraspChange(0.0, None, np.zeros(3))]
        self._readings: list[WristReading] = []
        self._seen: list[tuple[float, TagReading]] = []
        self._times: list[float] = []
        self._poses: dict[str, list[Array]] = {name: [] for name in world.furniture}
        self._pushed: list[tuple[float, ...]] = []
        self._acts: list[list[tuple[bool, float]]] = [[] for _ in world.effects]
        self._slipped = 0.0
        self._told = 0

    def _grasp_place(self, push: HandPush) -> tuple[float, float, float, float]:
        """Give where the hand takes a body (x, y, yaw, height) as the body stands now."""
        body = self._world.find(push.body)
        if not body.slabs:
            raise SimError(f"hand: expected a body with an edge to take, {push.body!r} has none")
        x, y, approach = edge_grasp(body, push.contact, self._spec.depth)
        pose, slab = body.pose(), body.slab_at(np.array([x, y, 0.0]))
        place = pose.point([x, y, 0.0])
        height = float(pose.position[2]) + (slab.top + slab.bottom) / 2
        return float(place[0]), float(place[1]), pose.yaw + approach, height

    def perform(self, pushes: Sequence[HandPush]) -> str:
        """Do one push after the other; give the status."""
        for number, push in enumerate(pushes):
            if number:
                self._carry(push)
                self._stand(STANDING, beside=push)
            else:
                # On a slope, or on a taut cord, it would be gone before the hand takes it.
                self._world.find(push.body).park()
                self._stand(STANDING)
            lost = self._push(push)
            if lost:
                self._stand(AFTERWARDS)
                return lost
        self._stand(AFTERWARDS)
        return self._fallen() or "done"

    def one_more(self, push: HandPush) -> str:
        """Do one push, all bodies kept in their places before and after; give the status.

        Nobody lets go of a table on a slope for as long as it takes to think about the next push.
        """
        bodies = [self._world.find(name) for name in self._tagged]
        for body in bodies:
            body.park()
        if self._readings:
            self._carry(push)
        self._stand(STANDING)
        for body in bodies:
            body.unpark()
        lost = self._push(push)
        for body in () if lost else bodies:
            body.park()
        self._stand(AFTERWARDS)
        return lost or self._fallen() or "done"

    def _stand(self, seconds: float, *, beside: HandPush | None = None) -> None:
        """Stand, or keep beside an edge that may still drift, so that it is between the plates when they close."""
        for _ in range(round(seconds / self._world.client.step_time)):
            if beside is not None:
                self._hand.put(*self._grasp_place(beside))
            self._step(0.0, 0.0, 0.0)

    def _carry(self, push: HandPush) -> None:
        """Bring the open hand to the next grasp, along a straight line and softly."""
        start = np.array([self._hand.x, self._hand.y, self._hand.yaw, self._hand.height])
        steps = round(CARRYING / self._world.client.step_time)
        turned = 0.0
        for number in range(1, steps + 1):
            share = number / steps
            share = share * share * (3 - 2 * share)
            way = np.array(self._grasp_place(push)) - start
            # As before, not the shorter way each time: half a turn would be one way now and the other a moment later.
            turned += (way[2] - turned + math.pi) % (2 * math.pi) - math.pi
            way[2] = turned
            self._hand.put(*(start + share * way).tolist())
            self._step(0.0, 0.0, 0.0)

    def _push(self, push: HandPush) -> str:
        """Take a body, follow the path, let go; give a sentence where the grasp is lost."""
        world, hand = self._world, self._hand
        world.find(push.body).unpark()
        contact = hand.hold(world.find(push.body), world.plates(self._spec.gripper, push.body))
        began = world.client.time
        slab = world.find(push.body).slab_at(np.array([*contact, 0.0]))
        self._grasps.append(GraspChange(began, push.body, np.array([*contact, (slab.top + slab.bottom) / 2])))
        lost = ""
        for number in range(round((push.path.duration + HOLDING) / world.client.step_time)):
            self._step(*push.path.at(number * world.client.step_time, hand.yaw))
            if hand.is_out():
                lost = f"the hand lost {push.body} at t = {world.client.time:.2f} s; push more gently"
            lost = lost or self._beyond(push.body)
            if lost:
                break
        self._slipped += hand.slipped
        hand.release()
        self._grasps.append(GraspChange(world.client.time, None, np.zeros(3)))
        return lost

    def _beyond(self, body: str) -> str:
        """Say which limit is passed, or nothing."""
        if self.limits is None or not self._times or not self._readings:
            return ""
        slipped = self._slipped + self._hand.slipped
        return self.limits.passed(body, self._poses[body][-1][3:], slipped, self._readings[-1])

    def _step(self, vx: float, vy: float, spin: float) -> None:
        """Advance by one physics step, and read the sensors."""
        world, hand = self._world, self._hand
        hand.step(vx, vy, spin)
        world.step()
        time = world.client.time
        reading = self._wrist.measure(time, *hand.wrist_wrench(world.gravity))
        if reading is not None:
            self._readings.append(reading)
        if self._camera.capture_due(time):
            tags = {name: world.pose(name) for name in self._tagged}
            tags[f"{self._side}_gripper"] = hand.sensor_pose()
            self._camera.capture(time, tags)
        arrived = self._camera.deliver(time)
        self._seen += [(time, seen) for seen in arrived]
        if self._heard is not None:
            self._heard(time, reading, arrived, tuple(self._grasps[self._told :]))
            self._told = len(self._grasps)
        if self._truth.due(time):
            self._keep_truth(time)

    def _keep_truth(self, time: float) -> None:
        hand = self._hand
        self._times.append(time)
        for name, body in self._world.furniture.items():
            pose, twist = body.state()
            row = [pose.position[0], pose.position[1], pose.yaw, twist.linear[0], twist.linear[1], twist.angular[2]]
            self._poses[name].append(np.array(row))
        self._pushed.append((*hand.force, hand.torque, hand.x, hand.y))
        for acts, effect in zip(self._acts, self._world.effects, strict=True):
            acts.append((effect.acting(), effect.strength()))

    def _fallen(self) -> str:
        """Say which body tipped over, or nothing."""
        for name in self._world.furniture:
            off = math.acos(max(-1.0, min(1.0, float(self._world.pose(name).matrix[2, 2]))))
            if off > FALLEN:
                return f"{name} tipped over, it ends {math.degrees(off):.0f} degrees off level; push it more gently"
        return ""

    def recording(self, status: str) -> HandRecording:
        """Put everything together."""
        time = np.array(self._times)
        bodies = {}
        for name, rows in self._poses.items():
            table = np.array(rows)
            table[:, 2] = np.unwrap(table[:, 2])
            bodies[name] = BodyTrack(time, table[:, :3], table[:, 3:])
        activities = {}
        for effect, acts in zip(self._world.effects, self._acts, strict=True):
            acting, strength = np.array([act[0] for act in acts]), np.array([act[1] for act in acts], dtype=float)
            activities[effect.key] = Activity(effect.name, effect.target, effect.unit, time, acting, strength)
        return HandRecording(
            side=self._side,
            wrench=WrenchTrack(
                np.array([reading.stamp for reading in self._readings]),
                np.array([reading.force for reading in self._readings]).reshape(-1, 3),
                np.array([reading.torque for reading in self._readings]).reshape(-1, 3),
            ),
            tags={name: self._tag_track(name) for name in (*self._tagged, f"{self._side}_gripper")},
            grasps=tuple(self._grasps),
            seconds=self._world.client.time,
            status=status,
            bodies=bodies,
            pushed=np.array(self._pushed),
            activities=activities,
            slipped=self._slipped,
        )

    def _tag_track(self, name: str) -> TagTrack:
        rows = [(arrival, reading) for arrival, reading in self._seen if reading.name == name]
        return TagTrack(
            np.array([reading.stamp for _, reading in rows]),
            np.array([arrival for arrival, _ in rows]),
            np.array([reading.position for _, reading in rows]).reshape(-1, 3),
            np.array([reading.quaternion for _, reading in rows]).reshape(-1, 4),
        )
