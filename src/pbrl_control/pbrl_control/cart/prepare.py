"""Compile what a tick needs before there is anything to push: a first tick must not take seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.cart.arms import ArmState
from pbrl_control.cart.body import CartBody
from pbrl_control.cart.controller import CartController
from pbrl_control.cart.percept import CartPercept
from pbrl_control.cart.plan import CartPlan
from pbrl_control.cart.settings import CartSettings


@dataclass(frozen=True)
class _Floor:
    cells: NDArray[np.uint8]
    resolution: float = 0.05
    origin: tuple[float, float] = (-1.0, -1.0)


def compile_kernels(settings: CartSettings) -> None:
    """Have a robot that does not exist push a cart past something; what was compiled before is read from disk."""
    square = 0.2 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    points = np.array([[0.0, 0.1], [0.0, -0.1]])
    body = CartBody(square, square, (0.4, 0.0), points, points)
    plan = CartPlan.timed(np.array([[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]]), settings.limits, settings.share)
    floor = _Floor(np.zeros((40, 40), dtype=np.uint8))
    floor.cells[26, 26] = 254
    full = np.ones((2, 7))
    arms = ArmState(np.ones((2, 6, 7)), 0.0 * full, -full, full, full)
    controller = CartController(plan, body, settings)
    for now in (0.0, settings.period):
        controller.step(now, CartPercept(np.zeros(3), now, 0.0, 0.0, now, now, floor, arms=arms, arms_time=now))
