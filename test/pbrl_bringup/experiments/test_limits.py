"""What a diagnosis cannot tell: posteriors that are ridges are drawn as such, and the figure is the same every time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bringup.experiments.limits import LENGTHS, friction_of, ridge, rows_of
from pbrl_bringup.experiments.limits_figure import Drawn, Friction, Ridge, draw
from pbrl_mismatch.effects.effect import Parameter
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.search.hypothesis import Hypothesis

COVARIANCE = np.array([[0.01, 0.0098], [0.0098, 0.01]])


def fitted(row: np.ndarray, parameters: tuple[Parameter, ...] = ()) -> Any:
    """Return a stand-in for a fit."""
    hypothesis = Hypothesis(("wrench_frame",), "free", parameters, row)
    peak = SimpleNamespace(
        coordinates=np.zeros((1, len(parameters))),
        covariance=lambda row: COVARIANCE,
        objective=SimpleNamespace(cuts=SimpleNamespace(track=SimpleNamespace(seen=np.full((5, 6), 0.03)))),
    )
    return SimpleNamespace(hypothesis=hypothesis, peak=peak, row=row)


@pytest.fixture
def mass() -> Ridge:
    free = tuple(Parameter(name, 1.0, 0.2, positive=True) for name in ("mass", "force_scale"))
    return ridge(fitted(neutral_row(), free), ("mass", "force_scale"), {"force_scale": 1.2}, 0)


def test_a_ridge_has_its_correlation_and_its_widths(mass: Ridge) -> None:
    assert mass.correlation == pytest.approx(0.98)
    assert mass.size == pytest.approx((np.sqrt(0.0198), np.sqrt(0.0002)))
    assert np.corrcoef(np.log(mass.draws).T)[0, 1] == pytest.approx(0.98, abs=0.01)
    assert np.isnan(mass.truth[0]) and mass.truth[1] == 1.2


def test_feet_that_stick_have_their_excess_at_rest_alone() -> None:
    row = neutral_row()
    row[[COLUMN["slide_mu"], COLUMN["breakaway_mu"], COLUMN["breakaway_speed"]]] = 0.05, 0.1, 0.02
    found = friction_of(fitted(row))
    assert found.sticking[0] == pytest.approx(0.15)
    assert found.sticking[-1] == pytest.approx(0.05)
    assert np.all(np.diff(found.sticking) <= 0.0) and np.all(found.plain == 0.05)


def test_the_figure_is_drawn_and_the_same_every_time(mass: Ridge, tmp_path: Path) -> None:
    speed = np.linspace(0.0, 0.15, 50)
    friction = Friction(speed, 0.05 + 0.1 * np.exp(-((speed / 0.02) ** 2)), np.full(50, 0.05), speed)
    odds = {"slope": 1.0, "free": -2.0, "gripped": 40.0}
    scales = {"viscous_drag": [1.0] * len(LENGTHS), "breakaway_friction": [1.5] * len(LENGTHS)}
    outline = np.array([[-0.6, -0.3], [0.6, -0.3], [0.6, 0.3], [-0.6, 0.3]])
    drawn = Drawn(mass, outline, None, mass, odds, LENGTHS, scales, friction)
    pages = []
    for name, ellipse in (("one", None), ("two", None), ("three", outline)):
        (tmp_path / name).mkdir()
        pages.append(draw(replace(drawn, ellipse=ellipse), tmp_path / name).read_bytes())
    assert pages[0] == pages[1] != pages[2]
    rows = rows_of(mass, mass, odds, scales, friction)
    assert [row.holds for row in rows] == [True] * len(rows)
    assert not rows_of(mass, mass, odds | {"slope": 9.0}, scales, friction)[2].holds
