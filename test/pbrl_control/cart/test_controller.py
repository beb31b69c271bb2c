"""The local controller: it tracks, keeps limits, slows, stops, and says why."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from cart_cases import PATHS, SETTINGS, Costs, assert_within_limits, drive, made, open_floor, pr2_body, straight
from shapely import Polygon

from pbrl_control.cart import (
    ArmState,
    CartController,
    CartLimits,
    CartPlan,
    CartSettings,
    Cause,
    DriveStatus,
    compile_kernels,
)
from pbrl_control.cart.tracking import feedback, room_beside

FLOOR = open_floor()
QUICK = 0.025  # [s] that senses may be late and leave it its full speed: older, and it could not stand within 0.3 s


def outline_at(state: np.ndarray) -> shapely.Geometry:
    return shapely.union_all([Polygon(ring) for ring in pr2_body().outlines(state[:3], float(state[3]))])


@pytest.mark.parametrize("name", PATHS)
def test_it_tracks_within_3_cm_and_2_degrees_despite_noise_and_delay(name: str) -> None:
    controller, world = made(PATHS[name])
    ticks = drive(controller, world, FLOOR, 40.0)
    assert ticks[-1].command.status is DriveStatus.ARRIVED
    # A command moves the robot a tick later, and what it aims at is meant for then.
    off = np.array([after.state - tick.command.goal for tick, after in pairwise(ticks)])
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03
    assert np.abs(off[:, 2:]).max() < math.radians(2.0)
    assert_within_limits(ticks, SETTINGS.limits)
    end = ticks[-1].state - PATHS[name][-1]
    assert np.hypot(*end[:2]) < SETTINGS.tolerance and np.abs(end[2:]).max() < SETTINGS.angle_tolerance


@pytest.mark.parametrize("late", [{"delay": 0.1}, {"delay": 0.0, "lag": 0.0}, {"lag": 0.1}, {"sense_delay": 0.1}])
@pytest.mark.parametrize("name", ["articulated", "reversal"])
def test_delays_that_are_not_those_it_was_told_do_not_make_it_swing(name: str, late: dict) -> None:
    controller, world = made(PATHS[name], **late)
    ticks = drive(controller, world, FLOOR, 40.0)
    assert ticks[-1].command.status is DriveStatus.ARRIVED
    off = np.array([after.state - tick.command.goal for tick, after in pairwise(ticks)])
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03
    assert np.abs(off[:, 2:]).max() < math.radians(2.0)


@pytest.mark.parametrize("seed", range(8))
def test_nothing_is_touched_among_random_things(seed: int) -> None:
    rng, path = np.random.default_rng(seed), list(PATHS.values())[seed % len(PATHS)]
    begin, floor, things = outline_at(path[0]), FLOOR, []
    for place in rng.uniform((-1.0, -1.8), (3.2, 1.8), (14, 2)):
        thing = shapely.box(*(place - 0.02), *(place + 0.02))
        if thing.distance(begin) > 0.1:
            things.append(thing)
            floor = floor.with_box(*thing.bounds)
    controller, world = made(path, noise=np.zeros(4))
    ticks = drive(controller, world, floor, 10.0)
    assert min(outline_at(tick.state).distance(thing) for tick in ticks[::2] for thing in things) > 0.0
    assert_within_limits(ticks, SETTINGS.limits)


@pytest.mark.parametrize("name", ["arc", "articulated"])
def test_wheels_that_slip_and_arms_that_give_way_do_not_lead_it_off(name: str) -> None:
    controller, world = made(PATHS[name], slip=np.array([0.93, 0.93, 0.95, 0.92]))
    ticks = drive(controller, world, FLOOR, 60.0)
    assert ticks[-1].command.status is DriveStatus.ARRIVED
    off = np.array([after.state - tick.command.goal for tick, after in pairwise(ticks)])
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03


def test_errors_die_away_as_those_of_a_critically_damped_oscillator() -> None:
    dt, k = 0.05, 2.5
    error, extra, seen = np.array([0.1, -0.3]), np.zeros(2), []
    for _ in range(60):
        seen.append(error)
        extra = feedback(error, extra, k, dt)
        error = error - dt * extra
    z = math.exp(-k * dt)
    n = np.arange(60)[:, None]
    first = seen[1] / z - seen[0]  # of (a + b n) z^n
    assert np.allclose(seen, (seen[0] + n * first) * z**n, atol=1e-12)
    assert (np.abs(seen[-1]) < 0.01 * np.abs(seen[0])).all()
    assert (np.array(seen)[:, 0] > 0.0).all(), "it does not swing over"


def test_a_moved_and_turned_world_gets_the_same_commands() -> None:
    path, move, turn = PATHS["arc"], np.array([0.5, -0.25]), math.pi / 2
    box = (1.21, 1.31, 1.39, 1.49)
    c, s = math.cos(turn), math.sin(turn)
    other = path.copy()
    other[:, :2] = path[:, :2] @ np.array([[c, s], [-s, c]]) + move
    other[:, 2] += turn
    placed = (move[0] - box[3], move[1] + box[0], move[0] - box[1], move[1] + box[2])
    runs = []
    for way, floor in ((path, FLOOR.with_box(*box)), (other, FLOOR.with_box(*placed))):
        controller, world = made(way, noise=np.zeros(4))
        runs.append(np.array([tick.sent for tick in drive(controller, world, floor, 6.0)]))
    assert np.allclose(runs[0], runs[1], atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_limits_hold_for_random_plans_floors_and_starts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits = CartLimits(
        speed=rng.uniform(0.1, 1.0),
        yaw_rate=rng.uniform(0.1, 1.0),
        articulation_rate=rng.uniform(0.1, 1.0),
        acceleration=rng.uniform(0.2, 2.0),
    )
    settings = CartSettings(limits=limits, delay=0.05, off_path=10.0, off_angle=10.0)
    path = rng.uniform(-0.7, 0.7, (8, 4))
    cells = np.where(rng.random((240, 240)) < 0.0004, 254, 0).astype(np.uint8)
    controller, world = made(path, settings)
    world.state += rng.normal(0, 0.03, 4)
    world.__post_init__()
    ticks = drive(controller, world, Costs(cells), 4.0, lambda w: {"scan_time": w.now - rng.uniform(0.0, 0.2)})
    assert_within_limits(ticks, limits)
    assert all(limits.articulation[0] - 0.05 < tick.state[3] < limits.articulation[1] + 0.05 for tick in ticks)


@pytest.mark.parametrize("name", ["straight", "arc", "aside", "articulated"])
@pytest.mark.parametrize("appears", [0.0, 2.5])
def test_it_stops_before_what_appears_ahead_and_goes_on_when_that_is_gone(name: str, appears: float) -> None:
    path = PATHS[name]
    ring = np.array(outline_at(path[-1]).centroid.coords[0])
    blocked = FLOOR.with_box(*(ring - 0.05), *(ring + 0.05))
    thing = shapely.box(*(ring - 0.05), *(ring + 0.05))

    def floor(now: float) -> Costs:
        return blocked if appears <= now < 7.0 else FLOOR

    controller, world = made(path)
    ticks = drive(controller, world, floor, 40.0)
    assert_within_limits(ticks, SETTINGS.limits)
    while_there = [tick for tick in ticks if appears <= tick.now < 7.0]
    assert min(outline_at(tick.state).distance(thing) for tick in while_there) > 0.0
    last = while_there[-1]
    assert last.command.status is DriveStatus.BLOCKED and last.command.cause is Cause.OBSTACLE
    assert np.abs(last.rates).max() < 0.01
    assert ticks[-1].command.status is DriveStatus.ARRIVED


def test_it_keeps_its_distance_however_often_it_sets_out_anew_before_something_that_flickers(
    rng: np.random.Generator,
) -> None:
    """A laser is off by a cell or two, and whoever waits for the way to get free plans from rest again and again."""
    wall = 0.65 + 0.9 + 0.3  # 0.3 m ahead of the cart
    state = np.zeros(4)

    def floor(now: float) -> Costs:
        near = wall + rng.uniform(0.0, 0.04)
        return FLOOR.with_box(near, -0.1, near + 0.2, 0.1)

    for _ in range(12):
        left = straight(2.0)
        left[:, 0] += state[0]
        controller, world = made(left)
        state = drive(controller, world, floor, 3.0)[-1].state
    gap = wall - (state[0] + 0.65 + 0.9)
    assert SETTINGS.keep - 0.03 < gap < SETTINGS.keep + 0.08, "it goes near, and not nearer"


def test_what_appears_at_the_braking_distance_is_not_touched() -> None:
    settings, limits = SETTINGS, SETTINGS.limits
    controller, world = made(straight(3.0), noise=np.zeros(4), sense_delay=QUICK)
    ticks = drive(controller, world, FLOOR, 3.0)
    speed = ticks[-1].sent[0]
    assert speed == pytest.approx(limits.speed, rel=0.01)
    front = world.state[0] + 0.65 + 0.9
    reaction = settings.period + settings.delay + world.lag + 0.02
    way = speed**2 / (2 * limits.braking) + speed * reaction + settings.margin + FLOOR.resolution
    wall = FLOOR.with_box(front + way, -0.1, front + way + 0.1, 0.1)
    after = drive(controller, world, wall, 2.0)
    assert after[-1].state[0] + 0.65 + 0.9 < front + way
    assert np.abs(after[-1].rates).max() < 0.01


def test_after_its_patience_it_asks_for_a_new_plan() -> None:
    controller, world = made(straight(2.0), SETTINGS.model_copy(update={"patience": 1.0}))
    ticks = drive(controller, world, FLOOR.with_box(2.2, -0.1, 2.4, 0.1), 20.0)
    assert ticks[-1].command.status is DriveStatus.REPLAN
    assert ticks[-1].command.cause is Cause.OBSTACLE
    assert "in the way" in ticks[-1].command.reason and "more than 1 s" in ticks[-1].command.reason


def test_it_is_slower_where_something_is_near_and_not_where_it_is_far() -> None:
    slowest = []
    for gap in (0.03, 0.08, 0.5):
        floor = FLOOR.with_box(0.5, 0.334 + gap, 3.0, 1.5)
        controller, world = made(straight(1.1), noise=np.zeros(4), sense_delay=QUICK)
        ticks = drive(controller, world, floor, 30.0)
        assert ticks[-1].command.status is DriveStatus.ARRIVED
        middle = [tick for tick in ticks if 0.4 < tick.state[0] < 0.7]
        slowest.append(min(tick.sent[0] for tick in middle))
        assert {tick.command.cause for tick in middle} == {Cause.NEAR if gap < 0.15 else Cause.NONE}
    assert slowest[0] < 0.6 * slowest[2] and slowest[0] < slowest[1] < slowest[2]


def test_something_marked_inside_the_footprint_is_said_to_be_there() -> None:
    controller, world = made(straight(2.0))
    ticks = drive(controller, world, FLOOR.with_box(1.0, 0.0, 1.02, 0.02), 1.0)
    assert all(tick.command.status is DriveStatus.BLOCKED for tick in ticks)
    assert {tick.command.cause for tick in ticks} == {Cause.FOOTPRINT}
    assert not np.any([tick.sent for tick in ticks])


def test_however_fast_it_may_go_it_only_goes_as_fast_as_it_can_stop() -> None:
    fast = SETTINGS.model_copy(update={"limits": CartLimits(speed=1.0)})
    controller, world = made(straight(2.5), fast)
    ticks = drive(controller, world, FLOOR, 8.0)
    most = fast.limits.braking * (fast.stop_within - 0.02 - fast.period - fast.delay)
    assert max(tick.sent[0] for tick in ticks) <= most + 1e-9


def test_unknown_floor_blocks_only_where_it_is_told_to() -> None:
    unknown = Costs(np.where(np.arange(320)[None] * 0.025 - 3.0 > 2.0, 255, 0).repeat(320, 0).astype(np.uint8))
    for blocks, status in ((False, DriveStatus.ARRIVED), (True, DriveStatus.BLOCKED)):
        chosen = SETTINGS.model_copy(update={"unknown_blocks": blocks, "patience": 100.0})
        controller, world = made(straight(1.0), chosen)
        assert drive(controller, world, unknown, 8.0)[-1].command.status is status


def test_kernels_are_compiled_without_a_robot() -> None:
    compile_kernels(SETTINGS)


def test_a_plan_of_one_pose_is_done_at_once() -> None:
    controller, world = made(np.zeros((1, 4)))
    assert drive(controller, world, FLOOR, 1.0)[-1].command.status is DriveStatus.ARRIVED


def test_the_next_plan_takes_over_on_the_way() -> None:
    controller, world = made(straight(2.0), noise=np.zeros(4))
    last = drive(controller, world, FLOOR, 3.0)[-1]
    here = np.array([*world.state])
    path = straight(1.0) + here
    plan = CartPlan.timed(path, SETTINGS.limits, SETTINGS.share, last.sent)
    following = CartController(plan, pr2_body(), SETTINGS, last.sent)
    ticks = drive(following, world, FLOOR, 20.0)
    assert ticks[-1].command.status is DriveStatus.ARRIVED
    assert max(math.hypot(*tick.command.error[:2]) for tick in ticks) < 0.005
    assert np.abs(ticks[0].sent - last.sent).max() <= SETTINGS.limits.braking * 0.05 + 1e-9


@pytest.mark.parametrize("off", [(0.0, 0.019, 0.0, 0.0), (0.0, 0.0, 0.02, 0.0), (-0.015, -0.01, 0.0, 0.0)])
def test_errors_die_away_at_full_speed_too(off: tuple[float, ...]) -> None:
    controller, world = made(straight(4.0), noise=np.zeros(4))
    drive(controller, world, FLOOR, 4.0)
    world.state = world.state + np.array(off)
    ticks = drive(controller, world, FLOOR, 3.0)
    assert np.abs(ticks[-1].command.error).max() < 0.003
    assert min(tick.command.pace for tick in ticks) > 0.9


def test_the_plan_leaves_room_for_what_corrects_errors(rng: np.random.Generator) -> None:
    speeds = SETTINGS.limits.speeds
    for _ in range(200):
        planned, extra = rng.normal(0.0, 0.3, (2, 4))
        share = room_beside(planned, extra, speeds)
        assert 0.0 <= share <= 1.0
        sizes = [
            np.array([math.hypot(*rates[:2]), *np.abs(rates[2:])])
            for rates in (extra + share * planned, extra + min(1.0, share + 1e-3) * planned, extra)
        ]
        assert (sizes[0] <= speeds + 1e-9).all() or (sizes[2] > speeds).any()
        assert share == 1.0 or (sizes[1] > speeds).any() or (sizes[2] > speeds).any()


def test_arms_that_cannot_follow_hold_the_base_back() -> None:
    rng = np.random.default_rng(2)
    speed = np.full((2, 7), 0.05)
    arms = ArmState(rng.normal(size=(2, 6, 7)), np.zeros((2, 7)), np.full((2, 7), -2.0), np.full((2, 7), 2.0), speed)
    runs = {}
    for name, given in (("weak", arms), ("strong", dataclasses.replace(arms, speed=100.0 * speed))):
        controller, world = made(PATHS["articulated"], noise=np.zeros(4))
        ticks = drive(controller, world, FLOOR, 60.0, lambda w, given=given: {"arms": given, "arms_time": w.now})
        assert ticks[-1].command.status is DriveStatus.ARRIVED
        assert all((np.abs(tick.command.joint_rates) <= given.speed + 1e-9).all() for tick in ticks)
        off = np.array([tick.state - tick.command.goal for tick in ticks])
        assert np.abs(off[:, 2:]).max() < math.radians(5.0)
        runs[name] = ticks[-1].now
    assert runs["weak"] > 1.5 * runs["strong"]
