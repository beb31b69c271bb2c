"""The hand's node by itself."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from geometry_msgs.msg import Point, Vector3
from pbrl_msgs.srv import PushObject
from rclpy.context import Context
from rclpy.parameter import Parameter

from bullet_sim.ros import diagnostics
from krang_sim.ros.hand_node import HandNode

SCENE = """
room: {outline: [[-3, -3], [3, -3], [3, 3], [-3, 3]]}
bodies: {table: {kind: plain_table, size: [0.7, 1.2], nominal_mass: 20.0, pose: [0, 0, 0]}}
"""


@pytest.fixture
def node(domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[HandNode]:
    monkeypatch.setattr(diagnostics, "PERIOD", 0.01)
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    told = {"scene": str(tmp_path / "scene.yaml"), "rate": 0.0}
    given = [Parameter(name, value=value) for name, value in told.items()]
    made = HandNode(threading.Event(), context=context, enable_rosout=False, parameter_overrides=given)
    yield made
    made.destroy_node()
    rclpy.try_shutdown(context=context)


def test_it_tells_how_it_is_while_it_pushes(node: HandNode, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []
    monkeypatch.setattr(node._diagnostics, "_tell", lambda: told.append(node._diagnostics.status(node._at)))
    wanted = PushObject.Request(object="table", contact_point=Point(x=-0.35), direction=Vector3(x=1.0))
    wanted.speed, wanted.duration = 0.1, 1.0
    assert node._push(wanted, PushObject.Response()).success
    assert len(told) > 3
