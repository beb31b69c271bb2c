"""Runs the web application on this machine's loopback address until Ctrl-C."""

from __future__ import annotations

import errno
import socket
from collections.abc import Callable

import uvicorn
from starlette.applications import Starlette

from pbrl_bringup.errors import BringupError

ADDRESS = "127.0.0.1"
PORT = 8765
GRACE = 1
"""Seconds that pages have to hear of the end."""


def listening(port: int | None) -> socket.socket:
    """Return a socket that listens on the loopback address.

    Args:
        port: to listen on; 0: any that is free; None: `PORT`, or any that is free where that is taken.

    Raises:
        BringupError: the port is taken or not ours to use.
    """
    found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind((ADDRESS, PORT if port is None else port))
        found.listen()
    except OSError as error:
        found.close()
        if port is None and error.errno in (errno.EADDRINUSE, errno.EACCES):
            return listening(0)
        raise BringupError(f"--port {port}: cannot listen there: {error.strerror}; choose another, 0: any") from error
    return found


def serve(app: Starlette, at: socket.socket, ready: Callable[[str], None]) -> None:
    """Serve until Ctrl-C or SIGTERM.

    Args:
        app: the application.
        at: listening socket; closed at the end.
        ready: told the page's address as soon as it can be opened.
    """

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            ready(f"http://{ADDRESS}:{at.getsockname()[1]}/")

    config = uvicorn.Config(
        app, log_level="warning", access_log=False, server_header=False, timeout_graceful_shutdown=GRACE, lifespan="off"
    )
    with at:
        Server(config).run(sockets=[at])
