"""A robot and a cart that do what they are told, late and not quite, for the tests of the local controller."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from pbrl_control.cart import CartBody, CartCommand, CartController, CartLimits, CartPercept, CartPlan, CartSettings

PHYSICS = 0.025  # [s]


@dataclass(frozen=True)
class Costs:
    cells: np.ndarray
    resolution: float = 0.025
    origin: tuple[float, float] = (-3.0, -3.0)

    def with_box(self, left: float, bottom: float, right: float, top: float) -> Costs:
        cells = self.cells.copy()
        j, i = (np.array([left, bottom]) - self.origin) / self.resolution
        k, m = (np.array([right, top]) - self.origin) / self.resolution
        cells[math.floor(i) : math.ceil(m), math.floor(j) : math.ceil(k)] = 254
        return replace(self, cells=cells)


def open_floor() -> Costs:
    return Costs(np.zeros((320, 320), dtype=np.uint8))


@dataclass
class World:
    """Base and cart: rates are those commanded `delay` ago, through a lag; senses are late and noisy."""

    state: np.ndarray
    delay: float = 0.05
    lag: float = 0.03
    sense_delay: float = 0.04
    noise: np.ndarray = field(default_factory=lambda: np.array([0.003, 0.003, 0.003, 0.004]))
    slip: np.ndarray = field(default_factory=lambda: np.ones(4))
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(4))
    now: float = 0.0
    rates: np.ndarray = field(default_factory=lambda: np.zeros(4))

    def __post_init__(self) -> None:
        self._sent: list[tuple[float, np.ndarray]] = [(-math.inf, np.zeros(4))]
        self._was = [(self.now, self.state.copy())]

    def send(self, command: CartCommand) -> None:
        self._sent.append((self.now, np.array([*command.twist, command.articulation_rate])))

    def run(self, span: float) -> None:
        for _ in range(round(span / PHYSICS)):
            wished = next(rates for time, rates in reversed(self._sent) if time <= self.now - self.delay + 1e-9)
            self.rates = self.rates + (wished * self.slip - self.rates) * min(PHYSICS / max(self.lag, PHYSICS), 1.0)
            c, s = math.cos(self.state[2]), math.sin(self.state[2])
            vx, vy, omega, bend = self.rates
            self.state = self.state + PHYSICS * np.array([c * vx - s * vy, s * vx + c * vy, omega, bend])
            self.now = round(self.now + PHYSICS, 9)
            self._was.append((self.now, self.state.copy()))
        self._was = self._was[-200:]

    def percept(self, costs: Costs, **changes: object) -> CartPercept:
        time, state = next(
            (each for each in reversed(self._was) if each[0] <= self.now - self.sense_delay), self._was[0]
        )
        seen = state + self.noise * self.rng.normal(size=4)
        given = {
            "pose": seen[:3],
            "pose_time": time,
            "articulation": float(seen[3]),
            "articulation_rate": 0.0,
            "articulation_time": time,
            "scan_time": self.now - 0.02,
            "costs": costs,
        }
        return CartPercept(**{**given, **changes})


@dataclass(frozen=True)
class Tick:
    now: float
    state: np.ndarray
    rates: np.ndarray
    command: CartCommand

    @property
    def sent(self) -> np.ndarray:
        return np.array([*self.command.twist, self.command.articulation_rate])


def drive(
    controller: CartController,
    world: World,
    costs: Costs | Callable[[float], Costs],
    seconds: float,
    changes: Callable[[World], dict] = lambda world: {},
) -> list[Tick]:
    """Run for so long, or until something is final."""
    ticks = []
    for _ in range(round(seconds / 0.05)):
        floor = costs(world.now) if callable(costs) else costs
        command = controller.step(world.now, world.percept(floor, **changes(world)))
        ticks.append(Tick(world.now, world.state.copy(), world.rates.copy(), command))
        world.send(command)
        if command.status in ("at the goal", "given up; plan again") and np.abs(ticks[-1].sent).max() == 0.0:
            break
        world.run(0.05)
    return ticks


def pr2_body() -> CartBody:
    half = 0.334
    robot = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    cart = np.array([[0.0, -0.3], [0.9, -0.3], [0.9, 0.3], [0.0, 0.3]])
    aside = np.array([[0.0, 0.25], [0.0, -0.25]])
    return CartBody(robot, cart, (0.65, 0.0), aside + np.array([0.284, 0.0]), aside)


SETTINGS = CartSettings(delay=0.05)


def arc(radius: float, angle: float, bend: float = 0.0, count: int = 60) -> np.ndarray:
    turned = np.linspace(0.0, angle, count)
    bent = bend * np.sin(np.linspace(0.0, math.pi, count))
    return np.column_stack((radius * np.sin(turned), radius * (1 - np.cos(turned)), turned, bent))


def straight(length: float, heading: float = 0.0, count: int = 20) -> np.ndarray:
    way = np.linspace(0.0, length, count)
    return np.column_stack((way * math.cos(heading), way * math.sin(heading), np.full(count, heading), np.zeros(count)))


PATHS = {
    "straight": straight(2.0),
    "aside": np.column_stack((np.zeros(20), np.linspace(0, 1.0, 20), np.zeros((20, 2)))),
    "arc": arc(1.2, 1.4),
    "in place": np.column_stack((np.zeros((30, 2)), np.linspace(0, -2.0, 30), np.zeros(30))),
    "articulated": arc(1.0, 1.3, 0.6),
    "corner": np.vstack(
        (straight(0.8), np.column_stack((np.full(20, 0.8), np.linspace(0.05, 0.8, 20), np.zeros((20, 2)))))
    ),
    "reversal": np.vstack((straight(0.6), straight(0.6)[::-1][1:])),
}


def made(path: np.ndarray, settings: CartSettings = SETTINGS, **changes: object) -> tuple[CartController, World]:
    """Make controller and world for a path."""
    plan = CartPlan.timed(path, settings.limits, settings.share)
    return CartController(plan, pr2_body(), settings), World(np.array(path[0]), **changes)


def assert_within_limits(ticks: list[Tick], limits: CartLimits, dt: float = 0.05) -> None:
    sent = np.array([np.zeros(4), *(tick.sent for tick in ticks)])
    speeds = np.column_stack((np.hypot(sent[:, 0], sent[:, 1]), np.abs(sent[:, 2:])))
    assert (speeds <= limits.speeds + 1e-9).all()
    steps = np.diff(sent, axis=0)
    changes = np.column_stack((np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2:])))
    assert (changes <= limits.brakings * dt + 1e-9).all()
    faster = np.diff(speeds, axis=0)
    assert (faster <= limits.accelerations * dt + 1e-9).all()
