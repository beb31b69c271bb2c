"""The sheet of tags: the rule for bodies without an entry, and every fault in one line."""

from __future__ import annotations

import pytest

from bullet_sim.errors import SimError
from bullet_sim.settings import parse_settings
from bullet_sim.tag_plates import TEXELS, tag_image
from bullet_sim.tag_sheet import TagSheet, load_tag_sheet, worn_tags


def test_bodies_without_an_entry_wear_the_lowest_free_ids_in_their_order():
    sheet = TagSheet.model_validate(
        {"tags": {"desk": [{"id": 1, "size": 0.3}], "left_gripper": [{"id": 0, "size": 0.1}]}}
    )
    worn = worn_tags(sheet, ("b", "desk", "a"))
    assert {name: [mount.id for mount in mounts] for name, mounts in worn.items()} == {
        "b": [2],
        "desk": [1],
        "a": [3],
        "left_gripper": [0],
    }
    assert worn["b"][0].size == sheet.size


def test_the_workspace_s_sheet_gives_each_gripper_a_collar():
    sheet = load_tag_sheet()
    assert {name: len(mounts) for name, mounts in sheet.tags.items()} == {"left_gripper": 4, "right_gripper": 4}


def test_more_bodies_than_tags_are_refused():
    sheet = TagSheet(dictionary="DICT_ARUCO_MIP_36h12")
    with pytest.raises(SimError, match="expected at most 250 tags"):
        worn_tags(sheet, [f"body_{number}" for number in range(sheet.count + 1)])


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"dictionary": "DICT_APRILTAG_36h12"}, "did you mean 'DICT_APRILTAG_36h11'"),
        ({"tags": {"a": [{"id": 3, "size": 0.1}], "b": [{"id": 3, "size": 0.1}]}}, "got 3 twice"),
        ({"tags": {"a": [{"id": 999, "size": 0.1}]}}, "expected ids below 587"),
        ({"tags": {"a": [{"id": 1, "size": -0.1}]}}, "size"),
        ({"tags": {"a": [{"id": 1, "size": 0.1, "quaternion": [0, 0, 0, 0.5]}]}}, "unit quaternion"),
        ({"sizes": 0.1}, "did you mean 'size'"),
    ],
)
def test_a_sheet_with_a_fault_is_refused(data, words):
    with pytest.raises(SimError, match=words) as caught:
        parse_settings(data, TagSheet, "tags.yaml")
    assert "\n" not in str(caught.value)


def test_a_tag_is_black_inside_a_white_margin():
    image = tag_image(TagSheet(), 7)
    cells = image.shape[0] // TEXELS
    assert image.shape == (400, 400) and cells == 10
    assert (image[:TEXELS] == 255).all() and (image[:, -TEXELS:] == 255).all()
    assert (image[TEXELS : 2 * TEXELS, TEXELS:-TEXELS] == 0).all()
