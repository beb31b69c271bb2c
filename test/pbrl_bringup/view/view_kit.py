"""Recordings with names that nobody should use, and a page that is served while a test runs."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import uvicorn
from starlette.applications import Starlette

from pbrl_bag import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_bringup.view.serving import listening

EVIL = '<script>document.title="broken"</script><img src=x onerror="document.title=1">'
OUTLINE = np.array([(-0.6, -0.375), (0.6, -0.375), (0.6, 0.375), (-0.6, 0.375)])


def poses(time: np.ndarray, x: np.ndarray, theta: np.ndarray) -> PoseStream:
    zero = np.zeros(len(time))
    turn = np.column_stack([zero, zero, np.sin(theta / 2), np.cos(theta / 2)])
    return PoseStream(time, np.column_stack([x, zero, zero]), turn)


def recorded(name: str = "table", seconds: float = 12.0) -> Recording:
    """A table that is pushed along x and turns, one that nobody moves, and a pillar; the clock begins at 100 s."""
    tags, wrists = 100.0 + np.arange(0.0, seconds, 1 / 15), 100.0 + np.arange(0.0, seconds, 0.01)
    way = np.clip(tags - 102.0, 0.0, 8.0) * 0.1
    force = np.column_stack([-20.0 * ((wrists > 102) & (wrists < 110)), np.sin(wrists), 0 * wrists - 9.0])
    force[700, 1] = 77.0  # one sample that no thinning may lose
    body = BodyGeometry(name, OUTLINE, 0.75, 30.0, True, np.zeros(3), 0.9 * OUTLINE)
    still = BodyGeometry("still", OUTLINE, 0.75, 30.0, True, np.array([0.0, 2.0, 0.3]))
    pillar = BodyGeometry("pillar", 0.2 * OUTLINE, 2.0, np.nan, False, np.array([2.0, 1.0, 0.0]))
    return Recording(
        path=Path("bag"),
        bodies={name: body, "still": still, "pillar": pillar},
        object_poses={name: poses(tags, way, 0.5 * way), "still": poses(tags, 0 * way, 0 * way + 0.3)},
        gripper_poses={"left": poses(tags, way - 0.8, 0 * way)},
        wrenches={"left": WrenchStream(wrists, force, 0.1 * force)},
        grasps=(Grasp("left", name, 102.0, 110.0, np.array([-0.6, 0.0])),),
        room=np.array([(-2.0, -2.0), (4.0, -2.0), (4.0, 4.0), (-2.0, 4.0)]),
    )


@contextmanager
def serving(app: Starlette, port: int = 0) -> Iterator[str]:
    """Serve an application in a thread; yield its address."""
    with listening(port) as at:
        server = uvicorn.Server(uvicorn.Config(app, log_level="error", lifespan="off", timeout_graceful_shutdown=1))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [at]})
        thread.start()
        try:
            yield f"http://127.0.0.1:{at.getsockname()[1]}/"
        finally:
            server.should_exit = True
            thread.join(10.0)
            assert not thread.is_alive()
