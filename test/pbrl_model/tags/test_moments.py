"""Pictures of one moment come together, whatever order they arrive in and whichever is lost."""

from __future__ import annotations

import itertools

import pytest

from pbrl_model.errors import ModelError
from pbrl_model.tags.moments import MomentGrouper


@pytest.mark.parametrize("order", itertools.permutations("012"))
def test_a_moment_is_complete_with_its_last_camera(order):
    grouper: MomentGrouper[str] = MomentGrouper("012", 0.01)
    given = [moment for name in order for moment in grouper.add(name, 1.0, f"picture {name}")]
    assert given == [(1.0, ["picture 0", "picture 1", "picture 2"])]


def test_pictures_that_overtake_others_do_not_split_a_moment():
    grouper: MomentGrouper[str] = MomentGrouper("012", 0.01)
    for camera, stamp in (("0", 1.0), ("1", 1.0), ("0", 1.1), ("1", 1.1)):
        assert grouper.add(camera, stamp, f"{camera} at {stamp}") == []
    assert grouper.add("2", 1.0, "2 at 1.0") == [(1.0, ["0 at 1.0", "1 at 1.0", "2 at 1.0"])]
    assert grouper.add("2", 1.1, "2 at 1.1") == [(1.1, ["0 at 1.1", "1 at 1.1", "2 at 1.1"])]


def test_a_lost_picture_costs_its_moment_nothing_but_itself():
    grouper: MomentGrouper[str] = MomentGrouper("01", 0.01)
    assert grouper.add("0", 1.0, "a") == []
    assert grouper.add("0", 1.1, "b") == []
    assert grouper.add("1", 1.104, "c") == [(1.0, ["a"]), (1.1, ["b", "c"])]
    assert grouper.add("1", 1.0, "too late") == []


def test_a_camera_that_is_gone_holds_nobody_up():
    grouper: MomentGrouper[str] = MomentGrouper("01", 0.01)
    given = [moment for k in range(6) for moment in grouper.add("0", 1.0 + 0.1 * k, str(k))]
    assert [items for _, items in given] == [["0"], ["1"], ["2"], ["3"]]
    assert [stamp for stamp, _ in given] == sorted(stamp for stamp, _ in given)


def test_a_clock_that_goes_back_begins_anew():
    grouper: MomentGrouper[str] = MomentGrouper("01", 0.01)
    grouper.add("0", 9.0, "a")
    grouper.add("1", 9.0, "b")
    assert grouper.add("0", 0.0, "c") == []
    assert grouper.add("1", 0.0, "d") == [(0.0, ["c", "d"])]


def test_one_camera_waits_for_nobody():
    grouper: MomentGrouper[str] = MomentGrouper(["0"], 0.01)
    assert grouper.add("0", 1.0, "a") == [(1.0, ["a"])]


@pytest.mark.parametrize(("cameras", "window"), [([], 0.01), (["0"], 0.0), (["0"], float("nan"))])
def test_a_grouper_that_could_never_give_is_refused(cameras, window):
    with pytest.raises(ModelError, match="expected cameras and a window above zero"):
        MomentGrouper(cameras, window)
