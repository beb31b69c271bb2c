"""Steps agree with the world model, braking brakes, and costs are what mechanics says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from push_cases import KINDS, QUICK, problem, simulated

from pbrl_planner.errors import PlannerError
from pbrl_planner.kinodynamic.braking import brake, rest_speed
from pbrl_planner.kinodynamic.dynamics import PushDynamics, wrapped
from pbrl_planner.kinodynamic.problem import WrenchLimits


@pytest.mark.parametrize("kind", KINDS)
def test_a_step_is_the_rollout_of_the_world_model(kind: str, rng: np.random.Generator) -> None:
    asked = problem(kind)
    dynamics = PushDynamics(asked, QUICK)
    for _ in range(20):
        wrench = rng.uniform(-0.3, 0.3, 3) * asked.limits.array
        after = dynamics.step(dynamics.start, wrench)
        expected = simulated(asked, np.tile(wrench, (QUICK.substeps, 1)), QUICK.dt)[-1]
        assert after is not None
        np.testing.assert_allclose(after, expected, atol=1e-12)


def test_a_step_into_a_wall_too_fast_or_of_nan_is_none() -> None:
    asked = problem("free", start=np.array([1.59, 0.0, 0.0]))
    dynamics = PushDynamics(asked, QUICK)
    towards = np.array([*dynamics.start[:3], 0.3, 0.0, 0.0])
    assert dynamics.step(towards, np.zeros(3)) is None
    assert dynamics.step(towards * [1, 1, 1, -1, 1, 1], np.zeros(3)) is not None
    fast = np.array([0.0, 0.0, 0.0, QUICK.speed + 1e-6, 0.0, 0.0])
    assert dynamics.step(fast, np.zeros(3)) is None
    assert dynamics.step(np.zeros(6), np.array([math.nan, 0.0, 0.0])) is None


@pytest.mark.parametrize("kind", ["free", "feet", "fixed wheel", "locked caster"])
@pytest.mark.parametrize("limits", [(30, 30, 10), (30, 30, 0), (0, 0, 10)])
def test_braking_takes_energy_until_rest_or_gives_up(kind: str, limits: tuple, rng: np.random.Generator) -> None:
    dynamics = PushDynamics(problem(kind, limits=WrenchLimits(*limits)), QUICK)
    rests = 0
    for _ in range(10):
        state = np.concatenate((np.zeros(3), rng.uniform(-0.15, 0.15, 3)))
        found = brake(dynamics, state)
        if found is None:
            continue
        rests += 1
        wrenches, end = found
        assert rest_speed(dynamics, end) <= QUICK.rest_speed
        assert (np.abs(wrenches) <= dynamics.problem.limits.array + 1e-12).all()
        speeds, here = [rest_speed(dynamics, state)], state
        for wrench in wrenches:
            after = dynamics.step(here, wrench)
            assert after is not None
            here = after.copy()
            speeds.append(rest_speed(dynamics, here))
        assert (np.diff(speeds) < 1e-3).all()
    assert rests == 10 or limits != (30, 30, 10)


def test_braking_finds_no_room_before_a_wall() -> None:
    dynamics = PushDynamics(problem("free", start=np.array([1.58, 0.0, 0.0])), QUICK)
    fast = np.array([*dynamics.start[:3], 0.34, 0.0, 0.0])
    assert brake(dynamics, fast) is None
    assert brake(dynamics, fast * [1, 1, 1, -1, 1, 1]) is not None


def test_the_work_on_a_body_without_friction_is_its_kinetic_energy_and_force_adds_up() -> None:
    dynamics = PushDynamics(problem("free"), QUICK)
    wrenches, counts = np.array([[6.0, 2.0, 0.3], [3.0, -1.0, 0.2]]), np.array([5, 3])
    states = dynamics.trace(wrenches, counts)
    cost = dynamics.cost(wrenches, counts, states)
    energy = 0.5 * float(dynamics.inertia @ states[-1, 3:] ** 2)
    assert cost.work == pytest.approx(energy, rel=1e-9)
    assert cost.time == pytest.approx(0.8)
    assert cost.force == pytest.approx(0.5 * math.hypot(6, 2) + 0.3 * math.hypot(3, 1))
    assert cost.torque == pytest.approx(0.5 * 0.3 + 0.3 * 0.2)


def test_a_trace_into_a_wall_is_refused() -> None:
    dynamics = PushDynamics(problem("free", start=np.array([1.5, 0.0, 0.0])), QUICK)
    with pytest.raises(PlannerError, match="replay: expected controls of a plan"):
        dynamics.trace(np.array([[10.0, 0.0, 0.0]]), np.array([10]))


def test_wrapping_leaves_angles_within_half_a_turn_to_the_bit(rng: np.random.Generator) -> None:
    angles = rng.uniform(-math.pi, math.pi, 1000)
    assert wrapped(angles).tobytes() == angles.tobytes()
    far = angles + 2.0 * math.pi * rng.integers(-5, 6, 1000)
    np.testing.assert_allclose(wrapped(far), angles, atol=1e-13)
    assert wrapped(np.array([math.pi]))[0] == -math.pi
