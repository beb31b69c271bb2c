"""A headless Chromium that is driven over its DevTools protocol: real clicks, keys and wheel turns, no extra library.

The protocol runs through a pair of pipes (`--remote-debugging-pipe`): nothing listens on a port.
"""

from __future__ import annotations

import base64
import json
import os
import select
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pbrl_bringup.debian import ensure_program
from pbrl_bringup.errors import BringupError

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update", "--remote-debugging-pipe"),
)
ANSWER = 60.0
"""Seconds that the browser has for an answer."""
KEYS = {
    " ": ("Space", 32, " "), "ArrowLeft": ("ArrowLeft", 37, ""), "ArrowRight": ("ArrowRight", 39, ""),
    "Home": ("Home", 36, ""), "End": ("End", 35, ""), "Escape": ("Escape", 27, ""), "Tab": ("Tab", 9, ""),
}  # fmt: skip
"""Code, number and text of keys that are no letters."""
SHIFT = 8
LAUNCH = """import fcntl, os, sys
pipes = [fcntl.fcntl(int(each), fcntl.F_DUPFD, 10) for each in sys.argv[1:3]]
os.dup2(pipes[0], 3), os.dup2(pipes[1], 4)
os.execv(sys.argv[3], sys.argv[3:])"""
"""The browser reads its third and writes its fourth file; a shell cannot move files whose numbers have two digits."""


class Browser:
    """One page of a headless Chromium; a context manager.

    Attributes:
        complaints: what the page wrote to its console as warning or error, and errors that nothing caught.

    Args:
        width: of the window [px].
        height: of the window [px].
        dark: whether the reader prefers dark pages.

    Raises:
        BringupError: there is no Chromium, or it does not answer.
    """

    def __init__(self, width: int = 1366, height: int = 768, *, dark: bool = False) -> None:
        self.complaints: list[str] = []
        self._size, self._dark = (width, height), dark
        self._number, self._session, self._buffer = 0, "", b""
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        program = ensure_program("chromium", "chromium", "a page that is looked at")
        profile = self._stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
        to_child, self._write = os.pipe()
        self._read, from_child = os.pipe()
        launch = [sys.executable, "-ISc", LAUNCH, str(to_child), str(from_child)]
        self._process = subprocess.Popen(
            [*launch, program, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
            pass_fds=(to_child, from_child),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(to_child)
        os.close(from_child)
        self._stack.callback(self._end)
        try:
            page = next(each for each in self._ask("Target.getTargets")["targetInfos"] if each["type"] == "page")
            self._session = self._ask("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
            for domain in ("Page", "Runtime", "Log"):
                self._ask(f"{domain}.enable")
            width, height = self._size
            self._ask(
                "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
            )
            scheme = {"name": "prefers-color-scheme", "value": "dark" if self._dark else "light"}
            self._ask("Emulation.setEmulatedMedia", features=[scheme])
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stack.close()

    def open(self, address: str) -> None:
        """Go to an address; returns as soon as it has answered, before the page is drawn."""
        failed = self._ask("Page.navigate", url=address).get("errorText")
        if failed:
            raise BringupError(f"{address}: the browser expected a page, got {failed}")

    def run(self, script: str) -> Any:
        """Return the value of an expression in the page; a promise is waited for.

        Raises:
            BringupError: it throws.
        """
        answer = self._ask("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise BringupError(f"{script}: expected a value, got {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def wait(self, condition: str, seconds: float = 20.0) -> Any:
        """Wait until an expression in the page is true, and return its value.

        Raises:
            BringupError: it does not become true.
        """
        deadline = time.monotonic() + seconds
        while not (value := self.run(condition)):
            if time.monotonic() > deadline:
                raise BringupError(f"expected {condition} within {seconds:g} s, got {value!r}; {self.complaints}")
            self.run("new Promise((done) => requestAnimationFrame(done))")
        return value

    def place(self, selector: str) -> tuple[float, float, float, float]:
        """Return left, top, width and height [px] of an element in the window."""
        box = self.run(
            f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            " return [b.x, b.y, b.width, b.height]; })()"
        )
        return (float(box[0]), float(box[1]), float(box[2]), float(box[3]))

    def click(self, selector: str, across: float = 0.5, down: float = 0.5) -> None:
        """Click an element, at a share of its width and height."""
        self.drag(selector, [(across, down)])

    def drag(self, selector: str, way: list[tuple[float, float]]) -> None:
        """Press in an element at the first place of a way, go along it, and release; shares of width and height."""
        left, top, width, height = self.place(selector)
        points = [(left + x * width, top + y * height) for x, y in way]
        self._mouse("mouseMoved", points[0])
        self._mouse("mousePressed", points[0], buttons=1)
        for point in points[1:]:
            self._mouse("mouseMoved", point, buttons=1)
        self._mouse("mouseReleased", points[-1])

    def wheel(self, selector: str, turn: float, across: float = 0.5, down: float = 0.5) -> None:
        """Turn the wheel over an element; negative is away from the hand."""
        left, top, width, height = self.place(selector)
        x, y = left + across * width, top + down * height
        self._ask("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=turn)

    def press(self, key: str, *, shift: bool = False) -> None:
        """Press and release a key, named as in a KeyboardEvent."""
        code, number, text = KEYS.get(key, (key, 0, key))
        common = {"key": key, "code": code, "windowsVirtualKeyCode": number, "modifiers": SHIFT * shift}
        self._ask("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", text=text, **common)
        self._ask("Input.dispatchKeyEvent", type="keyUp", **common)

    def picture(self, path: Path) -> None:
        """Write what is seen as a PNG file."""
        path.write_bytes(base64.b64decode(self._ask("Page.captureScreenshot", format="png")["data"]))

    def printed(self, path: Path) -> None:
        """Write the page as it is printed as a PDF file."""
        answer = self._ask("Page.printToPDF", printBackground=False, preferCSSPageSize=True)
        path.write_bytes(base64.b64decode(answer["data"]))

    def _mouse(self, kind: str, at: tuple[float, float], buttons: int = 0) -> None:
        button = "none" if kind == "mouseMoved" and not buttons else "left"
        self._ask("Input.dispatchMouseEvent", type=kind, x=at[0], y=at[1], button=button, buttons=buttons, clickCount=1)

    def _ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol and return its result; what else is told meanwhile is noted."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self._number:
            self._note(answer)
        if "error" in answer:
            raise BringupError(f"{method}: the browser refused: {answer['error'].get('message')}")
        result: dict[str, Any] = answer["result"]
        return result

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], ANSWER)
            data = os.read(self._read, 1 << 16) if ready else b""
            if not data:
                raise BringupError(f"expected an answer of the browser within {ANSWER:g} s, got none")
            self._buffer += data
        message, _, self._buffer = self._buffer.partition(b"\0")
        found: dict[str, Any] = json.loads(message)
        return found

    def _note(self, event: dict[str, Any]) -> None:
        told = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            details = told["exceptionDetails"]
            self.complaints.append(details.get("exception", {}).get("description") or details["text"])
        elif event.get("method") == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.complaints.append(" ".join(str(each.get("value")) for each in told["args"]))
        elif event.get("method") == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.complaints.append(f"{told['entry']['text']} {told['entry'].get('url', '')}")

    def _end(self) -> None:
        os.close(self._write)  # the browser leaves when nobody can tell it anything
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._read)
