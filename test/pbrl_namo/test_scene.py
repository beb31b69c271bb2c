"""The scene: what is told of it is checked, and a moved one leaves the first as it was."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pbrl_control.errors import ControlError
from pbrl_namo.errors import NamoError
from pbrl_namo.scene import Movable, NamoScene

ROOM = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]])
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def scene(**told: Any) -> NamoScene:
    given: dict[str, Any] = {
        "room": ROOM,
        "fixed": {"pillar": SQUARE + np.array([5.0, 3.0])},
        "movable": {"box": Movable(SQUARE)},
        "poses": {"box": np.array([2.0, 2.0, math.pi / 4])},
        "start": np.array([1.0, 1.0, 0.0]),
        "goal": np.array([5.0, 1.0, math.nan]),
    }
    return NamoScene.of(**{**given, **told})


def test_outlines_are_where_the_poses_say() -> None:
    outline = scene().outlines["box"]
    assert outline.area == pytest.approx(1.0) and outline.centroid.coords[0] == pytest.approx((2.0, 2.0))
    assert outline.bounds == pytest.approx(
        (2 - math.sqrt(0.5), 2 - math.sqrt(0.5), 2 + math.sqrt(0.5), 2 + math.sqrt(0.5))
    )


def test_the_floor_has_everything_but_what_is_left_out() -> None:
    assert set(scene().floor().obstacles) == {"pillar", "box"}
    assert set(scene().floor("box").obstacles) == {"pillar"}
    assert scene().walls.area == pytest.approx(23.0)


def test_a_moved_scene_leaves_the_first_as_it_was() -> None:
    first = scene()
    second = first.moved({"box": np.array([3.0, 1.0, 0.0])}, start=np.array([1.0, 2.0, 0.5]))
    assert first.outlines["box"].centroid.x == pytest.approx(2.0) and first.start.tolist() == [1.0, 1.0, 0.0]
    assert second.outlines["box"].centroid.x == pytest.approx(3.0) and second.start.tolist() == [1.0, 2.0, 0.5]


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"poses": {}}, "pose of 'box': expected a finite"),
        ({"poses": {"box": np.array([1.0, np.nan, 0.0])}}, "pose of 'box': expected a finite"),
        ({"poses": {"box": np.array([1.0, 1.0])}}, "pose of 'box': expected a finite"),
        ({"start": np.array([np.inf, 0.0, 0.0])}, "start: expected a finite"),
        ({"goal": np.array([np.nan, 0.0, 0.0])}, "goal: expected \\(x, y, theta\\)"),
        ({"goal": np.array([1.0, 1.0, np.inf])}, "goal: expected"),
        ({"goal": np.array([1.0, 1.0])}, "goal: expected"),
        ({"fixed": {"box": SQUARE}}, "got 'box' as fixed and as movable"),
    ],
)
def test_what_cannot_be_a_scene_is_refused(told: dict[str, Any], message: str) -> None:
    with pytest.raises(NamoError, match=message):
        scene(**told)


@pytest.mark.parametrize("corners", [SQUARE[[0, 2, 1, 3]], SQUARE[:2], np.full((3, 2), np.nan), np.zeros((4, 2))])
def test_an_outline_that_is_none_is_refused(corners: np.ndarray) -> None:
    for told in ({"room": corners}, {"fixed": {"wall": corners}}, {"movable": {"box": Movable(corners)}}):
        with pytest.raises(ControlError, match="outline of"):
            scene(**told)


def test_moving_what_is_not_there_or_to_nowhere_is_refused() -> None:
    with pytest.raises(NamoError, match="expected one of box, got 'pillar'"):
        scene().moved({"pillar": np.zeros(3)})
    with pytest.raises(NamoError, match="pose of 'box': expected a finite"):
        scene().moved({"box": np.array([np.nan, 0.0, 0.0])})
    with pytest.raises(NamoError, match="start: expected a finite"):
        scene().moved({}, start=np.array([0.0, np.inf, 0.0]))
