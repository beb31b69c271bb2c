"""`./pbrl record`: the recorder node, until Ctrl-C or for a time."""

from __future__ import annotations

import signal
import tempfile
from pathlib import Path

from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import new_folder_place
from pbrl_bringup.graph import Node, node_command, outside_environment, parse_namespace
from pbrl_bringup.processes import Programs
from pbrl_bringup.terminal import say

FOREVER = 10.0**9  # [s]


def command(out: Path, duration: float, namespace: str, domain: int | None) -> int:
    """Record every topic of the environment's graph, or of one robot's namespace.

    Raises:
        BringupError: `out` exists or cannot be made, a namespace that is none, or the recorder failed.
    """
    robot = parse_namespace(namespace)
    new_folder_place(out)
    node = Node(package="pbrl_bag", executable="recorder_node", parameters={"output": str(out)})
    with tempfile.TemporaryDirectory() as logs, Programs(Path(logs), outside_environment(domain)) as programs:
        recorder = programs.start("recorder", node_command("recorder", node, robot))
        try:  # Ctrl-C may come as soon as it is named
            say(f"pbrl: recording into {out}; {f'for {duration:g} s' if duration else 'Ctrl-C ends it'}")
            programs.ended("recorder", duration or FOREVER)
        except KeyboardInterrupt:
            say("pbrl: closing the bag")
        code = programs.stop("recorder")
        if code not in (0, -signal.SIGINT):
            raise BringupError(recorder.last_line())
        say(f"pbrl: {recorder.last_line()}")
    return 0
