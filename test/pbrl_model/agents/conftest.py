from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pbrl_model.agents.domain import Domain
from pbrl_model.agents.domain_file import load_domain, parse_domain

CONFIG = Path(__file__).resolve().parents[3] / "config" / "experiments"


@pytest.fixture
def cart() -> Domain:
    return load_domain(CONFIG / "shopping_cart.yaml")


@pytest.fixture
def apartment() -> Domain:
    return load_domain(CONFIG / "apartment.yaml")


@pytest.fixture
def two_boxes() -> Callable[[bool], Domain]:
    return _two_boxes


def _two_boxes(goal_of_second: bool) -> Domain:
    """A small box in the only door between two rooms, and a larger one that has to go through."""
    small: dict[str, object] = {
        "footprint": [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]],
        "start": [2.05, 1.0, 0.0],
    }
    if goal_of_second:
        small["goal"] = {"position": [3.4, 1.7], "position_tolerance": 0.1}
    return parse_domain(
        {
            "name": "two_boxes",
            "room": {
                "outline": [[0, 0], [4, 0], [4, 2], [0, 2]],
                "walls": [
                    [[2.0, 0.0], [2.1, 0.0], [2.1, 0.6], [2.0, 0.6]],
                    [[2.0, 1.4], [2.1, 1.4], [2.1, 2.0], [2.0, 2.0]],
                ],
            },
            "objects": {
                "large": {
                    "footprint": [[-0.3, -0.25], [0.3, -0.25], [0.3, 0.25], [-0.3, 0.25]],
                    "start": [0.7, 1.0, 0.0],
                    "goal": {"position": [3.2, 0.6], "position_tolerance": 0.1},
                },
                "small": small,
            },
            "concealed": {
                "large": {"mass": 10.0, "floor_friction": 0.2},
                "small": {"mass": 4.0, "floor_friction": 0.2},
            },
        }
    )
