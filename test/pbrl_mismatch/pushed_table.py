"""A table pushed by a compliant hand, in which one thing is true and concealed.

This simulator is not the library's kernel: plain Python, explicit small steps, contacts at the feet one by one, dry
friction by sequential impulses, loads and casters with their own equations of motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TABLE = np.array([[-0.6, -0.35], [0.6, -0.35], [0.6, 0.35], [-0.6, 0.35]])
FEET = np.array([[-0.5, -0.28], [0.5, -0.28], [0.5, 0.28], [-0.5, 0.28]])
MASS, GYRATION = 20.0, math.sqrt((1.2**2 + 0.7**2) / 12)
STEP, EVERY, GRAVITY = 0.0025, 4, 9.81
BEFORE = 1.5
REST = 2.5e-3
"""Rolling resistance is a slope below this speed [m/s]."""
SWEEPS = 6
"""Sweeps of sequential impulses over all points that rub."""
HAND, HAND_DAMPING, TWIST, TWIST_DAMPING = 3000.0, 150.0, 60.0, 8.0
RUBBER = 5e-5
"""What the plates' rubber gives way as it should [m/N]; the arm behind the gripper is what is soft."""


@dataclass(frozen=True)
class Truth:
    """One recording to make: which effect is true, its numbers, and how the table is pushed and seen."""

    effect: str = "clean"
    numbers: Mapping[str, float] = field(default_factory=dict)
    wheel: tuple[float, float, float] | None = (-0.5, 0.28, 0.12)
    seconds: float = 24.0
    speed: float = 0.14
    contact: tuple[float, float] = (-0.6, 0.0)
    tag_noise: float = 0.002
    yaw_noise: float = 0.004
    force_noise: float = 0.15
    nominal_mass: float = MASS


