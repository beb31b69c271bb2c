"""The layout for Foxglove places every panel; what its panels show is compared with running graphs in test/system."""

from __future__ import annotations

import json
from typing import Any

from pbrl_bringup.paths import workspace

LAYOUT = json.loads((workspace() / "config/foxglove/pbrl.json").read_text())


def placed(part: Any) -> set[str]:
    return {part} if isinstance(part, str) else placed(part["first"]) | placed(part["second"])


def test_every_panel_has_a_place_and_the_other_way_round() -> None:
    assert placed(LAYOUT["layout"]) == set(LAYOUT["configById"])
