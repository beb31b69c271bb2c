"""What only the map says is free, and nobody has looked at."""

from __future__ import annotations

import numpy as np

from pbrl_planner.costmap import Costmap, CostmapSettings, RangeScan, StaticMap


def test_what_only_the_map_says_is_free_costs_more_until_somebody_has_looked() -> None:
    cells = np.zeros((80, 80), dtype=np.int8)
    cells[:, 70:] = 100
    plain, wary = (
        Costmap.over(StaticMap(cells, 0.05), CostmapSettings(resolution=0.05, unseen=unseen)) for unseen in (0, 126)
    )
    for costmap in (plain, wary):
        costmap.observe(RangeScan(0.0, -0.2, 0.05, (0.1, 30.0), np.full(9, 2.0)), [1.0, 2.0, 0.0])
    before, after = plain.field(0.0).cells, wary.field(0.0).cells
    changed = before != after
    assert (after[changed] == 126).all() and (before[changed] < 126).all()
    assert changed[40, 5] and not changed[40, 30], "behind it, and where it looked"
    assert not changed[before >= 126].any(), "what is in the way stays so"