class Table:
    """The table's true state and everything that acts on it besides the hand."""

    def __init__(self, truth: Truth, rng: np.random.Generator) -> None:
        self.truth, self.n = truth, dict(truth.numbers)
        self.state = np.array([1.0, 0.5, rng.uniform(-3, 3), 0.0, 0.0, 0.0])
        self.begin = self.state[:3].copy()
        self.mass, self.inertia, self.com = MASS, MASS * GYRATION**2, np.zeros(2)
        if truth.effect == "com_offset":
            self.com = np.array([self.n["x"], self.n["y"]])
            self.state[:2] += self.turn(self.com)
        self.load = np.zeros(4)
        self.casters = self.state[2] + rng.uniform(-0.5, 0.5, 4)
        self.box = self.floor(np.array([self.n.get("x", 0.0), self.n.get("y", 0.0)]))
        self.loaded = False
        self.rubbing: list[tuple[float, float, float]] = []

    def floor(self, place: Array) -> Array:
        """Return a place told relative to the first pose (ahead, to the left) in world."""
        c, s = np.cos(self.begin[2]), np.sin(self.begin[2])
        return self.begin[:2] + np.array([c * place[0] - s * place[1], s * place[0] + c * place[1]])

    def turn(self, vector: Array) -> Array:
        c, s = math.cos(self.state[2]), math.sin(self.state[2])
        return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])

    def velocity(self, arm: Array) -> Array:
        return self.state[3:5] + self.state[5] * np.array([-arm[1], arm[0]])

    def origin(self) -> Array:
        return np.array([*(self.state[:2] - self.turn(self.com)), self.state[2]])

    def forces(self, time: float) -> list[tuple[Array, Array]]:
        """Return (lever, force) of all that is not the hand."""
        n, effect, out = self.n, self.truth.effect, []
        weight, self.rubbing = self.mass * GRAVITY, []
        if self.truth.wheel:
            self.rub(np.array(self.truth.wheel[:2]) - self.com, self.truth.wheel[2] * weight)
        if effect == "second_wheel":
            self.rub(np.array([n["x"], n["y"]]) - self.com, n["mu"] * weight)
        if effect in ("ground_friction", "breakaway_friction", "floor_patch"):
            for foot in FEET:
                place = self.state[:2] + self.turn(foot - self.com)
                speed = float(np.linalg.norm(self.velocity(self.turn(foot - self.com))))
                mu = n["mu"]
                if effect == "breakaway_friction":
                    mu += n["extra"] * math.exp(-((speed / n["speed"]) ** 2))
                if effect == "floor_patch" and np.max(np.abs(place - self.box) - n["half"]) > 0.0:
                    continue
                self.rub(foot - self.com, mu * weight / 4)
        if effect == "caster_swivel":
            for k, foot in enumerate(FEET):
                arm = self.turn(foot - self.com)
                v, e = self.velocity(arm), np.array([math.cos(self.casters[k]), math.sin(self.casters[k])])
                self.casters[k] += (e[0] * v[1] - e[1] * v[0]) / n["trail"] * STEP
                along = float(v @ e)
                out.append((arm, -n["roll"] * weight / 4 * along / math.sqrt(along**2 + REST**2) * e))
        if effect == "viscous_drag":
            out.append((np.zeros(2), -n["c"] * self.state[3:5]))
        if effect == "floor_slope":
            out.append((np.zeros(2), weight * np.array([n["x"], n["y"]])))
        if effect == "external_force":
            wave = math.sin(2 * math.pi * n["frequency"] * time) if "frequency" in n else 1.0
            out.append((np.zeros(2), wave * np.array([n["x"], n["y"]])))
        if effect == "tether":
            arm = self.turn(np.array([n["at"], 0.0]) - self.com)
            cord = self.state[:2] + arm - self.box
            length = float(np.linalg.norm(cord))
            out.append((arm, -n["k"] * max(length - n["length"], 0.0) * cord / max(length, 1e-9)))
        if effect == "detent":
            away = self.origin()[:2] - self.box
            out.append(
                (
                    self.turn(-self.com),
                    -n["force"] * away / n["width"] * math.exp(0.5 - 0.5 * float(away @ away) / n["width"] ** 2),
                )
            )
        if effect == "hidden_hinge":
            at = np.array([n["x"], n["y"]])
            arm = self.turn(at - self.com)
            out.append((arm, 20000.0 * (self.box - self.state[:2] - arm) - 400.0 * self.velocity(arm)))
        if effect in ("hidden_obstacle", "unseen_body"):
            out += self.touch(n["radius"])
        if effect == "sloshing_load":
            out.append(
                (
                    np.zeros(2),
                    n["mass"]
                    * (
                        (2 * math.pi * n["frequency"]) ** 2 * self.load[:2]
                        + 4 * math.pi * n["frequency"] * n["damping"] * self.load[2:]
                    ),
                )
            )
        if effect == "payload_change" and time > n["time"] and not self.loaded:
            self.put_on(n["mass"], np.array([n["x"], n["y"]]))
        return out

    def rub(self, place: Array, limit: float) -> None:
        """Let a point of the body rub on the floor with at most so much force [N]."""
        arm = self.turn(place)
        self.rubbing.append((float(arm[0]), float(arm[1]), limit * STEP))

    def stick(self) -> None:
        """Bring every rubbing point to rest as far as its friction allows: sequential impulses, clamped to a circle."""
        vx, vy, omega = (float(value) for value in self.state[3:])
        held = [[0.0, 0.0] for _ in self.rubbing]
        visits = 40 if len(self.rubbing) == 1 else 6
        for _ in range(1 if len(self.rubbing) == 1 else SWEEPS):
            for (rx, ry, most), impulse in zip(self.rubbing, held, strict=True):
                a, d = 1 / self.mass + ry * ry / self.inertia, 1 / self.mass + rx * rx / self.inertia
                step = 1.0 / (a + d - 1 / self.mass)  # the inverse of the largest eigenvalue
                for _ in range(visits):
                    ux, uy = vx - omega * ry, vy + omega * rx
                    px, py = impulse[0] - step * ux, impulse[1] - step * uy
                    size = math.hypot(px, py)
                    if size > most:
                        px, py = px / size * most, py / size * most
                    dx, dy = px - impulse[0], py - impulse[1]
                    impulse[0], impulse[1] = px, py
                    vx, vy = vx + dx / self.mass, vy + dy / self.mass
                    omega += (rx * dy - ry * dx) / self.inertia
                    if abs(dx) + abs(dy) < 1e-7:
                        break
        self.state[3:] = vx, vy, omega

    def put_on(self, mass: float, place: Array) -> None:
        before, total = self.com.copy(), self.mass + mass
        self.com = (self.mass * self.com + mass * place) / total
        shift = self.turn(self.com - before)
        self.inertia += self.mass * float((self.com - before) @ (self.com - before)) + mass * float(
            (place - self.com) @ (place - self.com)
        )
        self.state[:2] += shift
        self.state[3:5] += self.state[5] * np.array([-shift[1], shift[0]])
        self.mass, self.loaded = total, True

    def touch(self, radius: float) -> list[tuple[Array, Array]]:
        """Return the contact with a disc; one that nothing holds is pushed along over the floor."""
        c, s = math.cos(self.state[2]), math.sin(self.state[2])
        away = self.box - self.state[:2]
        local = np.array([c * away[0] + s * away[1], -s * away[0] + c * away[1]]) + self.com
        near = np.clip(local, TABLE[0], TABLE[2])
        gap = local - near
        distance = float(np.linalg.norm(gap))
        if distance < 1e-9 or distance > radius:
            return []
        normal = self.turn(gap / distance)
        arm = self.turn(near - self.com)
        closing = max(float(self.velocity(arm) @ normal), 0.0)
        force = 2e4 * (radius - distance) + 200.0 * closing
        if self.truth.effect == "unseen_body":
            # It slides when pushed harder than the floor holds it.
            most = self.n["force"]
            if force > most:
                self.box = self.box + normal * min((force - most) / 2e4, 0.01)
                force = most
        return [(arm, -force * normal)]

    def advance(self, wrench: Array, arm: Array, time: float) -> None:
        force, torque = wrench[:2].copy(), wrench[2] + arm[0] * wrench[1] - arm[1] * wrench[0]
        for lever, push in self.forces(time):
            force = force + push
            torque += lever[0] * push[1] - lever[1] * push[0]
        acceleration = force / self.mass
        if self.truth.effect == "sloshing_load":
            rate = 2 * math.pi * self.n["frequency"]
            self.load[2:] += (
                -acceleration - rate**2 * self.load[:2] - 2 * self.n["damping"] * rate * self.load[2:]
            ) * STEP
            self.load[:2] += self.load[2:] * STEP
        self.state[3:5] += acceleration * STEP
        self.state[5] += torque / self.inertia * STEP
        if self.rubbing:
            self.stick()
        self.state[:3] += self.state[3:] * STEP


