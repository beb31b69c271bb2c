"""The told oracle: what "as strong as can be detected" means, against draws and closed forms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bringup.concealed.oracle import (
    JITTER,
    LEVEL,
    PLAIN,
    POWER,
    STARTS,
    THOROUGH,
    Oracle,
    starts_told,
)
from pbrl_mismatch.effects.effect import Parameter
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.observability.power import needed
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.hypothesis import BENT, Hypothesis


def fitted(parameters: int, misfit: float, beside: float = 0.0) -> Any:
    """Return what an oracle looks at: so many free parameters and a misfit, its prior's part nothing."""
    objective = SimpleNamespace(
        likelihood=lambda value: -0.5 * value, prior_misfit=lambda coordinates: np.zeros(len(coordinates))
    )
    peak = SimpleNamespace(objective=objective, misfit=np.array([misfit]), coordinates=np.zeros((1, parameters)))
    return SimpleNamespace(
        hypothesis=SimpleNamespace(parameters=range(parameters)), peak=peak, beside=beside, traced=None
    )


@pytest.mark.parametrize("times", [0.5, 1.0, 3.0])
def test_strength_counts_in_units_of_the_least_that_is_found(times: float) -> None:
    # The expected gain of a law with d numbers more is their non-centrality, the strength's square, and d by chance.
    gain = times**2 * needed(4, LEVEL, POWER) + 4.0
    found = Oracle(fitted(7, 1000.0 - gain), fitted(3, 1000.0))
    assert found.times_detectable == pytest.approx(times)
    beside = Oracle(fitted(7, 1000.0, 0.5 * gain), fitted(3, 1000.0))
    assert beside.times_detectable == pytest.approx(times)


def test_of_several_effects_the_faintest_counts() -> None:
    told, none = fitted(7, 1000.0 - 16.0 * needed(4, LEVEL, POWER) - 4.0), fitted(3, 1000.0)
    alone = fitted(3, told.peak.misfit[0] + 2.25 * needed(4, LEVEL, POWER) + 4.0)
    assert Oracle(told, none).times_detectable == pytest.approx(4.0)
    assert Oracle(told, none, (none, alone)).times_detectable == pytest.approx(1.5)


def test_nothing_gained_is_no_strength() -> None:
    assert Oracle(fitted(7, 999.0), fitted(3, 1000.0)).times_detectable == 0.0


def asked(columns: list[str]) -> Hypothesis:
    """Return a hypothesis with some columns, none of which is positive."""
    return Hypothesis((), "free", tuple(Parameter(column, 0.0, 2.0) for column in columns), np.zeros(len(columns)))


def test_its_starts_lie_beside_the_truth_on_every_scale() -> None:
    columns = [each for each in COLUMN if each not in BENT][:50]
    starts = starts_told(asked(columns), dict.fromkeys(columns, 3.0), None, STARTS, np.random.default_rng(0))
    np.testing.assert_array_equal(starts[:PLAIN], 3.0)
    off = np.sqrt(np.mean(((starts[PLAIN:] - 3.0) / 2.0) ** 2, axis=1))
    assert np.all(np.diff(off) < 0.0) and off[-1] == pytest.approx(JITTER[1], rel=0.3)


def test_every_start_is_climbed_from_and_what_is_best_over_short_windows_is_not_the_only_one_left() -> None:
    options = DiagnoseOptions().model_copy(update=THOROUGH)
    assert options.candidates == options.keep[0] == STARTS and min(options.keep) > 1
    assert len(options.keep) == len(options.iterations) == len(options.windows)


def test_it_starts_from_a_body_as_it_was_believed_to_be_as_well() -> None:
    # Without the patch that holds it a body is taken for four times as heavy: from there nothing leads back.
    base: Any = SimpleNamespace(
        hypothesis=asked(["mass", "load_x"]), peak=SimpleNamespace(coordinates=np.array([[1.5, 0.2]]))
    )
    hypothesis = asked(["mass", "load_x", "drag_linear"])
    starts = starts_told(hypothesis, {"drag_linear": 4.0}, base, STARTS, np.random.default_rng(0))
    np.testing.assert_array_equal(starts[:PLAIN], [[1.5, 0.2, 4.0], [1.5, 0.2, 4.0], [0.0, 0.2, 4.0]])
    beside = np.abs(starts[PLAIN:, 0] - np.where(np.arange(PLAIN, STARTS) % 2, 1.5, 0.0))
    assert np.all(beside < 4.0 * 2.0 * np.geomspace(*JITTER, STARTS - PLAIN))
    kept = starts_told(hypothesis, {"mass": 0.7, "drag_linear": 4.0}, base, STARTS, np.random.default_rng(0))
    assert kept[2, 0] == 0.7  # what is told is not believed


def test_it_starts_from_where_the_body_is_without_the_effect_as_well() -> None:
    # One wheel between two does what both do: from the true place of one of them nothing leads there.
    base: Any = SimpleNamespace(
        hypothesis=asked(["mass", "wheel_x"]), peak=SimpleNamespace(coordinates=np.array([[0.5, -0.7]]))
    )
    told = {"wheel_x": 0.2, "drag_linear": 4.0}
    starts = starts_told(asked(["mass", "wheel_x", "drag_linear"]), told, base, STARTS, np.random.default_rng(0))
    np.testing.assert_array_equal(starts[0], [0.5, 0.2, 4.0])
    np.testing.assert_array_equal(starts[1], [0.5, -0.7, 4.0])


def test_what_is_better_along_the_path_counts() -> None:
    told, none = fitted(7, 900.0), fitted(3, 1000.0)
    weak = Oracle(told, none).times_detectable
    told.traced = SimpleNamespace(log_posterior=-0.5 * 800.0)
    assert Oracle(told, none).times_detectable > weak
    none.traced = SimpleNamespace(log_posterior=-0.5 * 790.0)
    assert Oracle(told, none).times_detectable == 0.0
