"""One short drive, all of it: simulator, senses, costmaps, planner, local controller."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from pbrl_bringup.cart_run import run_cart
from pbrl_bringup.experiments.cart_office_figure import draw
from pbrl_control.planar import placed
from pbrl_planner.cart.navigator import Answer
from pr2_cart_sim.maps import FREE, OCCUPIED, GridMap, save_map
from pr2_cart_sim.scene import OfficeScene

CART = {
    "kind": "utility_cart",
    "size": [1.0, 0.55],
    "height": 0.90,
    "nominal_mass": 25.0,
    "upper_shelf": False,
    "pose": [2.134, 1.5, 0.0],
}


@pytest.fixture
def hall(tmp_path: Path) -> OfficeScene:
    """A hall of 6 by 3 m with a box in it that is not in the map."""
    cells = np.full((64, 124), FREE, np.int8)
    cells[:2] = cells[-2:] = OCCUPIED
    cells[:, :2] = cells[:, -2:] = OCCUPIED
    save_map(GridMap(0.05, (-0.1, -0.1), cells), tmp_path / "hall.yaml")
    box = {"kind": "fixture", "polygon": [[0, 0], [0.4, 0], [0.4, 0.3], [0, 0.3]], "height": 0.8, "pose": [3.6, 0, 0]}
    return OfficeScene.model_validate(
        {
            "map": str(tmp_path / "hall.yaml"),
            "room": {"outline": [[-0.1, -0.1], [6.1, -0.1], [6.1, 3.1], [-0.1, 3.1]]},
            "robot": {"pose": [1.0, 1.5, 0.0], "torso": 0.244, "holds": "cart"},
            "bodies": {"cart": CART},
            "clutter": {"box": box},
            "sensors": {"base_laser": {"increment": 0.0175}, "tilt_laser": {"increment": 0.5, "rate": 0.1}},
        }
    )


def test_it_gets_to_a_goal_by_what_it_perceives(hall: OfficeScene, tmp_path: Path) -> None:
    done = run_cart(hall, np.array([2.0, 1.5, 0.0]), seed=1, longest=12.0, coarse=True)
    assert done.reached, done.sentence
    assert done.score.goal_error < 0.12 and done.score.goal_angle < 0.05
    assert (done.score.contacts == () and done.score.nearest_thing is None) or done.score.nearest_thing > 0.1
    assert [call.answer for call in done.calls] == [Answer.PLAN] * len(done.calls)
    assert np.quantile(done.score.position_errors, 0.95) < 0.04
    assert done.seconds < 12.0 and abs(done.score.way - 1.0) < 0.1
    assert draw(hall, [done], tmp_path).stat().st_size > 10_000


def test_a_goal_in_a_wall_is_a_proved_failure_and_it_stays_where_it_is(hall: OfficeScene) -> None:
    done = run_cart(hall, np.array([6.0, 1.5, 0.0]), seed=1, longest=2.5, coarse=True)
    assert not done.reached and {call.answer for call in done.calls} == {Answer.GOAL_TAKEN}
    assert len(done.calls) == 2, "it waits and tries again"
    assert done.score.way < 0.01 and "something stands where the goal is" in done.sentence


def kept_out(hall: OfficeScene, corners: list[list[float]]) -> OfficeScene:
    """Return the hall with a place that nothing may enter, where nothing stands."""
    return OfficeScene.model_validate({**hall.model_dump(), "keep_out": [corners]})


def test_round_a_place_that_is_kept_out_of_it_goes_a_way(hall: OfficeScene) -> None:
    strip = [[3.1, -0.1], [3.3, -0.1], [3.3, 1.35], [3.1, 1.35]]
    done = run_cart(kept_out(hall, strip), np.array([2.2, 2.0, 0.0]), seed=1, longest=30.0, coarse=True)
    assert done.reached, done.sentence
    sizes = {"base": np.array([0.334, 0.334]), "cart": np.array([0.5, 0.275])}
    signs, place = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), shapely.Polygon(strip)
    near = [
        place.distance(shapely.Polygon(placed(signs * size, np.array(getattr(each, part)))))
        for each in done.trace
        for part, size in sizes.items()
    ]
    assert 0.05 < min(near) < 0.5


def test_beyond_a_place_that_shuts_the_hall_there_is_proved_to_be_no_way(hall: OfficeScene) -> None:
    strip = [[3.1, -0.1], [3.3, -0.1], [3.3, 3.1], [3.1, 3.1]]
    done = run_cart(kept_out(hall, strip), np.array([2.2, 2.0, 0.0]), seed=1, longest=2.5, coarse=True)
    assert not done.reached and {call.answer for call in done.calls} <= {Answer.NO_PATH, Answer.GOAL_TAKEN}
    assert done.score.way < 0.01


@pytest.mark.parametrize(("tilt", "contact"), [({"increment": 0.04}, False), ({"increment": 0.5, "rate": 0.1}, True)])
def test_a_slab_on_the_wall_is_seen_by_the_tilting_laser_only(hall: OfficeScene, tilt: dict, contact: bool) -> None:
    told = hall.model_dump()
    corners = [[0, 0], [0.7, 0], [0.7, 1.7], [0, 1.7]]
    told["clutter"]["slab"] = {
        "kind": "fixture",
        "polygon": corners,
        "height": 0.74,
        "underside": 0.70,
        "pose": [3.2, 1.3, 0.0],
    }
    told["sensors"]["tilt_laser"] |= {"rate": 20.0} | tilt
    done = run_cart(OfficeScene.model_validate(told), np.array([2.2, 1.5, 0.0]), 1, longest=6.0, coarse=True)
    assert ("slab" in {touch.other for touch in done.score.contacts}) == contact, done.sentence
    assert contact or not done.reached