def simulate(truth: Truth, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return poses of the table (T + 1, 3), of the gripper (T + 1, 3) and wrenches there (T, 3), every 10 ms."""
    table, contact = Table(truth, rng), np.array(truth.contact)
    give = truth.numbers["give"] if truth.effect == "grasp_compliance" else RUBBER
    rates, phases = rng.uniform(0.25, 1.1, 4), rng.uniform(0, 2 * math.pi, 4)
    hand, yaw, rate = None, table.state[2], np.zeros(2)
    poses, grippers, wrenches = [table.origin()], [], []
    mean = np.zeros(3)
    steps = round(truth.seconds / STEP)
    for k in range(steps):
        time = k * STEP
        arm = table.turn(contact - table.com)
        point, velocity = table.state[:2] + arm, table.velocity(arm)
        hand = point.copy() if hand is None else hand
        if not grippers:
            grippers.append(np.array([*point, table.state[2]]))
        ramp = min(1.0, time, truth.seconds - time)
        ahead = math.sin(rates[0] * time + phases[0]) + 0.6 * math.sin(2.3 * rates[1] * time + phases[1])
        aside = 0.9 * math.sin(rates[2] * time + phases[2]) + 0.5 * math.sin(2.9 * rates[3] * time + phases[3])
        rate = truth.speed * ramp * np.array([ahead, aside])
        rate = table.turn(rate)
        wrench = np.array(
            [
                *(HAND * (hand - point) + HAND_DAMPING * (rate - velocity)),
                TWIST * (yaw - table.state[2]) - TWIST_DAMPING * table.state[5],
            ]
        )
        size = float(np.linalg.norm(wrench[:2]))
        if size > 60.0:
            wrench[:2] *= 60.0 / size
            hand = point + (hand - point) * min(1.0, 60.0 / size)
        table.advance(wrench, arm, time)
        hand = hand + rate * STEP
        yaw += (table.state[2] - yaw) * STEP / 0.5
        mean += wrench / EVERY
        if (k + 1) % EVERY == 0:
            poses.append(table.origin())
            # The gripper is a little ahead along the force, so that the moment about it is the one about the contact.
            place = table.state[:2] + table.turn(contact - table.com) + give * mean[:2]
            wrenches.append(mean)
            grippers.append(np.array([*place, table.state[2]]))
            mean = np.zeros(3)
    return np.array(poses), np.array(grippers), np.array(wrenches)
