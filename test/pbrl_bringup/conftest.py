"""A report and a recording of a table that turns about its locked caster, from closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose2D, PoseStamped, WrenchStamped
from pbrl_msgs.msg import Body, Grasp, Grasps, Scene

from pbrl_bag import BagWriter
from pbrl_bringup.report_data import (
    Contact,
    Episode,
    HeldOut,
    Made,
    ObjectReport,
    Parameter,
    Report,
    Truth,
    Wheel,
)

CORNER = np.array([-0.55, 0.32])


def turned_about(pivot: np.ndarray, angle: float) -> tuple[float, float, float]:
    """Pose of a body that started at the origin and turned about a point of itself."""
    c, s = math.cos(angle), math.sin(angle)
    x, y = pivot - np.array([[c, -s], [s, c]]) @ pivot
    return float(x), float(y), angle


def sample_episode(rng: np.random.Generator) -> Episode:
    time = np.linspace(0.0, 8.0, 121)
    angle = 0.75 * (1 - np.cos(np.pi * time / 8.0)) / 2
    recorded = [turned_about(CORNER, a + rng.normal(0, 0.002)) for a in angle]
    after = [turned_about(CORNER + np.array([0.01, -0.006]), a * 1.02) for a in angle]
    draws = [
        [turned_about(CORNER + rng.normal(0, 0.015, 2), a * scale) for a in angle]
        for scale in rng.normal(1.01, 0.03, 16)
    ]
    before = [(0.95 * float(a), 0.12 * float(a), 0.15 * float(a)) for a in angle]
    force = 24 * np.sin(np.pi * time / 8.0) ** 0.5 + rng.normal(0, 0.8, time.size)

    def error(poses: list[tuple[float, float, float]]) -> list[float | None]:
        return [math.dist(a[:2], b[:2]) for a, b in zip(poses, recorded, strict=True)]

    return Episode(
        label="push 1",
        time=[float(t) for t in time],
        recorded=recorded,
        before=before,
        after=after,
        draws=draws,
        wrench=[
            (float(f * math.cos(a)), float(f * math.sin(a)), float(-0.3 * f)) for f, a in zip(force, angle, strict=True)
        ],
        contacts=[Contact(gripper="left", point=(-0.6, -0.25))],
        error_before=error(before),
        error_after=error(after),
        fitted=True,
        end_before=error(before)[-1],
        end_after=error(after)[-1],
    )


def sample_report() -> Report:
    rng = np.random.default_rng(3)
    draws = CORNER + [0.008, -0.006] + rng.normal(0, 1, (300, 2)) @ np.array([[0.009, 0.0], [0.003, 0.005]])
    circle = np.linspace(0, 2 * np.pi, 49)
    ellipse = draws.mean(0) + 2.45 * np.column_stack([np.cos(circle), np.sin(circle)]) @ np.array(
        [[0.009, 0], [0.003, 0.005]]
    )
    mean = draws.mean(0)
    radius = float(np.quantile(np.hypot(*(draws - mean).T), 0.95))
    table = ObjectReport(
        name="table",
        verdict="Something holds the table at its rear-left caster: it turns about a point 1.0 cm from it.",
        detail="",
        model_class="wheel",
        footprint=[(-0.6, -0.375), (0.6, -0.375), (0.6, 0.375), (-0.6, 0.375)],
        casters=[(-0.55, -0.32), (0.55, -0.32), (0.55, 0.32), (-0.55, 0.32)],
        parameters=[
            Parameter(name="mass", meaning="mass", mean=31.2, sd=1.9, unit="kg", prior="14 to 76"),
            Parameter(
                name="wheel_x", meaning="held point, in front", mean=-0.542, sd=0.009, unit="m", prior="all over"
            ),
            Parameter(name="wheel_y", meaning="held point, left", mean=0.314, sd=0.005, unit="m", prior="all over"),
            Parameter(name="mu_x", meaning="friction along the wheel", mean=0.41, sd=0.2, unit="1", prior="0 to 1"),
        ],
        wheel=Wheel(
            draws=[(float(x), float(y), float(rng.uniform(-3, 3))) for x, y in draws],
            mean=(float(mean[0]), float(mean[1])),
            ellipse=[(float(x), float(y)) for x, y in ellipse],
            radius95=radius,
        ),
        episodes=[sample_episode(rng)],
        heldout=HeldOut(
            windows=12,
            horizon=1.0,
            position_before=0.083,
            position_after=0.004,
            yaw_before=0.11,
            yaw_after=float("nan"),
        ),
        truth=Truth(
            note="where the simulator had locked a caster; it was asked after the fit, for comparison only",
            locked=[(-0.55, 0.32)],
            distance=0.0101,
        ),
    )
    return Report(
        title="Demo: Krang pushes a table",
        verdict=table.verdict,
        detail="Before learning, the end of the push was predicted 72 cm off; after learning, 1.1 cm.",
        room=[(-2.0, -3.0), (4.0, -3.0), (4.0, 3.0), (-2.0, 3.0)],
        objects=[table],
        made=Made(
            command="./pbrl demo --seed 0",
            recording="out/demo/bag",
            seed=0,
            created="2026-01-02 03:04",
            seconds=31.4,
            versions={"pbrl": "0.1.0", "python": "3.11.2"},
        ),
    )


@pytest.fixture
def report() -> Report:
    return sample_report()


Edit = Callable[[str, int, Any], Any]
FOOTPRINT = [(-0.6, -0.375), (0.6, -0.375), (0.6, 0.375), (-0.6, 0.375)]
HELD = (2.0, 5.0)  # [s]


def stamped(kind: type, time: float, frame: str) -> Any:
    message = kind()
    message.header.frame_id = frame
    message.header.stamp.sec, nanosec = divmod(round(time * 1e9), 10**9)
    message.header.stamp.nanosec = nanosec
    return message


def tag(time: float, pose: tuple[float, float, float]) -> PoseStamped:
    message = stamped(PoseStamped, time, "world")
    message.pose.position.x, message.pose.position.y = pose[:2]
    message.pose.position.z = 0.75
    message.pose.orientation.z, message.pose.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
    return message


def scene_message() -> Scene:
    corners = [Point(x=x, y=y) for x, y in FOOTPRINT]
    table = Body(name="table", footprint=corners, height=0.75, nominal_mass=30.0, movable=True, pose=Pose2D())
    message = stamped(Scene, 0.0, "world")
    message.bodies = [table]
    return message


def grasps_message(time: float, *, held: bool) -> Grasps:
    message = stamped(Grasps, time, "")
    if held:
        message.grasps = [Grasp(gripper="left", object="table", contact_point=Point(x=-0.6, y=-0.25))]
    return message


def recorded_messages() -> list[tuple[str, float, Any]]:
    """Everything of one push, in order of time; the angle is that of `turned_about` at a steady acceleration."""
    messages: list[tuple[str, float, Any]] = [
        ("/scene", 0.0, scene_message()),
        ("/grasps", 0.0, grasps_message(0.0, held=False)),
        ("/grasps", HELD[0], grasps_message(HELD[0], held=True)),
        ("/grasps", HELD[1], grasps_message(HELD[1], held=False)),
    ]
    for time in np.arange(0.0, 6.0, 1 / 15).tolist():
        angle = 0.02 * min(max(time - HELD[0], 0.0), HELD[1] - HELD[0]) ** 2
        pose = turned_about(CORNER, angle)
        messages.append(("/ar_tags/table/pose", time, tag(time, pose)))
        messages.append(("/ar_tags/left_gripper/pose", time, tag(time, (pose[0] - 0.8, pose[1] - 0.25, angle))))
    for time in np.arange(0.0, 6.0, 0.01).tolist():
        wrench = stamped(WrenchStamped, time, "left_ft")
        wrench.wrench.force.x = -12.0 if HELD[0] < time < HELD[1] else 0.0
        messages.append(("/wrist_ft/left", time, wrench))
    return sorted(messages, key=lambda each: each[1])


def write_bag(folder: Path, edit: Edit = lambda topic, index, message: message) -> Path:
    """Write the recording; `edit` takes topic, number and message and gives what is written, None for nothing."""
    counts: dict[str, int] = {}
    with BagWriter(folder, live=False) as writer:
        for topic, time, message in recorded_messages():
            index = counts[topic] = counts.get(topic, -1) + 1
            edited = edit(topic, index, message)
            if edited is not None:
                package = type(message).__module__.partition(".")[0]
                writer.write(topic, f"{package}/msg/{type(message).__name__}", edited, round(time * 1e9))
    return folder


@pytest.fixture
def make_bag(tmp_path: Path) -> Callable[..., Path]:
    """Write the recording, edited, into a folder of this test."""
    return lambda edit=lambda topic, index, message: message: write_bag(tmp_path / "bag", edit)


@pytest.fixture(scope="session")
def write_push() -> Callable[..., Path]:
    """Write the recording into a folder, where what the gripper feels along x is another force [N]."""

    def written(folder: Path, force: float) -> Path:
        def edit(topic: str, index: int, message: Any) -> Any:
            if topic.startswith("/wrist_ft") and message.wrench.force.x:
                message.wrench.force.x = force
            return message

        folder.parent.mkdir(parents=True, exist_ok=True)
        return write_bag(folder, edit)

    return written
