"""The nearest edge of a footprint, and the way in."""

import numpy as np
import pytest

from pbrl_control.edges import nearest_edge
from pbrl_control.errors import ControlError

TABLE = np.array([[-0.4, -0.7], [0.4, -0.7], [0.4, 0.7], [-0.4, 0.7]])


@pytest.mark.parametrize(
    ("point", "foot", "inward"),
    [
        ((-0.45, 0.2), (-0.4, 0.2), 0.0),
        ((-0.39, 0.2), (-0.4, 0.2), 0.0),
        ((0.1, -0.72), (0.1, -0.7), np.pi / 2),
        ((0.5, 0.0), (0.4, 0.0), np.pi),
    ],
)
def test_foot_and_way_in(point: tuple, foot: tuple, inward: float) -> None:
    edge = nearest_edge(TABLE, np.array(point))
    np.testing.assert_allclose(edge.pose[:2], foot)
    assert np.cos(edge.pose[2] - inward) == pytest.approx(1.0)


def test_goal_lies_past_the_edge_in_world() -> None:
    goal = nearest_edge(TABLE, np.array([-0.4, 0.3])).plates_goal(np.array([1.0, 2.0, np.pi / 2]), 0.02)
    np.testing.assert_allclose(goal, [0.7, 1.62, np.pi / 2], atol=1e-12)


@pytest.mark.parametrize("bad", [np.zeros((2, 2)), np.zeros((4, 3)), np.full((4, 2), np.nan), np.zeros(4)])
def test_what_is_no_polygon_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(ControlError, match="footprint: expected"):
        nearest_edge(bad, np.zeros(2))
