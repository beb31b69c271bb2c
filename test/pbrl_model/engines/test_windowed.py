"""Both engines simulate the same poses; a delay of the poses is a shift of the wrenches."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pbrl_model.engines.windowed import KernelEngine, PymunkEngine
from pbrl_model.fitting.calibration import TABLE, empty_windows
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.geometry import mass_properties
from pbrl_model.parameters import BodyParameters
from pbrl_model.rollout import com_to_origin
from pbrl_model.sensing.windows import Windows
from pbrl_model.world import BodySpec, simulate_body

BODY = replace(mass_properties(TABLE.footprint), com=np.array([0.05, -0.02]))
ROWS = {
    "free": BodyParameters(mass=20.0),
    "wheel": BodyParameters(mass=25.0, wheel_x=-0.4, wheel_y=0.2, wheel_theta=0.3, mu_x=0.02, mu_y=0.2),
    "wheel+ground": BodyParameters(mass=30.0, wheel_x=0.1, wheel_y=0.2, mu_x=0.1, mu_y=0.2, mu_ground=0.02),
}


@pytest.fixture
def windows() -> Windows:
    layout = empty_windows(np.random.default_rng(3), "wheel")
    return replace(layout, delay=0.02).take(np.array([0, 1]))


def test_pymunk_is_the_world_of_world_py(windows: Windows) -> None:
    state, wrench = windows.initial[0], windows.wrench[0]
    c, s = np.cos(state[2]), np.sin(state[2])
    x, y = BODY.com
    pose = np.array([state[0] - c * x + s * y, state[1] - s * x - c * y, state[2]])
    spec = BodySpec("table", TABLE.footprint, ROWS["wheel"], pose, state[3:], mass_properties=BODY)
    slow = com_to_origin(simulate_body(spec, wrench, windows.dt)[:, :3], BODY.com)
    before, after = slow[windows.step[0]], slow[windows.step[0] + 1]
    engine = PymunkEngine(BODY, windows, TABLE.footprint)
    rest = np.zeros((1, len(windows), 3))
    found = engine.poses(ROWS["wheel"].to_vector()[None], windows.initial[None], rest, np.zeros(1))[0, 0]
    np.testing.assert_allclose(found, before + windows.fraction[0][:, None] * (after - before), atol=1e-12)


@pytest.mark.parametrize("kind", ROWS)
def test_pymunk_and_kernel_agree(windows: Windows, kind: str) -> None:
    rng = np.random.default_rng(0)
    rows = ROWS[kind].to_vector()[None]
    initial = windows.initial + 0.02 * rng.normal(size=(1, *windows.initial.shape))
    offset, late = rng.normal(size=(1, len(windows), 3)), np.array([0.015])
    found = [
        engine.poses(rows, initial, offset, late)
        for engine in (KernelEngine(BODY, windows), PymunkEngine(BODY, windows, TABLE.footprint))
    ]
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)


def test_likelihoods_of_both_engines_agree(windows: Windows) -> None:
    kernel = WindowedLikelihood(BODY, windows)
    rows = ROWS["wheel"].to_vector()[None]
    nuisance = np.random.default_rng(1).normal(size=(1, len(windows), 9))
    exact = kernel.simulate(rows, nuisance)[0]
    recorded = replace(windows, pose=exact + 0.003 * np.random.default_rng(2).normal(size=exact.shape))
    make = partial(PymunkEngine, footprint=TABLE.footprint)
    values = []
    for likelihood in (WindowedLikelihood(BODY, recorded), WindowedLikelihood(BODY, recorded, make_engine=make)):
        linear = likelihood.linearise(rows, nuisance)
        residuals = likelihood.residuals(rows, nuisance)
        values.append(likelihood.log_density(residuals, linear, np.ones(1), np.ones(1))[0])
    assert values[0] == pytest.approx(values[1], abs=1e-2)


def test_late_poses_are_early_wrenches(windows: Windows) -> None:
    # A wrench that grows linearly: what acts 30 ms earlier is known exactly.
    rate = np.broadcast_to(np.array([20.0, -10.0, 4.0]), windows.wrench.shape).copy()
    time = windows.dt * (np.arange(windows.wrench.shape[1]) + 0.5)
    ramp = replace(windows, wrench=rate * time[:, None], rate=rate)
    earlier = replace(ramp, wrench=rate * (time[:, None] - 0.03))
    rows = ROWS["wheel"].to_vector()[None]
    rest = np.zeros((1, len(windows), 9))
    late = WindowedLikelihood(BODY, ramp).simulate(rows, rest, np.array([windows.delay + 0.03]))
    np.testing.assert_allclose(late, WindowedLikelihood(BODY, earlier).simulate(rows, rest), atol=1e-9)


def test_the_compiled_marginal_needs_the_kernel(windows: Windows) -> None:
    make = partial(PymunkEngine, footprint=TABLE.footprint)
    likelihood = WindowedLikelihood(BODY, windows, make_engine=make)
    one = np.ones(1)
    with pytest.raises(TypeError, match="expected the kernel"):
        likelihood.marginal(ROWS["free"].to_vector()[None], one, one, 0 * one, likelihood.at_rest(1))
