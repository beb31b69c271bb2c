"""The file that the nodes are told by: as shipped, and misspelt."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrl_control.errors import ControlError
from pbrl_control.settings import load_section
from pbrl_planner.cart.settings import CartParameters

SHIPPED = Path(__file__).resolve().parents[3] / "config/params/cart.yaml"


def test_what_is_shipped_stops_in_time_and_plans_as_wide_as_it_drives() -> None:
    said = load_section(SHIPPED, CartParameters, "settings")
    assert said.controller.stop_within == 0.3 and said.controller.period == 0.05
    assert said.global_costmap.resolution == said.local_costmap.resolution == 0.025
    assert said.global_costmap.inflation == said.local_costmap.inflation
    assert said.navigation.retry <= said.navigation.retry_most < said.navigation.give_up


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("stop_within: 0.3", "stop_within: -1.0", "stop_within"),
        ("retry: 2.0", "rettry: 2.0", "retry"),
        ("epsilon: 3.0", "epsilon: 0.5", "epsilon"),
        ("planner:", "[", "settings"),
        ("local_costmap:", "local_costmap:\n  stale: 0.15", "stale"),  # which nothing ever read
    ],
)
def test_a_mistake_is_one_line_that_names_the_key(tmp_path: Path, old: str, new: str, word: str) -> None:
    text = SHIPPED.read_text()
    assert old in text
    file = tmp_path / "cart.yaml"
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(ControlError, match=word) as caught:
        load_section(file, CartParameters, "settings")
    assert "\n" not in str(caught.value)
