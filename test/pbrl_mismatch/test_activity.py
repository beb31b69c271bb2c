"""When an effect acts, asked of its own fitted law: closed forms along a recorded motion, and hostile input."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from wandering import MASS, table_row

from pbrl_bag.types import Recording
from pbrl_mismatch import MismatchError, track_of
from pbrl_mismatch.activity import GAP, NEAR, activity, intervals, without, wrench_sizes
from pbrl_mismatch.kernels.columns import COLUMN


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


def inside(track: Any, found: tuple[tuple[float, float], ...]) -> np.ndarray:
    return np.any([(track.clock >= a) & (track.clock < b) for a, b in found] or [np.zeros_like(track.clock, bool)], 0)


def test_a_steady_force_is_as_large_as_it_is_and_acts_always(track: Any) -> None:
    row = table_row(steady_x=3.0, steady_y=-4.0)
    size = wrench_sizes(track, row, ["external_force"])["external_force"]
    assert size is not None
    np.testing.assert_allclose(size, 5.0, atol=1e-6)
    assert inside(track, activity(track, row, ["external_force"])["external_force"] or ()).all()


@pytest.mark.parametrize("gone", [0.0, 1.0])
def test_a_load_acts_from_its_moment_on_or_until_then(track: Any, gone: float) -> None:
    moment = float(track.clock[len(track.clock) // 2])
    row = table_row(payload_mass=15.0, payload_time=moment, payload_gone=gone)
    found = inside(track, activity(track, row, ["payload_change"])["payload_change"] or ())
    # Also where the body is at rest, or goes at a steady speed, and the load is not felt.
    np.testing.assert_array_equal(found, (track.clock >= moment) != (gone > 0.0))


def test_a_load_that_is_not_felt_does_not_act(track: Any) -> None:
    row = table_row(payload_mass=1e-4, payload_time=float(track.clock[0]))
    assert activity(track, row, ["payload_change"])["payload_change"] == ()


@pytest.mark.parametrize("cone", [0.0, 1.0])
def test_beside_a_wheel_a_patch_acts_only_where_a_foot_is_on_it(track: Any, cone: float) -> None:
    wheel = table_row(mu_x=0.05, mu_y=0.2, cone=cone, wheel_x=0.1)
    patch = {"patch_mu": 0.3, "patch_length": 0.2, "patch_width": 0.2}
    for name, value in patch.items():
        wheel[COLUMN[name]] = value
    wheel[COLUMN["patch_x"]] = float(track.seen[:, 0].max()) + 5.0  # metres from where the body ever was
    assert activity(track, wheel, ["floor_patch"])["floor_patch"] == ()
    wheel[[COLUMN["patch_x"], COLUMN["patch_y"]]] = track.seen[0, :2] + np.array(track.feet[0])
    assert activity(track, wheel, ["floor_patch"])["floor_patch"]


def test_what_two_laws_share_stays_with_the_one_that_is_on(track: Any) -> None:
    row = table_row(slide_mu=0.05, slide_extent=0.7, load_x=0.1, load_height=0.8, patch_mu=0.1, patch_x=50.0)
    both = ["ground_friction", "floor_patch"]
    off = without(track, row, "ground_friction", both)
    assert off[COLUMN["slide_mu"]] == 0.0 and off[COLUMN["patch_mu"]] == 0.1
    assert off[COLUMN["load_x"]] == 0.1 and off[COLUMN["load_height"]] == 0.8
    assert without(track, row, "ground_friction")[COLUMN["load_x"]] == 0.0
    # A patch that the body never came to does nothing beside friction whose load is uneven.
    assert activity(track, row, ["floor_patch"], beside=both)["floor_patch"] == ()


def test_a_cord_acts_where_it_is_taut(track: Any) -> None:
    anchor = track.seen[0, :2] + [0.3, 0.2]
    away = np.hypot(*(track.seen[:, :2] - anchor).T)
    slack = float(np.quantile(away, 0.6))
    row = table_row(tether_stiffness=400.0, tether_x=anchor[0], tether_y=anchor[1], tether_length=slack)
    row[COLUMN["tether_at_x"]], row[COLUMN["tether_at_y"]] = track.body[1:3]
    found = inside(track, activity(track, row, ["tether"])["tether"] or ())
    reach = float(away.max()) - slack  # below a small share of the pull at its strongest it does not count
    assert found[away > slack + 0.05 * reach].all()
    assert found[away < slack - 0.02].mean() < 0.1  # pauses that are bridged


def test_what_was_touched_is_touched_until_the_path_is_away(track: Any) -> None:
    def post(off: float) -> np.ndarray:
        """A disc of 10 cm whose border is `off` the footprint, right of it, in the middle of the first episode."""
        x, y = side
        return table_row(obstacle_stiffness=2e4, obstacle_x=x + off + 0.1, obstacle_y=y, obstacle_radius=0.1)

    at = int(track.begin[0] + track.last[0]) // 2
    c, s = np.cos(track.seen[at, 2]), np.sin(track.seen[at, 2])
    corners = (track.outline - track.body[1:3]) @ np.array([[c, s], [-s, c]]) + track.seen[at, :2]
    side = corners[np.argmax(corners[:, 0])]
    touched = activity(track, post(-1e-3), ["hidden_obstacle"])["hidden_obstacle"]
    size = wrench_sizes(track, post(-1e-3), ["hidden_obstacle"])["hidden_obstacle"]
    assert touched and size is not None and inside(track, touched)[size > 1.0].all()
    nearer = wrench_sizes(track, post(-1e-3 - NEAR), ["hidden_obstacle"])["hidden_obstacle"]
    assert nearer is not None and not inside(track, touched)[nearer == 0.0].mean() > 0.05  # pauses that are bridged


def test_a_path_that_keeps_off_what_it_must_have_touched_is_taken_to_be_off(track: Any) -> None:
    x, y = track.seen[:, 0].max() + np.hypot(*np.abs(track.outline).max(axis=0)) + 0.5, track.seen[:, 1].mean()
    gap = _gap(track, x, y)
    for short, acts in ((0.008, True), (0.1, False)):
        row = table_row(obstacle_stiffness=2e4, obstacle_x=x, obstacle_y=y, obstacle_radius=gap - short)
        assert bool(activity(track, row, ["hidden_obstacle"])["hidden_obstacle"]) is acts


def _gap(track: Any, x: float, y: float) -> float:
    """Return how near (x, y) comes to the footprint [m]."""
    place = shapely.Point(x, y)
    least = np.inf
    for px, py, angle in track.seen[:, :3]:
        c, s = np.cos(angle), np.sin(angle)
        corners = (track.outline - track.body[1:3]) @ np.array([[c, s], [-s, c]]) + [px, py]
        least = min(least, shapely.Polygon(corners).distance(place))
    return float(least)


def test_friction_that_breaks_away_acts_where_feet_are_slow_and_leaves_sliding_friction_on(track: Any) -> None:
    row = table_row(slide_mu=0.1, breakaway_mu=0.05, breakaway_speed=0.02)
    found = inside(track, activity(track, row, ["breakaway_friction"])["breakaway_friction"] or ())
    turns = np.exp(1j * track.seen[:, 2:3]) * ((track.feet - track.body[1:3]) @ [1.0, 1j])
    speed = np.abs(track.seen[:, 3:4] + 1j * track.seen[:, 4:5] + 1j * track.seen[:, 5:6] * turns)
    fast = (speed > 0.05).all(axis=1)  # 0.2 % of the excess is left there
    assert fast.any() and found[fast].mean() < 0.1  # pauses that are bridged
    assert found[((speed > 0.005) & (speed < 0.02)).all(axis=1)].all()
    off = without(track, row, "breakaway_friction")
    assert off[COLUMN["breakaway_mu"]] == 0.0 and off[COLUMN["slide_mu"]] == 0.1
    assert without(track, row, "ground_friction")[COLUMN["slide_mu"]] == 0.0


def test_each_effect_of_two_is_asked_alone(track: Any) -> None:
    row = table_row(steady_x=2.0, slope_x=0.01)
    sizes = wrench_sizes(track, row, ["external_force", "floor_slope"])
    np.testing.assert_allclose(sizes["external_force"], 2.0, atol=1e-6)
    np.testing.assert_allclose(sizes["floor_slope"], 0.01 * MASS * 9.81, rtol=1e-2)
    off = without(track, row, "external_force")
    assert off[COLUMN["steady_x"]] == 0.0 and off[COLUMN["slope_x"]] == 0.01


def test_a_centre_of_mass_or_a_tag_that_is_off_moves_no_other_effect(track: Any) -> None:
    anchor = track.seen[0, :2] + [0.3, 0.2]
    cord = {"tether_stiffness": 400.0, "tether_x": anchor[0], "tether_y": anchor[1], "tether_length": 0.2}
    size = wrench_sizes(track, table_row(**cord), ["tether"])["tether"]
    off = wrench_sizes(track, table_row(com_x=-0.1, com_y=0.15, **cord), ["tether"])["tether"]
    assert size is not None and off is not None and (size > 0.0).any()
    # The same force turns a body about another centre more or less, but pulls when it did.
    np.testing.assert_array_equal(off > 0.0, size > 0.0)


def test_below_the_floor_nothing_acts_and_what_no_force_shows_has_no_times(track: Any) -> None:
    found = activity(track, table_row(steady_x=0.1, time_offset=0.2), ["external_force", "time_offset"])
    assert found == {"external_force": (), "time_offset": None}


def test_bouts_are_bridged_dropped_and_cut_by_episode(track: Any) -> None:
    mask = np.zeros(len(track.clock), dtype=bool)
    one = round(0.2 / track.dt)
    pause = round(0.5 * GAP / track.dt)
    mask[10 : 10 + one] = mask[10 + one + pause : 10 + 2 * one + pause] = True
    mask[10 + 6 * one + pause] = True
    found = intervals(track, mask)
    assert len(found) == 1
    assert found[0][0] == pytest.approx(track.clock[10])
    assert found[0][1] == pytest.approx(track.clock[10 + 2 * one + pause - 1] + track.dt)
    assert intervals(track, np.zeros_like(mask)) == ()
    assert len(intervals(track, np.ones_like(mask))) == len(track.begin)


def test_hostile_input(track: Any) -> None:
    with pytest.raises(MismatchError, match="columns"):
        activity(track, np.zeros(3), ["tether"])
    with pytest.raises(MismatchError, match="expected one of"):
        activity(track, table_row(), ["gravity"])
    with pytest.raises(MismatchError, match="above zero"):
        activity(track, table_row(), ["tether"], floor=0.0)
    with pytest.raises(MismatchError, match="steps"):
        intervals(track, np.zeros(3, dtype=bool))
