"""Sensors with the faults that a scene conceals."""

from __future__ import annotations

from numpy.random import Generator

from bullet_sim.errors import SimError
from bullet_sim.scene import Scene
from bullet_sim.sensors import SLACK, TagCamera, WristSensor


def wrist_sensor(scene: Scene, side: str, rng: Generator, step: float) -> WristSensor:
    """Make the force-torque sensor of a gripper.

    Args:
        scene: says what the sensor is like and what is wrong with it.
        side: the gripper, "left" or "right".
        rng: draws its offset and noise.
        step: of the physics [s]; there is at most one reading in each.

    Raises:
        SimError: the scene wants more readings than there are steps.
    """
    if scene.sensors.wrist_ft.rate * step > 1.0 + SLACK:
        raise SimError(
            f"sensors.wrist_ft.rate: expected at most {1.0 / step:.0f} Hz, one reading a physics step, "
            f"got {scene.sensors.wrist_ft.rate:g} Hz"
        )
    concealed = scene.concealed
    frame, drift = concealed.wrench_frame.get(side), concealed.wrench_bias.get(side)
    late = concealed.time_offset.get(side)
    return WristSensor(
        scene.sensors.wrist_ft,
        rng,
        frame=None if frame is None else frame.matrix,
        drift=None if drift is None else drift.at,
        delay=0.0 if late is None else late.delay,
    )


def tag_camera(scene: Scene, rng: Generator) -> TagCamera:
    """Make the overhead camera; tags are named after bodies, and `<side>_gripper`.

    Raises:
        SimError: the scene wants tags rendered, and this is the model of their noise.
    """
    if scene.sensors.tags.source != "noise":
        raise SimError(
            f"sensors.tags.source: expected noise here, got {scene.sensors.tags.source}; only Krang's room renders"
        )
    concealed = scene.concealed
    return TagCamera(
        scene.sensors.tags,
        rng,
        glued={tag: bias.seen for tag, bias in concealed.pose_bias.items()},
        delays={stream: late.delay for stream, late in concealed.time_offset.items()},
    )
