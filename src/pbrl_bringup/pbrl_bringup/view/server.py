"""The web application behind the page: three files of our own and the data, nothing from anywhere else.

It answers this machine only: it is bound to the loopback address, refuses requests under any other host's name (a page
of a stranger that has its name resolve to 127.0.0.1 gets nothing), and tells the browser to load nothing from outside.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator
from typing import Any, Protocol

from starlette.applications import Starlette
from starlette.datastructures import MutableHeaders
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from pbrl_bringup.report_page import TEMPLATES

HOSTS = ["127.0.0.1", "localhost"]
SCRIPTS = ("drawing", "player", "posterior", "view_data", "view_scene", "view_plots", "view_side", "view")
STYLES = ("report", "view")
MOST_SAMPLES = 20_000
"""Samples of a stream that one answer holds at most."""

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
}


class Source(Protocol):
    """Where the page's data come from: a bag, or a running graph."""

    live: bool

    def data(self) -> dict[str, Any]:
        """Return all that is still and the whole of the streams, coarsely."""

    def detail(self, start: float, end: float, most: int) -> dict[str, Any]:
        """Return the streams between two times [s], at most `most` samples of each."""

    def events(self) -> AsyncIterator[str]:
        """Yield what is new as server-sent events; nothing where nothing can be."""


class GuardHeaders:
    """Adds the headers that shut out everything from outside to every answer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        await self._app(scope, receive, guarded)


def make_app(source: Source) -> Starlette:
    """Return the application that serves the page of a source."""
    page = (TEMPLATES / "view.html").read_text(encoding="utf-8")
    script = '"use strict";\n' + "\n".join(_template(f"{name}.js") for name in SCRIPTS)
    style = "\n".join(_template(f"{name}.css") for name in STYLES)

    def data(_: Request) -> Response:
        return JSONResponse({**source.data(), "live": source.live})

    def detail(request: Request) -> Response:
        asked = request.query_params
        try:
            start, end = float(asked["from"]), float(asked["to"])
            most = int(asked["most"])
        except (KeyError, ValueError):
            start = end = math.nan
            most = 0
        if not (start <= end < math.inf and start > -math.inf and 2 <= most <= MOST_SAMPLES):
            return PlainTextResponse(
                f"expected from <= to [s] and most of 2 to {MOST_SAMPLES}, got {dict(asked)}", status_code=400
            )
        return JSONResponse(source.detail(start, end, most))

    def events(_: Request) -> Response:
        if not source.live:
            return PlainTextResponse("expected a running graph, this is a recording", status_code=404)
        return StreamingResponse(source.events(), media_type="text/event-stream")

    return Starlette(
        routes=[
            Route("/", lambda _: Response(page, media_type="text/html")),
            Route("/view.js", lambda _: Response(script, media_type="text/javascript")),
            Route("/view.css", lambda _: Response(style, media_type="text/css")),
            Route("/data", data),
            Route("/detail", detail),
            Route("/events", events),
        ],
        middleware=[Middleware(GuardHeaders), Middleware(TrustedHostMiddleware, HOSTS, www_redirect=False)],
    )


def _template(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")
