"""What can be given hostile inputs, by name: readers of files, and nodes."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from pbrl_bringup.errors import BringupError
from pbrl_bringup.fuzz.worker import Subject

FILES = {
    "MCAP bag": 4.0,
    "MCAP bag not packed": 8.0,
    "bag to be played": 2.0,
    "SQLite bag": 1.0,
    "ROS 1 bag": 1.0,
    "bag with proposed mapping": 1.5,
    "bag with mapping": 4.0,
    "table with mapping": 9.0,
    "mapping": 4.0,
    "scene": 8.0,
    "office": 4.0,
    "desk": 5.0,
    "objective": 5.0,
    "graph": 3.0,
    "controller settings": 2.0,
    "cart settings": 3.0,
    "push plan": 3.0,
    "trajectory": 3.0,
    "priors": 3.0,
    "tags": 4.0,
    "agent's domain": 2.0,
    "household": 1.0,
    "map": 8.0,
    "map in simulator": 6.0,
    "model": 3.0,
    "model in simulator": 4.0,
    "posterior": 0.5,
    "report": 10.0,
    "drawing": 8.0,
    "primitives": 8.0,
    "environment": 8.0,
    "pushes learned": 3.0,
    "arm": 3.0,
    "robot": 2.0,
}
"""Readers of files, and the share of all inputs that each is given."""


NODES = {
    "heard by learners": 8.0,
    "body_controller_node": 4.0,
    "push_node": 4.0,
    "namo_node": 2.0,
    "tag_detector_node": 1.0,
    "costmap_node": 2.0,
    "lattice_planner_node": 2.0,
    "cart_controller_node": 3.0,
    "cart_navigator_node": 3.0,
    "tabletop_node": 2.0,
    "krang sim_node": 2.0,
    "pr2 sim_node": 1.0,
    "tabletop sim_node": 1.0,
}
"""Nodes, and the share of all inputs that each is given."""


def subject(name: str, place: Path) -> Subject:
    """Return what is called so. What it needs may be heavy, and is loaded only here.

    Raises:
        BringupError: nothing is.
    """
    if name in FILES:
        readers = import_module("pbrl_bringup.fuzz.readers")
        return readers.FileSubject(readers.READERS[name], place)
    if name in NODES:
        nodes = import_module("pbrl_bringup.ros.fuzzed_nodes")
        return nodes.NodeSubject(name) if name in nodes.NODES else nodes.ListenerSubject()
    raise BringupError(f"fuzz: expected one of {', '.join((*FILES, *NODES))}, got {name!r}")
