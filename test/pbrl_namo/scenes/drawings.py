"""Drawings that the tests of the importer share."""

from __future__ import annotations

from pbrl_namo.scenes.svg import SvgScene, read_svg

ROBOT = '<path id="robot_0" type="shape" d="M 80,80 h 40 v 40 h -40 z"/>'
GOAL = '<circle id="goal_0" cx="800" cy="400" r="20"/>'
CONFIG = '<namo_config cell_size_cm="10"><agent agent_id="robot_0"><goal goal_id="goal_0"/></agent></namo_config>'
BOX = '<path id="box" type="movable" d="M 400,200 h 100 v 50 h -100 z"/>'


def drawing(content: str = BOX, *, head: str = 'viewBox="0 0 1000 500"', ends: str = CONFIG + ROBOT + GOAL) -> bytes:
    return f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{ends}{content}</svg>'.encode()


def read(content: str = BOX, **told: str) -> SvgScene:
    return read_svg(drawing(content, **told))
