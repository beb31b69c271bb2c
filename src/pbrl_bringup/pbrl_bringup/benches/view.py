"""The viewer on ten minutes of five objects: how soon there is a picture, and how many a second while one slides.

The recording is made from closed forms, with noise and at the simulator's rates: what is measured is reading, serving
and drawing. The times are those of a person: from the command to the picture, and pictures while the slider is dragged
with real mouse events in a headless Chromium.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from pbrl_bag import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream, write_recording
from pbrl_bringup.benches.rows import Measured, at_least, at_most
from pbrl_bringup.browser import Browser
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import removed_afterwards

Array = NDArray[np.float64]

OBJECTS, SECONDS, QUICK_SECONDS = 5, 600.0, 60.0
TAGS, WRISTS = 15.0, 100.0  # [Hz] as the simulator publishes
HOLD = 20.0  # [s] that an object is held
DRAG_SECONDS, QUICK_DRAG = 6.0, 2.0
PICTURE = "performance.getEntriesByName('first-picture').length"
WATCHING = """(() => {
window.frames_seen = []; window.moved = 0;
let last = "";
const look = (t) => {
  frames_seen.push(t);
  const now = document.querySelector(".curves .cursor").getAttribute("transform");
  if (now !== last) { moved += 1; last = now; }
  requestAnimationFrame(look);
};
requestAnimationFrame(look);
return true; })()"""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Make the recording, open it and slide.

    Args:
        seed: of its noise.
        quick: a minute instead of ten.
        out: folder for the recording, which is removed afterwards, and the picture.
    """
    seconds = QUICK_SECONDS if quick else SECONDS
    bag = out / "bag"
    with removed_afterwards(bag):
        write_recording(long_recording(seconds, np.random.default_rng(seed)), bag)
        size = sum(file.stat().st_size for file in bag.iterdir())
        with Browser() as browser:
            started = time.perf_counter()
            command = [sys.executable, "-m", "pbrl_bringup", "view", str(bag), "--no-open", "--port", "0"]
            with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
                try:
                    address = address_of(server)
                    served = time.perf_counter() - started
                    browser.open(address)
                    browser.wait(PICTURE, 60.0)
                    shown = time.perf_counter() - started
                    page = browser.run("performance.getEntriesByName('first-picture')[0].startTime") / 1000.0
                    rate, worst, drawn = _slide(browser, QUICK_DRAG if quick else DRAG_SECONDS)
                    browser.picture(out / "view.png")
                finally:
                    server.terminate()
            complaints = list(browser.complaints)
    what = f"{seconds / 60:g} min, {OBJECTS} objects"
    return Measured(
        [
            at_most(f"first picture, {what}", page, "s", 2.0, from_the_command=shown, until_served=served),
            at_least("frames a second of the browser while sliding", rate, "1/s", 30.0, longest_between=worst),
            at_least("new pictures a second while sliding", drawn, "1/s", 30.0),
            at_most("errors and warnings on the console", len(complaints), "1", 0),
        ],
        {"complaints": complaints, "bag_bytes": size},
    )


def address_of(server: subprocess.Popen[str]) -> str:
    """Return the address that a viewer says it serves.

    Raises:
        BringupError: it says something else.
    """
    assert server.stderr is not None
    line = server.stderr.readline()
    found = re.search(r"http://127\.0\.0\.1:\d+/", line)
    if found is None:
        raise BringupError(f"view: expected the address of a page, got {line.strip()!r}")
    return found.group()


def _slide(browser: Browser, seconds: float) -> tuple[float, float, float]:
    """Drag the slider; return pictures a second, the longest time between two [s], and new ones a second."""
    browser.run(WATCHING)
    places = 0.5 + 0.45 * np.sin(np.linspace(0.0, 2.0 * np.pi, round(60 * seconds)))
    browser.click("#player input", 0.5)
    begin = browser.run("(() => { frames_seen.length = 0; moved = 0; return performance.now(); })()")
    browser.drag("#player input", [(float(each), 0.5) for each in places])
    end = browser.run("performance.now()")
    seen = np.array(browser.run("frames_seen"), dtype=float)
    moved = float(browser.run("moved"))
    long = (end - begin) / 1000.0
    return len(seen) / long, float(np.diff(seen).max(initial=0.0)) / 1000.0, moved / long


