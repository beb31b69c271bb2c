"""Places of contact from the residual wrench's line of action."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import residual_wrench, track_of
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.search.path.contacts import contact_points, with_contacts


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_a_push_on_the_edge_is_found_where_it_acts(concealed_recording: Callable[..., Recording], turn: float) -> None:
    track = track_of(concealed_recording("clean", 1), "table")
    row = neutral_row()
    row[COLUMN["mass"]] = 20.0
    found = residual_wrench(track, row, size=1.0)
    place, force = np.array([0.6, 0.2]), np.array([-8.0, 1.0])
    found.state[:, 2] = turn
    c, s = np.cos(turn), np.sin(turn)
    found.world[:, :2] = np.array([[c, -s], [s, c]]) @ force
    found.world[:, 2] = place[0] * force[1] - place[1] * force[0]
    places, normals = contact_points(track, found)
    wanted = found.state[:, :2] + np.array([[c, -s], [s, c]]) @ place
    assert np.abs(places[:, None] - wanted).sum(-1).min(1).max() < 1e-6
    np.testing.assert_allclose(normals, np.broadcast_to(-found.world[0, :2] / np.hypot(8, 1), normals.shape))


def test_discs_are_put_beside_the_contact_and_a_third_stays() -> None:
    rng = np.random.default_rng(0)
    draws = np.tile([9.0, 9.0, np.log(0.1)], (30, 1))
    placed = with_contacts(rng, draws, (0, 1, 2), np.array([[1.0, 2.0]]), np.array([[0.0, 1.0]]))
    moved = np.arange(30) % 3 > 0
    np.testing.assert_allclose(placed[moved, :2].mean(0), [1.0, 2.1], atol=0.02)
    np.testing.assert_array_equal(placed[~moved], draws[~moved])
    np.testing.assert_array_equal(with_contacts(rng, draws, (0, 1, 2), np.empty((0, 2)), np.empty((0, 2))), draws)


def test_half_of_the_places_of_what_is_pushed_along_are_where_it_was_met(
    concealed_recording: Callable[..., Recording],
) -> None:
    track = track_of(concealed_recording("clean", 1), "table")
    row = neutral_row()
    row[COLUMN["mass"]] = 20.0
    found = residual_wrench(track, row, size=1.0)
    count = len(found.world)
    found.world[:] = 0.0
    met, left = count // 3, count // 3 + round(2.0 / track.dt)
    found.state[:, :2] = np.linspace([0.0, 0.0], [1.0, 0.5], count)  # every place is another
    found.state[:, 2] = 0.0
    found.world[met:left] = [-80.0, 0.0, 0.0]
    places, _ = contact_points(track, found, met=True)
    begin = places[0]
    assert np.mean(np.all(places == begin, axis=1)) == pytest.approx(0.5, abs=0.02)
    assert begin[0] == pytest.approx(places[:, 0].min())
