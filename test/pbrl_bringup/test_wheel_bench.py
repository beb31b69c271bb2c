"""What the wheel's bench scores against: the swivel axis, and beside it where the locked wheel touches the floor."""

from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.catalogue import OfficeTable
from bullet_sim.scene import load_scene
from pbrl_bringup.benches.wheel import Trial, locked_contacts, rows_of
from pbrl_bringup.errors import BringupError


def test_a_locked_wheel_touches_the_floor_its_trail_beside_its_axis() -> None:
    scene = load_scene("locked_caster")
    table = scene.bodies["table_a"]
    assert isinstance(table, OfficeTable)
    axis = np.array(table.swivels["rear_right"])
    touching = [locked_contacts(scene, "table_a", seed) for seed in (0, 1)]
    for points in touching:
        assert points.shape == (1, 2)
        assert np.hypot(*(points[0] - axis)) == pytest.approx(table.casters.trail, abs=1e-3)
    assert np.hypot(*(touching[0] - touching[1])[0]) > 1e-3, "another seed leaves the caster at another angle"


def test_the_row_is_scored_against_the_axis() -> None:
    trials = [Trial(seed, 0.03 + 0.03 * seed, 0.01, 1.0, 0.1, 1.0, 0.1, 1.0) for seed in range(2)]
    row = rows_of(trials)[0]
    assert (row.value, row.against["worst_m"], row.against["worst_to_contact_m"]) == (1, 0.06, 0.01)


def test_a_body_without_casters_is_refused() -> None:
    scene = load_scene("locked_caster")
    block = {"kind": "block", "polygon": [[0, 0], [0.2, 0], [0, 0.2]], "height": 0.5, "nominal_mass": 3.0}
    plain = scene.model_dump() | {"concealed": {}}
    plain["bodies"] = {"box": block | {"pose": [3.0, 1.0, 0.0]}}
    with pytest.raises(BringupError, match="casters"):
        locked_contacts(type(scene).model_validate(plain), "box", 0)
