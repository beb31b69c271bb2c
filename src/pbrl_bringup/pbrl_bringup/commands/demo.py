"""`./pbrl demo`: Krang pushes a table, the recording is learned from, a page shows it."""

from __future__ import annotations

import os
import time
from pathlib import Path

from pbrl_bringup.demo import DemoSettings, run_demo
from pbrl_bringup.files import output_folder
from pbrl_bringup.terminal import output, say, styled


def command(out: Path, seed: int, gui: bool | None) -> int:
    """Run the demo and print the page's path as the last line.

    Raises:
        BringupError: a node failed; its last words are in the message.
    """
    window = bool(os.environ.get("DISPLAY")) and gui is not False if gui is None else gui
    started = time.monotonic()
    page = run_demo(DemoSettings(out=output_folder(out), seed=seed, gui=window), say)
    say(styled(f"done in {time.monotonic() - started:.0f} s; open the page in any browser:", "dim"))
    output().print(str(page.resolve()))
    return 0
