"""The follower against a plane object that moves as its constraints allow, seen late, seldom and with noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.twist import achievable_twist
from pbrl_control.percept import Tag
from pbrl_control.planar import compose, inverse, shift
from pbrl_control.trajectories.follower import FollowCommand, FollowState, TrajectoryFollower
from pbrl_control.trajectories.trajectory import MotionLimits, ObjectTrajectory, move
from pbrl_control.trajectories.trajectory_plan import AbortLimits
from pbrl_control.types import PlanarTwist
from pbrl_model.parameters import BodyParameters

DT = 0.02
TABLE = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])
CASTER = np.array([-0.315, -0.69])
FREE = ObjectModel.uniform(BodyParameters(mass=33.0, mu_ground=0.03), TABLE)
LOCKED = ObjectModel.uniform(
    BodyParameters(mass=33.0, wheel_x=CASTER[0], wheel_y=CASTER[1], mu_x=0.175, mu_y=0.175, mu_ground=0.03), TABLE
)
GRIPS = {"left": np.array([-0.355, 0.16]), "right": np.array([-0.355, -0.16])}
START = np.array([1.19, -0.25, 0.3])
LIMITS = MotionLimits()


def straight(way: tuple[float, float, float] = (0.5, 0.0, 0.0)) -> ObjectTrajectory:
    return ObjectTrajectory.through(START, [compose(START, np.array(way))], LIMITS)


@dataclass
class Plant:
    """An object that moves at a share of the commanded twist, as its constraints let it; its tag comes late."""

    model: ObjectModel = FREE
    share: float = 1.0
    delay: int = 0
    noise: np.ndarray = field(default_factory=lambda: np.zeros(3))
    period: int = 1
    pose: np.ndarray = field(default_factory=START.copy)

    def __post_init__(self) -> None:
        self.past: list[tuple[float, np.ndarray]] = []
        self.fought = 0.0

    def step(self, twist: PlanarTwist) -> None:
        answer = achievable_twist(self.model, twist)
        self.fought = max(self.fought, answer.refused_speed)
        self.pose = move(self.pose, self.share * DT * answer.twist.array())

    def tag(self, now: float, rng: np.random.Generator) -> Tag | None:
        if len(self.past) % self.period == 0:
            self.seen = self.pose + rng.normal(size=3) * self.noise
            self.seen_at = now
        self.past.append((self.seen_at, self.seen))
        if len(self.past) <= self.delay:
            return None
        time, pose = self.past[-1 - self.delay]
        return make_tag(time, pose)


def make_tag(time: float, pose: np.ndarray) -> Tag:
    half = pose[2] / 2
    return Tag(time, np.array([*pose[:2], 0.78]), np.array([0.0, 0.0, math.sin(half), math.cos(half)]))


def run(
    follower: TrajectoryFollower, plant: Plant, rng: np.random.Generator, until: float = 90.0
) -> tuple[FollowCommand, list[FollowCommand], float]:
    history = []
    for tick in range(int(until / DT)):
        command = follower.tick(tick * DT, plant.tag(tick * DT, rng), {"left": 5.0})
        history.append(command)
        if command.finished:
            break
        plant.step(command.twist)
    return command, history, tick * DT


def error(plant: Plant, pose: np.ndarray) -> tuple[float, float]:
    off = compose(inverse(plant.pose), pose)
    return float(np.hypot(*off[:2])), abs(float(off[2]))


def paths(rng: np.random.Generator) -> list[ObjectTrajectory]:
    """Return straight ones, sideways ones, arcs and turns in place, five of each."""
    size, sign = rng.uniform(0.3, 1.2, size=20), rng.choice([-1.0, 1.0], size=20)
    ways = [
        lambda s: np.array([s, 0.0, 0.0]),
        lambda s: np.array([0.0, s, 0.0]),
        lambda s: np.array([abs(s), 0.0, s]),
        lambda s: np.array([0.0, 0.0, s]),
    ]
    return [ObjectTrajectory(START, ways[k % 4](size[k] * sign[k])[None], LIMITS) for k in range(20)]


def test_twenty_paths_seen_late_and_noisily_end_where_they_should(rng: np.random.Generator) -> None:
    """Tags of 3 mm and 0.5 deg at 17 Hz, 80 ms late; an object that falls 10 % short of each command."""
    for path in paths(rng):
        plant = Plant(share=0.9, delay=4, period=3, noise=np.array([0.003, 0.003, math.radians(0.5)]))
        command, _, time = run(TrajectoryFollower(path, model=FREE, contacts=GRIPS), plant, rng)
        assert command.state == FollowState.DONE, command.status
        distance, yaw = error(plant, path.end)
        assert distance < 0.015
        assert yaw < math.radians(1.0)
        assert time < 1.5 * path.duration + 5.0


def test_a_perfect_object_keeps_time_and_ends_within_tolerance(rng: np.random.Generator) -> None:
    path, plant = straight(), Plant()
    command, history, time = run(TrajectoryFollower(path), plant, rng)
    assert command.state == FollowState.DONE
    assert command.progress == 1.0
    assert command.final_error[0] < 0.008
    assert time < path.duration + 2.0
    steps = np.diff([each.twist.array() for each in history[:-1]], axis=0)
    assert np.hypot(steps[:, 0], steps[:, 1]).max() <= 0.3 * DT + 1e-12


def test_what_the_body_could_not_do_is_not_summed_up(rng: np.random.Generator) -> None:
    """A body that did nothing for two seconds: afterwards the object is not shot past its goal."""

    def ends_at(said: float) -> float:
        follower, plant = TrajectoryFollower(straight((0.3, 0.0, 0.0)), limits=AbortLimits(stall_time=10.0)), Plant()
        past = 0.0
        for tick in range(int(30.0 / DT)):
            stands = 0.5 < tick * DT < 2.5
            command = follower.tick(tick * DT, plant.tag(tick * DT, rng), {}, said if stands else 1.0)
            if command.finished:
                break
            plant.step(PlanarTwist() if stands else command.twist)
            past = max(past, float(compose(inverse(START), plant.pose)[0]) - 0.3)
        assert command.state == FollowState.DONE
        return past

    told, untold = ends_at(0.0), ends_at(1.0)
    assert told < 0.5 * untold


def test_the_setpoint_waits_for_a_slow_object(rng: np.random.Generator) -> None:
    path, plant = straight(), Plant(share=0.5)
    command, history, time = run(TrajectoryFollower(path), plant, rng)
    assert command.state == FollowState.DONE, command.status
    assert time > 1.3 * path.duration
    assert max(float(np.hypot(*each.error[:2])) for each in history) < 0.07
    assert error(plant, path.end)[0] < 0.02


def test_a_late_camera_is_no_slow_object(rng: np.random.Generator) -> None:
    times = [run(TrajectoryFollower(straight()), Plant(delay=delay), rng)[2] for delay in (0, 5)]
    assert times[1] - times[0] < 0.5


def test_with_the_model_a_locked_wheel_is_not_fought(rng: np.random.Generator) -> None:
    known, unknown = Plant(LOCKED), Plant(LOCKED)
    follower = TrajectoryFollower(straight(), model=LOCKED, contacts=GRIPS)
    command, _, _ = run(follower, known, rng)
    assert command.state == FollowState.DONE, command.status
    assert known.fought < 1e-9
    assert "its constraints let it end" in command.status
    assert command.final_error[0] < 0.01
    fights = run(TrajectoryFollower(straight()), unknown, rng)[0]
    assert fights.state == FollowState.ABORTED
    assert "stall" in fights.status
    assert unknown.fought > 0.05


def test_turning_about_a_locked_caster_ends_where_it_should(rng: np.random.Generator) -> None:
    about = shift(np.array([0.0, 0.0, -0.18]), -CASTER)
    path = ObjectTrajectory.of_twists(START, about[None], np.array([3.0]), LIMITS)
    plant = Plant(LOCKED, share=0.95, delay=4, period=3, noise=np.array([0.003, 0.003, 0.008]))
    follower = TrajectoryFollower(path, model=LOCKED, contacts=GRIPS)
    command, _, _ = run(follower, plant, rng)
    assert command.state == FollowState.DONE, command.status
    assert plant.fought < 1e-9
    assert np.abs(follower.detour).max() < 1e-3
    distance, yaw = error(plant, path.end)
    assert distance < 0.02
    assert yaw < math.radians(1.5)


def ticks(follower: TrajectoryFollower, change: Callable[[float], tuple[Tag | None, dict]], until: float = 9.0):
    """Drive a follower with a perfect object for 2 s, then with what `change` gives at each moment."""
    plant, rng = Plant(), np.random.default_rng(1)
    for tick in range(int(until / DT)):
        now = tick * DT
        tag, forces = (plant.tag(now, rng), {"left": 5.0}) if now < 2.0 else change(now)
        command = follower.tick(now, tag, forces)
        if command.finished:
            return command, now
        plant.step(command.twist)
    return command, now


HERE = make_tag(0.0, START)
HOSTILE = {
    "nan tag": (lambda now: (make_tag(now, np.full(3, math.nan)), {}), "NaN or infinity", 0.0),
    "lost tag": (lambda now: (make_tag(1.9, START), {}), "last seen 1.0 s ago", 0.92),
    "no tag": (lambda now: (None, {}), "lost tag: expected one", 0.0),
    "clock": (lambda now: (make_tag(now + 60.0, START), {}), "60.0 s ahead", 0.0),
    "nan force": (lambda now: (make_tag(now, START), {"left": math.nan}), "force at left", 0.0),
    "force": (lambda now: (make_tag(now, START), {"left": 5.0, "right": 90.0}), "unexpected force at right: 90 N", 0.2),
    "stuck": (lambda now: (make_tag(now, START), {}), "stall: commanded for 3.", 3.0),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_it_stops_with_a_reason(case: str) -> None:
    change, reason, after = HOSTILE[case]
    follower = TrajectoryFollower(straight((1.0, 0.0, 0.0)), model=FREE, contacts=GRIPS)
    command, when = ticks(follower, change)
    assert command.state == FollowState.ABORTED
    assert reason in command.status
    assert "\n" not in command.status
    assert not command.twist.moves()
    assert when - 2.0 == pytest.approx(after, abs=0.7 if case == "stuck" else 2 * DT)
    again = follower.tick(when + DT, HERE, {})
    assert again.state == FollowState.ABORTED
    assert again.status == command.status


def test_a_knock_is_no_reason() -> None:
    follower = TrajectoryFollower(straight(), model=FREE, contacts=GRIPS)
    plant, rng = Plant(), np.random.default_rng(1)
    for tick in range(150):
        force = 200.0 if 100 <= tick < 108 else 5.0
        command = follower.tick(tick * DT, plant.tag(tick * DT, rng), {"left": force})
        plant.step(command.twist)
    assert command.state == FollowState.FOLLOWING


def test_force_limits_are_those_of_the_thesis_or_of_the_file() -> None:
    limits = AbortLimits(force_floor=0.0)
    known = TrajectoryFollower(straight(), limits=limits, model=FREE, contacts=GRIPS)
    assert known.expected_force == pytest.approx((33.0 * 0.15 + 0.03 * 33.0 * 9.81) / 2, rel=1e-3)
    assert known.force_limit == pytest.approx(1.5 * known.expected_force)
    assert TrajectoryFollower(straight(), limits=limits).force_limit == limits.force


def test_time_out(rng: np.random.Generator) -> None:
    limits = AbortLimits(time_ratio=1.0)
    command, _, _ = run(TrajectoryFollower(straight((2.0, 0.0, 0.0)), limits=limits), Plant(share=0.3), rng)
    assert command.state == FollowState.ABORTED
    assert "time-out" in command.status
    assert "% of the way" in command.status


def test_a_static_object_is_not_even_touched(rng: np.random.Generator) -> None:
    heavy = ObjectModel.uniform(BodyParameters(mass=400.0, mu_ground=0.5), TABLE)
    command, _, time = run(TrajectoryFollower(straight(), model=heavy, contacts=GRIPS), Plant(heavy), rng)
    assert command.state == FollowState.ABORTED
    assert command.status.startswith("static object: moving it takes")
    assert time == 0.0


def test_it_waits_for_the_first_tag_and_then_gives_up() -> None:
    follower = TrajectoryFollower(straight())
    assert follower.tick(5.0, None).state == FollowState.WAITING
    assert not follower.tick(5.5, None).twist.moves()
    assert follower.tick(6.1, None).state == FollowState.ABORTED


@pytest.mark.parametrize("now", [math.nan, math.inf, -0.1])
def test_a_time_that_is_none_stops_it(now: float) -> None:
    follower = TrajectoryFollower(straight())
    follower.tick(0.0, HERE)
    command = follower.tick(now, HERE)
    assert command.state == FollowState.ABORTED
    assert command.status.startswith("time: expected")


def test_after_missed_ticks_the_setpoint_does_not_leap(rng: np.random.Generator) -> None:
    follower, plant = TrajectoryFollower(straight()), Plant()
    for tick in range(100):
        command = follower.tick(tick * DT, plant.tag(tick * DT, rng))
        plant.step(command.twist)
    late = follower.tick(3.5, make_tag(3.5, plant.pose))
    assert late.state == FollowState.FOLLOWING
    assert (late.progress - command.progress) * follower.trajectory.duration <= 0.1 + 1e-9


def test_same_percepts_same_commands(rng: np.random.Generator) -> None:
    noise = np.array([0.003, 0.003, 0.008])
    runs = [
        run(TrajectoryFollower(straight(), model=FREE), Plant(noise=noise), np.random.default_rng(3))[1]
        for _ in range(2)
    ]
    assert [each.twist for each in runs[0]] == [each.twist for each in runs[1]]
