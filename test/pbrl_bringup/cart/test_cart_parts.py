"""What the drive with a cart is put together from: whereabouts, outlines, starts, routes, kept legs."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bringup.cart.along import AHEAD, onward, rest
from pbrl_bringup.cart.outcome import CartOutcome, Score, Touch, Trace
from pbrl_bringup.cart_run import CartRun
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments import cart_desks
from pbrl_bringup.experiments.cart_office import TILT, leg_of, route, rows_of, scene_of
from pbrl_bringup.experiments.kept import keep_run, read_run
from pbrl_control.cart import CartBody, CartCommand, Cause, DriveStatus
from pbrl_control.cart.whereabouts import Whereabouts
from pbrl_control.planar import compose, inverse, wrap
from pbrl_planner.cart.navigator import PATIENCE, Answer, Navigator, PlannerCall, free_start, grid_of, with_room
from pbrl_planner.cart.outline import ARTICULATION, GRIP, frame_at_grip, motions, pr2_with
from pbrl_planner.cart.settings import load_cart
from pbrl_planner.cart.shoulders import BEYOND, with_shoulders
from pbrl_planner.costmap import LETHAL, CostField, Recovery, StaticMap
from pbrl_planner.lattice import Lattice, LatticePlan, LatticeProblem, plan
from pr2_cart_sim.scene import load_office
from pr2_cart_sim.sensor_settings import TiltLaserSettings


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


TOLD = load_cart().navigation
CART = np.array([[-0.5, -0.275], [0.5, -0.275], [0.5, 0.275], [-0.5, 0.275]])


def driven(scale: float, jitter: float, rng: np.random.Generator) -> tuple[Whereabouts, list[np.ndarray], list]:
    """A way of 20 s, odometry that is off by `scale`, a localiser that jitters; and what was believed and true."""
    found, true, odom = Whereabouts(), np.array([3.0, -2.0, 0.7]), np.zeros(3)
    beliefs, truths = [], []
    for k in range(1000):
        time = 0.02 * k
        twist = np.array([0.3, 0.05, 0.3 * math.sin(0.5 * time)])
        found.moved(time, odom, scale * twist)
        if k % 5 == 0:
            found.localised(time, true + jitter * rng.normal(size=3))
        beliefs.append(found.pose(time))
        truths.append(true)
        true, odom = compose(true, 0.02 * twist), compose(odom, 0.02 * scale * twist)
    return found, beliefs, truths


def test_a_perfect_localiser_is_believed(rng: np.random.Generator) -> None:
    _, beliefs, truths = driven(1.0, 0.0, rng)
    off = np.array([np.append(a[:2] - b[:2], wrap(a[2] - b[2])) for a, b in zip(beliefs, truths, strict=True)])
    assert np.abs(off).max() < 1e-9


def test_drift_is_led_back_and_jitter_is_smoothed(rng: np.random.Generator) -> None:
    _, beliefs, truths = driven(1.02, 0.01, rng)
    off = np.array([np.append(a[:2] - b[:2], wrap(a[2] - b[2])) for a, b in zip(beliefs, truths, strict=True)])[100:]
    assert np.abs(off).max() < 0.02, "without a localiser the last place would be 0.1 m off"
    steps = np.hypot(*np.diff(np.array(beliefs)[100:, :2], axis=0).T)
    assert steps.max() < 0.02 * 0.31 + 0.006, "a tenth of a correction at a time"


def test_between_odometry_readings_it_goes_on_evenly() -> None:
    found = Whereabouts()
    assert found.pose(0.0) is None
    for k in range(3):
        found.moved(0.1 * k, np.array([0.1 * k, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    assert found.pose(0.2) is None, "no localiser has spoken"
    found.localised(0.2, np.array([5.0, 1.0, math.pi / 2]))
    assert np.allclose(found.pose(0.15), [5.0, 0.95, math.pi / 2])
    assert np.allclose(found.pose(0.25), [5.0, 1.05, math.pi / 2])


def test_the_planners_outlines_contain_the_real_ones() -> None:
    real, planned = pr2_with(CART), pr2_with(CART, 0.04)
    poses = np.array([[0.0, 0.0, 0.3, phi] for phi in np.linspace(-ARTICULATION, ARTICULATION, 5)])
    for pose in poses:
        a, b = real.area(pose[None]), planned.area(pose[None])
        both = pr2_with(CART, 0.04).mask(pose[None], 0.025)
        alone = real.mask(pose[None], 0.025)
        middle, r = len(both) // 2, len(alone) // 2
        assert a < b and not (alone & ~both[middle - r : middle + r + 1, middle - r : middle + r + 1]).any()


def test_the_bar_is_at_the_grip() -> None:
    cart_in_base = compose(np.array([*GRIP, 0.0]), inverse(frame_at_grip(CART)))
    assert cart_in_base == pytest.approx([0.65 + 0.484, 0.0, 0.0])


def free_field(rows: int = 80, columns: int = 120) -> CostField:
    return CostField(np.zeros((rows, columns), dtype=np.uint8), 0.05, (0.0, 0.0), 0.0)


def test_costs_keep_what_is_closed_and_what_is_free() -> None:
    field = free_field()
    field.cells[0, :5] = [0, 1, 252, 253, 254]
    field.cells[1, 0] = 255
    found = grid_of(field).cells
    assert found[0, :5].tolist() == [0, 1, 4, 253, 254] and found[1, 0] == 255


def test_a_robot_too_near_to_something_still_finds_a_start() -> None:
    swept = motions(1.0, 0.55, True)
    pose = np.array([2.02, 2.02, 0.05, 0.02])
    field = free_field()
    assert free_start(Lattice(grid_of(field), swept), pose) == pytest.approx([2.025, 2.025, 0.0, 0.0])
    field.cells[int((2.02 + 0.37) / 0.05), :] = 254  # beyond the robot's side, within what is planned with
    shut = Lattice(grid_of(field), swept)
    assert free_start(shut, pose) is None
    opened = with_room(shut, pose)
    assert free_start(Lattice(opened, swept), pose) is not None
    assert (opened.cells == 254).any(), "elsewhere it stays closed"


def test_a_plan_goes_on_from_a_state_ahead_on_the_one_before() -> None:
    lattice = Lattice(grid_of(free_field()), motions(1.0, 0.55, True))
    made = plan(LatticeProblem(lattice, (1.025, 2.025, 0.0), (3.025, 2.625, 0.0)))
    aim = 0.5 * (made.poses[3] + made.poses[4])
    head = onward(made, aim)
    assert np.array_equal(head[0], aim)
    assert free_start(lattice, head[-1])[:2] == pytest.approx(head[-1, :2]), "it ends on the lattice"
    assert AHEAD <= np.abs(np.diff(head, axis=0)).sum() < AHEAD + 0.6
    assert onward(made, made.poses[-4]) is None, "so near to the end it is not worth it"


def test_shoulders_grow_what_is_not_in_the_map_but_not_into_the_robot() -> None:
    known = np.zeros((80, 120), dtype=np.int8)
    known[0] = 100
    field = free_field()
    field.cells[1, 30] = field.cells[40, 60] = LETHAL  # a wall that is seen a cell off, and somebody
    wide = with_shoulders(field, StaticMap(known, 0.05))
    grown = np.argwhere(wide.cells == LETHAL)
    away = np.hypot(*(grown - [40, 60]).T) * 0.05
    assert (away[away < 1.0] <= BEYOND + 1e-9).all() and (away < 1.0).sum() == 13 and len(grown) == 14
    beside = np.array([[3.05, 1.0], [4.0, 1.0], [4.0, 3.0], [3.05, 3.0]])
    kept = with_shoulders(field, StaticMap(known, 0.05), [beside])
    assert kept.cells[40, 60] == LETHAL and kept.cells[40, 62] != LETHAL and kept.cells[40, 58] == LETHAL
    assert (field.cells == LETHAL).sum() == 2, "what was given is as it was"


def test_a_robot_that_is_shut_in_is_proved_to_be_from_where_it_stands() -> None:
    field = free_field(160, 200)
    field.cells[20:70, 20], field.cells[20:70, 80] = LETHAL, LETHAL
    field.cells[20, 20:81], field.cells[70, 20:80] = LETHAL, LETHAL
    field.cells[40:57, 80] = 0  # a door that its middle fits through, but not all of it
    few = Navigator(motions(1.0, 0.55, True), PATIENCE.model_copy(update={"expansions": 2_000}))
    assert few.plan(0.0, field, np.array([2.0, 2.2, 0.0, 0.0]), np.array([7.0, 6.0, 0.0])) is None
    (made,) = few.calls
    assert made.answer is Answer.NO_PATH and made.epsilon is None and not made.found
    assert made.expansions <= 2_000, "no search in the order of cost would prove it with so few"
    free = Navigator(motions(1.0, 0.55, True))
    assert free.plan(0.0, free_field(160, 200), np.array([2.0, 2.2, 0.0, 0.0]), np.array([7.0, 6.0, 0.0])) is not None
    assert free.calls[0].epsilon == 1.0 and free.calls[0].expansions_first > 0


def test_goals_are_far_from_each_other(rng: np.random.Generator) -> None:
    places = {f"g{k}": (float(k), 0.0, 0.0) for k in range(8)} | {"start": (0.0, 0.0, 0.0)}
    found = route(places, "start", 20, rng)
    assert found[0] == "start" and "start" not in found[1:] and len(found) == 21
    for a, b in itertools.pairwise(found):
        here = places[a][0]
        assert abs(places[b][0] - here) >= 0.5 * max(here, 7.0 - here)


def call(answer: Answer, epsilon: float | None = 1.0) -> PlannerCall:
    found = answer is Answer.PLAN
    return PlannerCall(0.0, answer, "", epsilon, 100 if found else 0, 500, 0.03 if found else None, 0.2, 5)


def leg(*calls: PlannerCall, contacts: tuple[Touch, ...] = ()) -> CartOutcome:
    score = Score(contacts, 0.4, None, (0.01, 0.02), (0.01, 0.0), (1e-3, 2e-3), 0.02, 0.01, 5.0)
    trace = (Trace(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), "on the way", "", {"a": (1.0, 2.0)}),)
    return CartOutcome(True, "at the goal", 20.0, calls, trace, score, (1.0, 0.0, 0.0), ((0.0, 0.0),), ())


def test_desks_on_the_walls_are_what_the_two_drives_of_each_leg_differ_in(tmp_path) -> None:
    legs = [leg_of(3, number, tmp_path, cart_desks.OFFICE) for number in range(2)]
    office = load_office(legs[0].office)
    hung = [name for name, body in office.clutter.items() if body.kind == "fixture" and body.underside > 0.6]
    assert len(hung) >= 4 and not office.people and legs[1].start == pytest.approx(legs[0].goal)
    scenes = [scene_of(office, np.array(legs[0].start), tilt) for tilt in (TILT, cart_desks.BLIND)]
    lasers = [TiltLaserSettings(**scene.sensors.tilt_laser.model_dump()) for scene in scenes]
    assert lasers[0].beams > 30 and lasers[0].range_max == 30.0
    assert lasers[1].range_max < 0.4, "it sees no further than the robot reaches itself"
    changes = {"tilt_laser": scenes[0].sensors.tilt_laser}
    assert scenes[1].model_copy(update={"sensors": scenes[1].sensors.model_copy(update=changes)}) == scenes[0]


def test_rows_tell_proved_failures_from_others() -> None:
    rows = rows_of([leg(call(Answer.PLAN), call(Answer.NO_PATH, None)), leg(call(Answer.PLAN, 1.4))])
    by_name = {row.what: row for row in rows}
    (failures,) = [row for name, row in by_name.items() if "without proof" in name]
    assert failures.holds and failures.against["failures"] == 1.0
    (optimal,) = [row for name, row in by_name.items() if "epsilon 1.0" in name]
    assert optimal.value == 0.5 and not optimal.holds
    rows = rows_of([leg(call(Answer.UNDECIDED, None), contacts=(Touch("cart", "a", True, 1.0, 5.0),))])
    assert not any(row.holds for row in rows if "without proof" in row.what or "contacts" in row.what)


def test_a_kept_leg_comes_back_and_another_is_refused(tmp_path) -> None:
    file, told = tmp_path / "legs" / "leg_000.json", {"seed": 1, "leg": 0}
    assert read_run(CartOutcome, file, told) is None
    made = leg(call(Answer.PLAN), call(Answer.NO_PATH, None))
    keep_run(file, told, made)
    assert read_run(CartOutcome, file, told) == made
    with pytest.raises(BringupError, match="expected a run of"):
        read_run(CartOutcome, file, {"seed": 2, "leg": 0})
    file.write_text("{}", encoding="utf-8")
    with pytest.raises(BringupError, match="remove it"):
        read_run(CartOutcome, file, told)


class Deaf:
    """Senses that know where everything is, and take note of what they are told to forget."""

    def __init__(self) -> None:
        self.body, self.whole = CartBody.of(pr2_with(CART)), free_field()
        self.stale = self.recovered = 0

    def percept(self, now: float) -> None:
        return None

    def state(self, now: float) -> np.ndarray:
        return np.array([1.025, 2.025, 0.0, 0.0])

    def floor(self, now: float) -> CostField:
        return free_field()

    def recover(self, now: float) -> None:
        self.recovered += 1

    def forget_unseen(self, now: float, age: float) -> list[Recovery]:
        gone, self.stale = self.stale, 0
        return [Recovery("", np.zeros((gone, 2)), np.zeros(gone, dtype=int), 0)]


class Still:
    """A session in which nothing moves."""

    time = 0.0

    def command_base(self, *rates: float) -> None:
        assert not np.any(rates)


def waiting_run(made: list[LatticePlan | None], monkeypatch: pytest.MonkeyPatch) -> CartRun:
    """A run whose planner answers what it is told to."""
    run = CartRun(Still(), np.array([3.025, 2.625, 0.0]), motions(1.0, 0.55, True))
    run.senses = Deaf()

    def answer(now: float, *_: object) -> LatticePlan | None:
        run.navigator.calls.append(replace(call(Answer.PLAN if made[0] else Answer.NO_PATH), time=now))
        return made.pop(0)

    monkeypatch.setattr(run.navigator, "plan", answer)
    monkeypatch.setattr(run.navigator, "prepare", lambda field: None)
    monkeypatch.setattr(run, "_traced", lambda now, command: None)
    return run


def simple_plan() -> LatticePlan:
    lattice = Lattice(grid_of(free_field()), motions(1.0, 0.55, True))
    return plan(LatticeProblem(lattice, (1.025, 2.025, 0.0), (3.025, 2.625, 0.0)))


def test_where_there_is_no_path_it_waits_longer_and_longer_and_asks_again(monkeypatch: pytest.MonkeyPatch) -> None:
    run = waiting_run([None, None, None, None, simple_plan()], monkeypatch)
    for tick in range(1000):
        run._tick(0.05 * tick)
    waits = [TOLD.retry, 2 * TOLD.retry, TOLD.retry_most, TOLD.retry_most]
    assert np.diff([each.time for each in run.navigator.calls]) == pytest.approx(waits, abs=0.051)
    assert run._going is not None and not run.ended


def test_where_something_could_be_forgotten_it_asks_again_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    run = waiting_run([None, None, None, simple_plan()], monkeypatch)
    for now in (0.0, 2.0, 6.0, 7.9, 8.0):
        run.senses.stale = 3 if now == 6.0 else 0
        run._tick(now)
        assert len(run.navigator.calls) == {0.0: 1, 2.0: 2, 6.0: 3, 7.9: 3, 8.0: 4}[now]
    assert run._going is not None and run.senses.recovered == 0


def test_who_does_not_know_where_the_cart_is_asks_for_no_plan_and_goes_on_with_the_one_there_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = waiting_run([simple_plan()], monkeypatch)
    run._tick(0.0)
    going = run._going
    monkeypatch.setattr(run.senses, "state", lambda now: None)
    command = CartCommand(
        np.zeros(3), 0.0, DriveStatus.BLOCKED, Cause.OBSTACLE, "somebody", np.zeros(4), np.zeros(4), 0.0, 0.0, None
    )
    for now in (1.0, 4.0, 5.0):
        run._heed(now, going, command)
    assert run._going is going and len(run.navigator.calls) == 1 and not run.ended


def test_a_plan_that_somebody_stands_on_is_waited_on(monkeypatch: pytest.MonkeyPatch) -> None:
    made = simple_plan()
    run = waiting_run([made, None, None], monkeypatch)
    run._tick(0.0)
    going, goal = run._going, made.poses[7]
    command = CartCommand(
        np.zeros(3), 0.0, DriveStatus.REPLAN, Cause.OBSTACLE, "somebody", goal, np.zeros(4), 0.0, 0.0, None
    )
    run._heed(8.0, going, command)
    assert run.senses.recovered == 1 and run._going is None
    run._tick(8.05)
    assert run._going is not None and run._going.controller is not going.controller
    assert np.array_equal(run._going.poses, made.poses[7:])


def test_the_rest_of_a_plan_begins_where_it_is_and_ends_where_it_ends() -> None:
    made = simple_plan()
    for number in (0, 5, len(made.poses) - 1):
        turned = made.poses[number] + [0.0, 0.0, 2.0 * math.pi, 0.0]
        left = rest(made.poses, turned)
        assert np.array_equal(left[0], turned) and len(left) == len(made.poses) - number
        assert number == len(made.poses) - 1 or np.array_equal(left[-1], made.poses[-1])
