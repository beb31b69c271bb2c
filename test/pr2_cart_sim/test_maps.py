"""Maps: round trips through files, walls that cover what is occupied, hostile files."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bullet_sim.errors import SimError
from pr2_cart_sim.maps import FREE, OCCUPIED, UNKNOWN, GridMap, load_map, save_map

CELLS = arrays(np.int8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.sampled_from([0, 100, -1]))


@given(CELLS)
def test_boxes_cover_what_is_occupied_and_nothing_twice(cells):
    count = np.zeros(cells.shape, int)
    for left, bottom, right, top in np.round(GridMap(1.0, (0.0, 0.0), cells).boxes()).astype(int):
        count[bottom:top, left:right] += 1
    np.testing.assert_array_equal(count, (cells == OCCUPIED).astype(int))


def test_boxes_of_a_plain_room_are_its_four_walls():
    cells = np.full((40, 60), OCCUPIED, np.int8)
    cells[2:-2, 2:-2] = FREE
    assert len(GridMap(0.05, (0.0, 0.0), cells).boxes()) == 4


@settings(max_examples=15)
@given(CELLS)
def test_a_map_written_and_read_is_the_same(tmp_path_factory, cells):
    path = tmp_path_factory.mktemp("map") / "floor.yaml"
    save_map(GridMap(0.05, (-1.5, 2.0), cells), path)
    again = load_map(path)
    assert (again.resolution, again.origin) == (0.05, (-1.5, 2.0))
    np.testing.assert_array_equal(again.cells, cells)


def test_first_row_of_cells_is_the_last_of_the_picture(tmp_path):
    image = np.full((3, 4), 254, np.uint8)
    image[-1, 0] = 0  # lower left
    cv2.imwrite(str(tmp_path / "m.pgm"), image)
    said = {"image": "m.pgm", "resolution": 0.5, "origin": [10.0, 20.0, 0.0]}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(said))
    grid = load_map(tmp_path / "m.yaml")
    assert grid.value(10.1, 20.1) == OCCUPIED
    assert grid.value(10.6, 20.1) == FREE
    assert grid.value(9.9, 20.1) == grid.value(12.1, 20.1) == UNKNOWN
    np.testing.assert_allclose(grid.outline, [[10, 20], [12, 20], [12, 21.5], [10, 21.5]])


def test_negated_picture(tmp_path):
    cv2.imwrite(str(tmp_path / "m.png"), np.array([[255, 0]], np.uint8))
    said = {"image": "m.png", "resolution": 0.5, "origin": [0, 0, 0], "negate": 1}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(said))
    assert load_map(tmp_path / "m.yaml").cells.tolist() == [[OCCUPIED, FREE]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"image": "none.png"}, "image: expected a picture"),
        ({"origin": [0, 0, 0.3]}, "expected a yaw of 0"),
        ({"mode": "scale"}, "expected trinary"),
        ({"resolution": 0}, "resolution"),
        ({"resoluton": 1}, "did you mean 'resolution'"),
    ],
)
def test_a_bad_map_is_one_line(tmp_path, change, words):
    cv2.imwrite(str(tmp_path / "m.png"), np.zeros((2, 2), np.uint8))
    said = {"image": "m.png", "resolution": 0.5, "origin": [0, 0, 0]} | change
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(said))
    with pytest.raises(SimError, match=words) as caught:
        load_map(tmp_path / "m.yaml")
    assert "\n" not in str(caught.value)
