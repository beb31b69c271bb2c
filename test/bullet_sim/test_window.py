"""The window: shows what is there and changes nothing. Connected without a display, as a second client."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from bullet_sim import client as client_module
from bullet_sim.client import BulletClient
from bullet_sim.quiet import bullet
from bullet_sim.scene import load_scene
from bullet_sim.window import Window
from bullet_sim.world import World


@pytest.fixture
def mirrored(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `gui=True` connect a client without a window."""
    monkeypatch.setattr(client_module, "Window", partial(Window, bullet.DIRECT))


def run(*, gui: bool) -> tuple[BulletClient, list[Any]]:
    """Push a table for half a second; return the client and where the table was."""
    client = BulletClient(gui=gui)
    world = World(client, load_scene("three_tables"), np.random.default_rng(0))
    track = []
    for _ in range(200):
        body = world.find("table_a")
        body.apply_force(np.array([80.0, 30.0, 0.0]), body.pose().position)
        world.step()
        track.append(client.api.getBasePositionAndOrientation(client.body("table_a")))
    return client, track


def test_a_window_shows_every_body_where_it_is(mirrored: None) -> None:
    client, track = run(gui=True)
    assert client.window is not None
    client.window.show(client.api)
    shown = partial(client.window._call)
    assert shown("getNumBodies") == client.api.getNumBodies() > 4
    for body in range(client.api.getNumBodies()):
        assert shown("getBodyInfo", body) == client.api.getBodyInfo(body)
        here, there = client.api.getBasePositionAndOrientation(body), shown("getBasePositionAndOrientation", body)
        np.testing.assert_allclose(np.concatenate(there), np.concatenate(here), atol=1e-9)
        for joint in range(client.api.getNumJoints(body)):
            assert shown("getJointState", body, joint)[0] == pytest.approx(client.api.getJointState(body, joint)[0])
    assert np.linalg.norm(np.subtract(track[-1][0], track[0][0])) > 0.05, "something has moved"
    client.close()


def test_a_run_with_a_window_is_the_same_run(mirrored: None) -> None:
    (seen, with_window), (unseen, without) = run(gui=True), run(gui=False)
    assert with_window == without
    seen.close()
    unseen.close()


def test_a_window_that_its_user_closed_does_not_end_the_run(mirrored: None) -> None:
    with BulletClient(gui=True) as client:
        assert client.window is not None
        client.window.close()
        client.step()
        client.window.follow(client.api)
    client.window.close()
