"""The layout for Foxglove shows topics that there are, and every panel that it places."""

from __future__ import annotations

import json
from typing import Any

import pytest

from pbrl_bag.roles import CONTRACT, roles_of
from pbrl_bringup.paths import workspace

LAYOUT = json.loads((workspace() / "config/foxglove/pbrl.json").read_text())
OURS = "\n".join(path.read_text() for path in (workspace() / "src").glob("*/*/**/*.py"))


def placed(part: Any) -> set[str]:
    return {part} if isinstance(part, str) else placed(part["first"]) | placed(part["second"])


def topics() -> set[str]:
    found: set[str] = set()
    for panel in LAYOUT["configById"].values():
        found |= set(panel.get("topics", {}))
        found |= {each["value"].partition(".")[0] for each in panel.get("paths", [])}
        found |= {panel["topicPath"]} if "topicPath" in panel else set()
    return found


def test_every_panel_has_a_place_and_the_other_way_round() -> None:
    assert placed(LAYOUT["layout"]) == set(LAYOUT["configById"])


@pytest.mark.parametrize("topic", sorted(topics()))
def test_every_topic_is_published_by_something_of_ours(topic: str) -> None:
    assert roles_of(topic, CONTRACT) or f'"{topic}"' in OURS or f'"{topic[1:]}"' in OURS
