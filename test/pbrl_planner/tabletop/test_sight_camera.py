"""Pictures of a camera that cannot be: nothing is seen, at once."""

from __future__ import annotations

import time

import numpy as np
import pytest

from pbrl_model.tags.calibration import calibration
from pbrl_planner.tabletop.desk import Table
from pbrl_planner.tabletop.sight import ItemFinder


@pytest.mark.parametrize("focal", [1e9, 1e12, 1e300])
def test_a_table_that_lies_beyond_all_pictures_is_not_looked_at(focal: float) -> None:
    camera = calibration("x", (640, 480), [focal, 0, 320, 0, focal, 240, 0, 0, 1], (), (0, 0, 2.0), (1.0, 0, 0, 0))
    begun = time.process_time()
    sight = ItemFinder(Table(np.array([-0.5, -0.4]), np.array([0.5, 0.4])), []).find(
        np.zeros((480, 640), np.uint8), camera
    )
    assert sight.poses == {} and sight.strange == ()
    assert time.process_time() - begun < 2.0, "OpenCV draws row by row, also rows that nobody sees"