def long_recording(seconds: float, rng: np.random.Generator) -> Recording:
    """Return a recording of five tables that two grippers push one after another along arcs.

    Args:
        seconds: its length [s].
        rng: of the noise.
    """
    tags, wrists = np.arange(0.0, seconds, 1.0 / TAGS), np.arange(0.0, seconds, 1.0 / WRISTS)
    starts = np.array([(2.2 * (k % 3), 2.4 * (k // 3)) for k in range(OBJECTS)], dtype=float)
    turn = np.floor(tags / HOLD).astype(int)
    grasps, poses = [], {}
    for k in range(OBJECTS):
        held = turn % OBJECTS == k
        way = np.cumsum(held) / TAGS * 0.08
        pose = np.column_stack([starts[k, 0] + 0.5 * np.sin(way), starts[k, 1] + 0.5 * (1 - np.cos(way)), 0.6 * way])
        poses[f"table_{k}"] = _stream(tags, pose + rng.normal(0.0, [0.002, 0.002, 0.004], pose.shape))
    hand = np.zeros((len(tags), 3))
    for k in range(OBJECTS):
        held = turn % OBJECTS == k
        x, y, theta = (poses[f"table_{k}"].position[held, 0], poses[f"table_{k}"].position[held, 1], 0.0)
        hand[held] = np.column_stack([x - 0.6, y, np.full(held.sum(), theta)])
    hand = uniform_filter1d(hand, round(2.0 * TAGS), axis=0)  # it walks from one table to the next
    for number in range(int(seconds // HOLD)):
        contact = np.array([-0.6, 0.2])
        for side, sign in (("left", 1.0), ("right", -1.0)):
            span = (number * HOLD + 1.0, (number + 1) * HOLD - 1.0)
            grasps.append(Grasp(side, f"table_{number % OBJECTS}", *span, contact * [1.0, sign]))
    pushing = (wrists % HOLD > 1.0) & (wrists % HOLD < HOLD - 1.0)
    force = np.column_stack(
        [-20.0 * pushing * np.sin(np.pi * (wrists % HOLD) / HOLD), 4.0 * np.sin(wrists), -9.0 + 0 * wrists]
    )
    outline = np.array([(-0.6, -0.375), (0.6, -0.375), (0.6, 0.375), (-0.6, 0.375)])
    casters = 0.9 * outline
    return Recording(
        path=Path("bench"),
        bodies={
            name: BodyGeometry(name, outline, 0.75, 30.0, True, np.append(stream.position[0, :2], 0.0), casters)
            for name, stream in poses.items()
        },
        object_poses=poses,
        gripper_poses={
            side: _stream(tags, hand + rng.normal(0.0, 0.001, hand.shape) + [0.0, 0.2 * sign, 0.0])
            for side, sign in (("left", 1.0), ("right", -1.0))
        },
        wrenches={
            side: WrenchStream(
                wrists, force + rng.normal(0.0, 0.4, force.shape), rng.normal(0.0, 0.05, force.shape), "gripper"
            )
            for side in ("left", "right")
        },
        grasps=tuple(grasps),
        room=np.array([(-2.0, -2.0), (7.0, -2.0), (7.0, 5.0), (-2.0, 5.0)]),
    )


def _stream(time: Array, pose: Array) -> PoseStream:
    """Return planar poses (n, 3) as a stream."""
    zero = np.zeros(len(time))
    turn = np.column_stack([zero, zero, np.sin(0.5 * pose[:, 2]), np.cos(0.5 * pose[:, 2])])
    return PoseStream(time, np.column_stack([pose[:, :2], zero]), turn)
