"""Places that nothing may enter are lethal in a costmap, whole cells, and nothing else of it is changed."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from pbrl_planner.cart.kept_out import with_kept_out
from pbrl_planner.costmap import LETHAL, CostField

SIZE = 0.05
FIELD = CostField(np.random.default_rng(0).integers(0, 200, (60, 80)).astype(np.uint8), SIZE, (-1.0, 2.0), 3.0)


def boxes() -> np.ndarray:
    """Return the cells as polygons (rows, columns)."""
    rows, columns = np.indices(FIELD.cells.shape)
    x, y = FIELD.origin[0] + SIZE * columns, FIELD.origin[1] + SIZE * rows
    return shapely.box(x, y, x + SIZE, y + SIZE)


@pytest.mark.parametrize("seed", range(20))
def test_whatever_cell_a_place_covers_is_lethal_and_those_off_it_are_as_they_were(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 6))
    ring = rng.uniform([-1.0, 2.0], [3.0, 5.0]) + rng.uniform(0.2, 1.5) * np.column_stack(
        [np.cos(angles), np.sin(angles)]
    )
    place, cells = shapely.convex_hull(shapely.MultiPoint(ring)), boxes()
    found = with_kept_out(FIELD, [ring]).cells
    assert (found[shapely.contains_properly(place, cells)] == LETHAL).all()
    off = shapely.distance(place, cells) > 2.0 * SIZE
    assert np.array_equal(found[off], FIELD.cells[off])


def test_several_places_none_and_places_that_are_elsewhere() -> None:
    one, other = np.array([[0.0, 3.0], [0.5, 3.0], [0.5, 3.5]]), np.array([[1.0, 4.0], [2.0, 4.0], [2.0, 4.4]])
    both = with_kept_out(FIELD, [one, other]).cells == LETHAL
    each = [with_kept_out(FIELD, [place]).cells == LETHAL for place in (one, other)]
    assert np.array_equal(both, each[0] | each[1]) and each[0].any() and each[1].any()
    assert with_kept_out(FIELD, []) is FIELD
    far = with_kept_out(FIELD, [1e6 + one, -1e300 * np.ones((3, 2))])
    assert np.array_equal(far.cells, FIELD.cells)
    around = with_kept_out(FIELD, [np.array([[-1e9, -1e9], [1e9, -1e9], [1e9, 1e9], [-1e9, 1e9]])])
    assert (around.cells == LETHAL).all()
