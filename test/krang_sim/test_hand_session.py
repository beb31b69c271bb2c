"""The hand that pushes when it is asked to: what it publishes, and what it refuses."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from bullet_sim.errors import SimError
from bullet_sim.scene import Scene
from krang_sim.hand_session import HandSession, straight_push
from krang_sim.messages import to_messages
from krang_sim.observations import ClockTick, GraspState, KnownScene, Observation, TagReading, WristReading

OUTLINE = [[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0]]


def scene(**concealed: object) -> Scene:
    table = {"kind": "plain_table", "size": [0.7, 1.2], "nominal_mass": 20.0, "pose": [0.0, 0.0, 0.0]}
    return Scene.model_validate(
        {"name": "hand", "room": {"outline": OUTLINE}, "bodies": {"table": table}, "concealed": concealed}
    )


def pushed(seed: int, count: int, **concealed: object) -> tuple[list[Observation], list[str]]:
    """Push a table ahead so many times; return what was published, and how each push went."""
    heard: list[Observation] = []
    with HandSession(scene(**concealed), seed=seed, publish=heard.extend) as session:
        heard += session.latched()
        push = straight_push("table", (-0.35, 0.0), (3.0, 0.0), 0.1, 2.0)
        return heard, [session.push(push) for _ in range(count)]


def places(heard: list[Observation], tag: str = "table") -> np.ndarray:
    return np.array([[each.time, *each.position[:2]] for each in heard if getattr(each, "tag", "") == tag])


def test_a_push_is_told_as_a_robot_s_would_be() -> None:
    heard, status = pushed(3, 1)
    assert status == ["done"]
    assert isinstance(heard[0], ClockTick) and isinstance(heard[1], KnownScene)
    holds = [each for each in heard if isinstance(each, GraspState)]
    assert [len(each.holds) for each in holds] == [0, 0, 1, 0]
    assert holds[2].holds[0].object == "table" and holds[2].holds[0].gripper == "left"
    felt = [each.time for each in heard if isinstance(each, WristReading)]
    assert len(felt) == pytest.approx(100.0 * felt[-1], rel=0.02) and all(b > a for a, b in pairwise(felt))
    seen = [each for each in heard if isinstance(each, TagReading)]
    assert {each.tag for each in seen} == {"table", "left_gripper"}
    way = places(heard)
    # At 0.1 m/s for 2 s with ramps, and what the servo is behind.
    assert way[-5:, 1].mean() - way[:5, 1].mean() == pytest.approx(0.18, abs=0.02)
    for each in heard:
        assert to_messages(each)


def test_the_clock_goes_on_from_push_to_push_and_the_table_stays_where_it_was_left() -> None:
    heard, status = pushed(3, 2, floor_slope={"angle": 0.02, "heading": 1.0})
    assert status == ["done", "done"]
    ticks = [each.time for each in heard if isinstance(each, ClockTick)]
    assert all(b > a for a, b in pairwise(ticks))
    grasps = [each for each in heard if isinstance(each, GraspState)]
    released, taken = grasps[3].time, grasps[4].time
    way = places(heard)
    between = way[(way[:, 0] > released + 0.2) & (way[:, 0] < taken)]
    assert len(between) > 10 and np.ptp(between[:, 1:], axis=0).max() < 0.03  # noise of the tags


def test_what_was_pushed_before_gives_way_to_what_is_pushed_into_it() -> None:
    size = {"kind": "plain_table", "size": [0.7, 1.2], "nominal_mass": 20.0}
    tables = {"near": {**size, "pose": [-1.0, 0.0, 0.0]}, "far": {**size, "pose": [0.0, 0.0, 0.0]}}
    room = Scene.model_validate({"name": "two", "room": {"outline": OUTLINE}, "bodies": tables})
    heard: list[Observation] = []
    with HandSession(room, seed=3, publish=heard.extend) as session:
        assert session.push(straight_push("far", (-0.35, 0.0), (1.0, 0.0), 0.05, 1.0)) == "done"
        before = {name: places(heard, name)[-1, 1] for name in tables}
        assert session.push(straight_push("near", (-0.35, 0.0), (1.0, 0.0), 0.2, 4.0)) == "done"
    for name in tables:
        assert places(heard, name)[-1, 1] - before[name] > 0.3, name


def test_the_same_seed_publishes_the_same_and_another_does_not() -> None:
    one, again, other = (places(pushed(seed, 1)[0]) for seed in (1, 1, 2))
    assert one.tobytes() == again.tobytes() != other.tobytes()


def test_pushes_that_cannot_be_done_are_refused_and_the_next_one_is_done() -> None:
    with HandSession(scene(), seed=0, publish=lambda news: None) as session:
        for body, contact in (("chair", (0.0, 0.0)), ("table", (5.0, 0.0))):
            with pytest.raises(SimError, match=r"chair|outline"):
                session.push(straight_push(body, contact, (1.0, 0.0), 0.1, 1.0))
        assert session.push(straight_push("table", (0.35, 0.0), (-1.0, 0.0), 0.1, 1.0)) == "done"


@pytest.mark.parametrize(
    ("direction", "speed", "duration"),
    [((0.0, 0.0), 0.1, 1.0), ((1.0, 0.0), 0.0, 1.0), ((1.0, 0.0), 0.1, 0.3), ((1.0, 0.0), 0.1, 1e3),
     ((float("nan"), 0.0), 0.1, 1.0), ((1.0, 0.0), float("inf"), 1.0)],
)  # fmt: skip
def test_what_is_no_push_is_refused(direction: tuple[float, float], speed: float, duration: float) -> None:
    with pytest.raises(SimError, match="expected") as error:
        straight_push("table", (0.0, 0.0), direction, speed, duration)
    assert "\n" not in str(error.value)
