"""The simulator against what can be worked out by hand, against measured kinematics, and against the clock."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosgraph_msgs.msg import Clock

from bullet_sim.catalogue import CasterSettings, OfficeTable
from bullet_sim.client import GRAVITY, BulletClient
from bullet_sim.scene import load_scene
from bullet_sim.world import World
from krang_sim.postures import Posture
from krang_sim.robot import SIDES, Krang
from pbrl_bringup.benches.kinematics_vectors import VECTORS, Vector
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.graph import Node, Scalar, free_domain, node_command, node_environment
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient

Array = NDArray[np.float64]

FORCE = 20.0  # [N]
ALIGNED = 0.6  # [m] of travel after which the casters trail: twenty times their trail
MEASURED = 0.6  # [m] of travel over which the acceleration is taken
PATIENCE = 60.0  # [s]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Measure the rows on the simulator."""
    push = pushed_table(seed)
    place, turn = kinematics_errors()
    factor, details = real_time_factor(seed, 5.0 if quick else 20.0, out)
    return Measured(
        [
            push,
            at_most("arms' forward kinematics: position, worst of all", place, "m", 1e-3, vectors=len(VECTORS)),
            at_most("arms' forward kinematics: angle, worst of all", turn, "rad", 1e-3, vectors=len(VECTORS)),
            at_least("sim_node, three tables, all sensors: simulated over real time", factor, "1", 2.0, **details),
        ],
        {"real_time": details},
    )


def pushed_table(seed: int) -> Row:
    """Push a free table with a steady force and compare its acceleration with the hand calculation."""
    scene = load_scene("free_table")
    name, table = next((n, b) for n, b in scene.bodies.items() if isinstance(b, OfficeTable))
    with BulletClient() as client:
        world = World(client, scene, np.random.default_rng(seed))
        for _ in range(round(0.5 / client.step_time)):  # settle on its wheels
            world.step()
        start, speeds = world.pose(name).position[0], []
        while (travel := world.pose(name).position[0] - start) < ALIGNED + MEASURED:
            centre = client.centre_pose(name).position
            world.find(name).apply_force(np.array([FORCE, 0.0, 0.0]), centre)
            world.step()
            if travel > ALIGNED:
                speeds.append((client.time, world.twist(name).linear[0]))
    times, velocity = np.array(speeds).T
    measured = float(np.polyfit(times, velocity, 1)[0])
    expected = rolling_acceleration(FORCE, table.nominal_mass, table.casters, len(table.swivels))
    gap = abs(measured / expected - 1.0)
    return at_most(
        "free table under 20 N: acceleration, Bullet against rolling resistance by hand",
        gap,
        "1",
        0.10,
        bullet_m_s2=measured,
        hand_m_s2=expected,
    )


def rolling_acceleration(force: float, mass: float, casters: CasterSettings, wheels: int) -> float:
    """Return (F - m g f / r) / (m + n I / r^2) [m/s^2]: rolling resistance off, wheels spun up too."""
    radius = casters.radius
    resistance = mass * GRAVITY * casters.rolling_resistance / radius
    spin = 0.5 * casters.wheel_mass * radius**2
    return (force - resistance) / (mass + wheels * spin / radius**2)


def kinematics_errors() -> tuple[float, float]:
    """Return the worst position [m] and angle [rad] error of the simulated arms over all vectors."""
    places, turns = [], []
    for vector in VECTORS:
        posture = Posture(vector.waist, vector.torso, vector.left, vector.right)
        with BulletClient() as client:
            robot = Krang(client, (0.0, 0.0, 0.0), posture)
            positions, quaternions = robot.link_poses([f"{side}_ft" for side in SIDES])
        place, turn = _compare(vector, positions, quaternions)
        places.append(place)
        turns.append(turn)
    return max(places), max(turns)


def _compare(vector: Vector, positions: Array, quaternions: Array) -> tuple[float, float]:
    expected = (vector.left_pose, vector.right_pose)
    place = max(float(np.linalg.norm(p - want[:3])) for p, want in zip(positions, expected, strict=True))
    # The vectors have four digits, so they are unit quaternions only once they are made so.
    units = [np.array(want[3:]) / np.linalg.norm(want[3:]) for want in expected]
    turn = max(_angle_between(q, u) for q, u in zip(quaternions, units, strict=True))
    return place, turn


def _angle_between(a: Array, b: Array) -> float:
    """Return the angle [rad] of the turn from one unit quaternion to another, exact for small ones too."""
    chord = min(float(np.linalg.norm(a - b)), float(np.linalg.norm(a + b)))
    return 4.0 * float(np.arcsin(min(1.0, chord / 2.0)))


def real_time_factor(seed: int, seconds: float, out: Path) -> tuple[float, dict[str, float]]:
    """Run the node as fast as it goes and compare /clock with the wall clock, over `seconds` of the wall."""
    parameters: dict[str, Scalar] = {"scene": "three_tables", "seed": seed, "rate": 0.0}
    node = Node(package="krang_sim", executable="sim_node", parameters=parameters)
    with free_domain() as domain, Programs(out / "logs", node_environment(domain)) as programs:
        programs.start("sim", node_command("sim", node))
        with GraphClient(domain, programs.check) as client:
            clock = client.listen(Clock, "/clock", latched=False)
            client.wait_until(lambda: clock.count > 200, PATIENCE, "the clock stands still")
            first = (time.perf_counter(), simulated(clock.message))
            client.wait_until(lambda: time.perf_counter() > first[0] + seconds, 10 * PATIENCE, "")
            last = (time.perf_counter(), simulated(clock.message))
    wall, passed = last[0] - first[0], last[1] - first[1]
    return passed / wall, {"wall_s": wall, "simulated_s": passed}


def simulated(message: Clock) -> float:
    """Return a clock message's time [s]."""
    return float(message.clock.sec) + 1e-9 * float(message.clock.nanosec)
