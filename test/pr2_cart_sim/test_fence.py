"""What is kept out of is not entered by the PR2 nor by its cart, whatever is commanded; what leads away is obeyed."""

from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.errors import SimError
from bullet_sim.fence import CLEAR
from pr2_cart_sim.session import Pr2Session

AHEAD = [[2.1, -1.0], [2.6, -1.0], [2.6, 1.0], [2.1, 1.0]]
"""Before the cart, which reaches to 1.63 m."""
ASIDE = [[-1.0, 0.9], [1.8, 0.9], [1.8, 1.4], [-1.0, 1.4]]


def driven(session: Pr2Session, twist: tuple[float, float, float], arms: float, seconds: float) -> float:
    """Return how near robot and cart come [m]."""
    end, nearest, ticks = session.time + seconds, np.inf, 0
    while session.time < end:
        session.command_base(*twist)
        session.command_arm("left", [arms] * 7)
        session.command_arm("right", [-arms] * 7)
        session.step()
        ticks += 1
        nearest = min(nearest, session.fence.distance(session.held)) if ticks % 10 == 0 else nearest
    return nearest


@pytest.mark.parametrize("twist", [(9.0, 0.0, 0.0), (9.0, 9.0, 0.0), (0.0, 9.0, 0.0), (0.0, 0.0, 9.0), (0.5, 0.3, 0.5)])
def test_who_commands_straight_into_it_is_stopped_before_it(make_scene, twist):
    with Pr2Session(make_scene(keep_out=[AHEAD, ASIDE]), seed=0) as session:
        assert driven(session, twist, 0.0, 3.0) > 0.5 * CLEAR
        assert "held back" in session.halted


def test_at_the_fence_nothing_creeps_in_and_what_leads_away_is_obeyed(make_scene):
    with Pr2Session(make_scene(keep_out=[AHEAD]), seed=0) as session:
        driven(session, (0.5, 0.0, 0.0), 0.0, 3.0)
        at = session.robot.base_pose().position[0]
        assert driven(session, (0.5, 0.0, 0.0), 0.2, 2.0) > 0.5 * CLEAR
        assert session.robot.base_pose().position[0] == pytest.approx(at, abs=0.01)
        driven(session, (-0.4, 0.0, 0.0), 0.0, 2.0)
        assert session.robot.base_pose().position[0] < at - 0.3
        assert session.halted == ""


def test_a_robot_that_starts_in_such_a_place_is_refused(make_scene):
    with pytest.raises(SimError, match=r"keep_out: expected a robot that starts 0\.1 m off"):
        Pr2Session(make_scene(keep_out=[[[0.35, -1.0], [0.9, -1.0], [0.9, 1.0]]]), seed=0)
