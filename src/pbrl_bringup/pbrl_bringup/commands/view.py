"""`./pbrl view BAG`: a page on this machine that shows a recording, or a running graph."""

from __future__ import annotations

import os
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from pbrl_bringup.errors import BringupError
from pbrl_bringup.terminal import say
from pbrl_bringup.view.bag import BagSource, read_shown
from pbrl_bringup.view.diagnosed import read_diagnosed
from pbrl_bringup.view.live import LiveGraph
from pbrl_bringup.view.server import Source, make_app
from pbrl_bringup.view.serving import listening, serve

LIVE = "live"


def command(
    what: str,
    mapping: Path | None,
    models: Sequence[Path],
    report: Path | None,
    port: int | None,
    opened: bool | None,
    namespace: str,
    domain: int | None,
) -> int:
    """Serve the page until Ctrl-C.

    Args:
        what: a bag, or "live".
        mapping: which topic plays which role, or None.
        models: files of learned models.
        report: report.json of a diagnosis, or None.
        port: to serve on; see `listening`.
        opened: whether to open a browser; None: where there is a display.
        namespace: of the robot that is shown live; empty: the root.
        domain: ROS_DOMAIN_ID of the graph; None: the environment's.

    Raises:
        BagError: the bag cannot be read.
        ModelError: a model's file cannot be read.
        BringupError: a file that was given is not what it should be, or the port is taken.
    """
    show = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")) if opened is None else opened

    def ready(address: str) -> None:
        say(f"pbrl: {what}: {address} shows it; Ctrl-C ends it")
        if show:
            webbrowser.open(address)

    with _source(what, mapping, models, report, namespace, domain) as source:
        try:
            serve(make_app(source), listening(port), ready)
        except KeyboardInterrupt:
            say("pbrl: stopping")
    return 0


@contextmanager
def _source(
    what: str, mapping: Path | None, models: Sequence[Path], report: Path | None, namespace: str, domain: int | None
) -> Iterator[Source]:
    """Yield where the page's data come from. What only one kind needs takes seconds to load, and is loaded for it."""
    if what != LIVE:
        learned = import_module("pbrl_bringup.view.learned").model_files(models) if models else {}
        diagnosed = None if report is None else read_diagnosed(report)
        yield BagSource(read_shown(Path(what), mapping, learned, diagnosed))
        return
    if models or report or mapping:
        raise BringupError(
            "view live: expected no --model, --report or --map: the graph says these; give a BAG for them"
        )
    robot = import_module("pbrl_bringup.graph").parse_namespace(namespace)
    graph = LiveGraph(f"the running graph{' of ' if robot else ''}{robot}")
    listener = import_module("pbrl_bringup.ros.view_listener").ViewListener
    with listener(graph.wants, graph.hear, domain, robot):
        yield graph
