"""`./pbrl play BAG`: the player node, to the end of the bag."""

from __future__ import annotations

import tempfile
from pathlib import Path

from pbrl_bag import describe
from pbrl_bringup.errors import BringupError
from pbrl_bringup.graph import Node, node_command, outside_environment, parse_namespace
from pbrl_bringup.processes import Programs
from pbrl_bringup.terminal import progress, say


def command(bag: Path, rate: float, namespace: str, domain: int | None) -> int:
    """Publish what a bag holds, at its own pace times `rate`, as that of a robot with a namespace where one is given.

    Raises:
        BagError: the bag cannot be read.
        BringupError: a namespace that is none, or the player failed.
    """
    robot = parse_namespace(namespace)
    info = describe(bag)
    node = Node(package="pbrl_bag", executable="player_node", parameters={"bag": str(bag), "rate": float(rate)})
    with tempfile.TemporaryDirectory() as logs, Programs(Path(logs), outside_environment(domain)) as programs:
        player = programs.start("player", node_command("player", node, robot))
        say(f"pbrl: playing {bag}, {info.duration:.1f} s at {rate:g} times its pace; Ctrl-C ends it")
        total = info.duration / rate
        with progress("playing", total=total) as bar:
            played = 0.0
            while not programs.ended("player", 0.2):
                bar(played := min(played + 0.2, total))
        if player.process.returncode:
            raise BringupError(player.last_line())
        say(f"pbrl: {player.last_line()}")
    return 0
