"""What is kept out of is not entered, whatever is commanded; what leads away is obeyed."""

from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.errors import SimError
from bullet_sim.fence import CLEAR
from bullet_sim.known import KEPT_CLEAR, known_scene
from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from krang_sim.session import KrangSession

FENCE = [[1.15, -1.0], [1.15, 1.0], [1.5, 0.0]]


def fenced(make_scene, **sections) -> KrangSession:
    return KrangSession(make_scene(bodies={}, keep_out=[FENCE], **sections), seed=0)


def driven(session: KrangSession, v: float, w: float, arms: float, seconds: float) -> float:
    """Return how near it comes [m]."""
    end, nearest = session.time + seconds, np.inf
    while session.time < end:
        session.command_base(v, w)
        session.command_arm("left", [arms] * 7)
        session.command_arm("right", [-arms] * 7)
        session.step()
        nearest = min(nearest, session.fence.distance(session.held)) if round(400 * session.time) % 20 == 0 else nearest
    return nearest


@pytest.mark.parametrize(("v", "w", "arms"), [(9.0, 0.0, 0.0), (9.0, 0.4, 0.5), (0.0, 9.0, -0.6)])
def test_who_commands_straight_into_it_is_stopped_before_it(make_scene, v, w, arms):
    with fenced(make_scene) as session:
        nearest = driven(session, v, w, arms, 4.0)
        assert nearest > 0.5 * CLEAR
        assert v == 0.0 or nearest < 0.3, "it was stopped by that and nothing else"


def test_at_the_fence_nothing_creeps_in_and_what_leads_away_is_obeyed(make_scene):
    with fenced(make_scene) as session:
        driven(session, 9.0, 0.0, 0.0, 4.0)
        at = session.robot.base_pose().position[0]
        assert "held back" in session.halted
        assert driven(session, 9.0, 0.0, 0.3, 3.0) > 0.5 * CLEAR
        assert session.robot.base_pose().position[0] == pytest.approx(at, abs=0.005)
        driven(session, -9.0, 0.0, 0.0, 2.0)
        assert session.robot.base_pose().position[0] < at - 0.3
        assert session.halted == ""


def test_a_place_is_told_as_something_built_in_and_wider_than_it_is(make_scene):
    scene = make_scene(bodies={}, keep_out=[FENCE])
    (told,) = known_scene(scene, 0.0).bodies
    assert (told.name, told.movable) == ("keep_out_0", False)
    x, y = told.footprint.T
    assert x.min() == pytest.approx(1.15 - KEPT_CLEAR)
    assert 0.5 * (np.roll(y, -1) @ x - np.roll(x, -1) @ y) > 0.0, "counter-clockwise, as the contract has it"


@pytest.mark.parametrize(
    ("corners", "complaint"),
    [
        ([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]], "does not cross itself"),
        ([[0.0, 0.0], [1.0, 1.0]], "at least 3 corners"),
        ([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], "where the robot does not start"),
        ([[0.4, -1.0], [1.2, -1.0], [1.2, 1.0]], "starts 0.1 m off at least"),
    ],
)
def test_a_place_that_cannot_be_is_refused_in_one_line(make_scene, corners, complaint):
    told = make_scene(bodies={}).model_dump(exclude_unset=True)
    with pytest.raises(SimError, match=complaint) as caught:
        KrangSession(parse_settings({**told, "keep_out": [corners]}, Scene, "room"), seed=0).close()
    assert "\n" not in str(caught.value)
