"""Where start and goal are, and what is said where they cannot be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from region_cases import corridor

from pbrl_namo.errors import NamoError
from pbrl_namo.regions import free_space, region_of

ANY = math.nan


def test_start_and_goal_of_a_corridor_are_on_both_sides_of_its_table() -> None:
    scene = corridor(6.0)
    free = free_space(scene)
    assert {region_of(scene, free, scene.start), region_of(scene, free, scene.goal, "goal")} == {0, 1}


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ((6.0, 1.3, ANY), "goal: expected free floor, got \\(6.00, 1.30\\) in 'table_1'"),
        ((6.0, 1.3, 0.0), "goal: expected free floor, got \\(6.00, 1.30\\) in 'table_1'"),
        ((8.9, 1.3, ANY), "goal: expected free floor, got \\(8.90, 1.30\\) in 'pillar'"),
        ((13.0, 1.3, ANY), "goal: expected a place in the room, got \\(13.00, 1.30\\) outside of it"),
        ((-0.001, 1.3, ANY), "goal: expected a place in the room"),
        ((2.0, 0.3, ANY), "goal: expected 0.52 m of room around \\(2.00, 0.30\\), got 0.30 m to a wall"),
        ((5.4, 1.3, ANY), "goal: expected 0.52 m of room .* to 'table_1'"),
        ((2.0, 0.3, 0.0), "goal: in collision: expected the whole robot in the room, it would be in the walls"),
        ((5.4, 1.3, 0.0), "goal: in collision: .* it would be in 'table_1'"),
    ],
)
def test_a_place_that_cannot_be_is_refused_in_words(pose: tuple[float, float, float], message: str) -> None:
    scene = replace(corridor(6.0), fixed={"pillar": shapely.box(8.8, 1.2, 9.0, 1.4)})
    with pytest.raises(NamoError, match=message) as caught:
        region_of(scene, free_space(scene), np.array(pose), "goal")
    assert "\n" not in str(caught.value)


def test_a_robot_in_a_niche_belongs_to_the_region_that_it_drives_out_to() -> None:
    """The niche is wider than the body and narrower than the disc: it can drive out straight, and not turn there."""
    walls = {"low": shapely.box(0.0, 0.0, 1.5, 0.785), "high": shapely.box(0.0, 1.815, 1.5, 2.6)}
    scene = replace(corridor(), fixed=walls)
    free = free_space(scene)
    nose_out = np.array([0.75, 1.3, 0.0])
    assert free.index(nose_out) is None
    assert region_of(scene, free, nose_out) == region_of(scene, free, np.array([0.75, 1.3, math.pi])) == 0


def test_a_robot_that_is_shut_in_is_told_so() -> None:
    walls = {"low": shapely.box(0.0, 0.0, 4.5, 0.785), "high": shapely.box(0.0, 1.815, 4.5, 2.6)}
    scene = replace(corridor(), fixed=walls)
    with pytest.raises(NamoError, match="start: expected room for the robot to drive away from"):
        region_of(scene, free_space(scene), np.array([1.0, 1.3, 0.0]))


def test_a_robot_in_a_room_that_is_too_small_is_told_so() -> None:
    scene = replace(corridor(), room=shapely.box(0.0, 0.0, 1.3, 1.05))
    with pytest.raises(NamoError, match="start"):
        region_of(scene, free_space(scene, 0.6), np.array([0.7, 0.52, 0.0]))
