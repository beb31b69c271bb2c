"""The compiled kernel: against pymunk, closed forms, and the laws of mechanics."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model import kernel
from pbrl_model.geometry import mass_properties
from pbrl_model.kernel import ERROR_BIAS, GRAVITY
from pbrl_model.parameters import BodyParameters
from pbrl_model.rollout import rollout, rollout_states
from pbrl_model.world import BodySpec, PhysicsWorld, simulate_body

Array = NDArray[np.float64]

DT = 0.01
STEPS = 500
KINDS = ("free", "wheel", "hinge", "pivot", "wheel+hinge", "wheel+pivot", "ground", "wheel+ground")


def random_spec(kind: str, seed: int) -> BodySpec:
    """A random rectangle off its frame's origin, anywhere, with the joints that `kind` names."""
    rng = np.random.default_rng([seed, *kind.encode()])
    width, depth = rng.uniform(0.3, 1.2, 2)
    corner = np.array([width, depth]) / 2
    middle = rng.uniform(-0.2, 0.2, 2)
    footprint = middle + corner * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    pose = rng.uniform(-2, 2, 3)
    fields: dict[str, float] = {"mass": rng.uniform(2, 60)}
    anchor = rng.uniform(-0.5, 0.5, 2)
    if "wheel" in kind:
        wheel = middle + rng.uniform(-1, 1, 2) * corner
        # Where wheel and pivot all but coincide Chipmunk needs a hundred thousand sweeps.
        while "pivot" in kind and np.linalg.norm(wheel - anchor) < 0.2:
            wheel = middle + rng.uniform(-1, 1, 2) * corner
        fields |= {"wheel_x": wheel[0], "wheel_y": wheel[1], "wheel_theta": rng.uniform(-np.pi, np.pi)}
        fields |= {"mu_x": rng.choice([0.0, rng.uniform(0, 0.1), rng.uniform()]), "mu_y": rng.uniform()}
    if "hinge" in kind or "pivot" in kind:
        radius = rng.uniform(0.2, 1.5) if "hinge" in kind else 0.0
        arm = turned(anchor, pose[2]) + radius * turned(np.array([1.0, 0.0]), rng.uniform(-np.pi, np.pi))
        fields |= {"anchor_x": anchor[0], "anchor_y": anchor[1], "hinge_radius": radius}
        fields |= {"hinge_x": pose[0] + arm[0], "hinge_y": pose[1] + arm[1]}
    if "ground" in kind:
        fields["mu_ground"] = rng.uniform(0.0, 0.1)
    jointed = "hinge" in kind or "pivot" in kind
    velocity = np.zeros(3) if jointed else rng.normal(0, 0.3, 3)
    return BodySpec(kind, footprint, BodyParameters(**fields), pose, velocity)


def random_wrench(spec: BodySpec, seed: int, steps: int = STEPS) -> Array:
    rng = np.random.default_rng([seed, 1])
    levels = rng.normal(size=(steps // 25, 3)) * spec.parameters.mass * np.array([2.0, 2.0, 0.3])
    return np.repeat(levels, 25, axis=0)


def turned(vector: Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def start_of(spec: BodySpec) -> Array:
    com = mass_properties(spec.footprint).com
    return np.array([*(spec.pose[:2] + turned(com, spec.pose[2])), spec.pose[2], *spec.velocity])


def simulate(spec: BodySpec, wrench: Array, dt: float = DT, *, body_wrench: bool = False) -> Array:
    body = mass_properties(spec.footprint)
    rows, start = spec.parameters.to_vector()[None], start_of(spec)[None]
    states = rollout_states(rows, start, wrench[None], body.inertia_per_mass, body.com, dt, body_wrench=body_wrench)
    return states[0, 0]


def energy(states: Array, mass: float, inertia: float) -> Array:
    return 0.5 * mass * (states[:, 3] ** 2 + states[:, 4] ** 2) + 0.5 * inertia * states[:, 5] ** 2


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", KINDS)
def test_kernel_is_what_chipmunk_converges_to(kind: str, seed: int) -> None:
    spec = random_spec(kind, seed)
    wrench = random_wrench(spec, seed)
    sweeps = 6000 if "+" in kind else 300
    reference = simulate_body(spec, wrench, DT, sweeps)
    # Without a second joint Chipmunk converges to rounding; wheel and joint together converge slowly.
    np.testing.assert_allclose(
        simulate(spec, wrench)[:, :3], reference[:, :3], rtol=0, atol=1e-6 if "+" in kind else 1e-9
    )


@pytest.mark.parametrize("seed", range(4))
def test_free_body_follows_the_closed_form(seed: int) -> None:
    spec = random_spec("free", seed)
    push = np.array([3.0, -2.0, 0.7])
    states = simulate(spec, np.tile(push, (STEPS, 1)))
    mass, inertia = spec.parameters.mass, spec.parameters.mass * mass_properties(spec.footprint).inertia_per_mass
    rate = push / np.array([mass, mass, inertia])
    n = np.arange(STEPS + 1)[:, None]
    expected = start_of(spec)[:3] + n * DT * spec.velocity + rate * DT**2 * n * (n - 1) / 2
    np.testing.assert_allclose(states[:, :3], expected, rtol=0, atol=1e-10)
    np.testing.assert_allclose(states[:, 3:], spec.velocity + n * DT * rate, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", range(20))
def test_wheel_never_adds_energy(seed: int) -> None:
    spec = random_spec("wheel", seed)
    states = simulate(spec, np.zeros((STEPS, 3)))
    properties = mass_properties(spec.footprint)
    kinetic = energy(states, spec.parameters.mass, spec.parameters.mass * properties.inertia_per_mass)
    assert np.all(np.diff(kinetic) <= 1e-12 * kinetic[0])


@pytest.mark.parametrize("seed", range(10))
def test_wheel_force_keeps_within_its_limits_and_is_the_only_force(seed: int) -> None:
    spec = random_spec("wheel", seed)
    wrench = random_wrench(spec, seed)
    states = simulate(spec, wrench)
    p, properties = spec.parameters, mass_properties(spec.footprint)
    inertia = p.mass * properties.inertia_per_mass
    impulse = np.diff(states[:, 3:], axis=0) * [p.mass, p.mass, inertia] - wrench * DT
    theta = states[1:, 2]
    arm = np.array([p.wheel_x, p.wheel_y]) - properties.com
    lever = np.stack([np.cos(theta) * arm[0] - np.sin(theta) * arm[1], np.sin(theta) * arm[0] + np.cos(theta) * arm[1]])
    axis = theta + p.wheel_theta
    along = np.cos(axis) * impulse[:, 0] + np.sin(axis) * impulse[:, 1]
    across = -np.sin(axis) * impulse[:, 0] + np.cos(axis) * impulse[:, 1]
    scale = p.mass * GRAVITY * DT
    assert np.all(np.abs(along) <= p.mu_x * scale * (1 + 1e-9) + 1e-12)
    assert np.all(np.abs(across) <= p.mu_y * scale * (1 + 1e-9) + 1e-12)
    moment = lever[0] * impulse[:, 1] - lever[1] * impulse[:, 0]
    np.testing.assert_allclose(impulse[:, 2], moment, rtol=0, atol=1e-9 * scale + 1e-12)


def test_locked_wheel_holds_its_point_still() -> None:
    spec = random_spec("wheel", 0)
    stuck = replace(spec, parameters=replace(spec.parameters, mu_x=1.0, mu_y=1.0), velocity=np.zeros(3))
    states = simulate(stuck, np.tile([0.5, 0.3, 0.2], (STEPS, 1)))
    arm = np.array([stuck.parameters.wheel_x, stuck.parameters.wheel_y]) - mass_properties(stuck.footprint).com
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    velocity = states[:, 3:5] + states[:, 5:] * np.stack([-s * arm[0] - c * arm[1], c * arm[0] - s * arm[1]], -1)
    np.testing.assert_allclose(velocity, 0.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_world_may_be_turned_and_moved(kind: str) -> None:
    spec = random_spec(kind, 3)
    wrench = random_wrench(spec, 3)
    angle, shift = 1.1, np.array([5.0, -3.0])

    def move(points: Array) -> Array:
        return turned(points, angle) + shift

    hinge = move(np.array([spec.parameters.hinge_x, spec.parameters.hinge_y]))
    moved = replace(
        spec,
        parameters=replace(spec.parameters, hinge_x=float(hinge[0]), hinge_y=float(hinge[1])),
        pose=np.array([*move(spec.pose[:2]), spec.pose[2] + angle]),
        velocity=np.array([*turned(spec.velocity[:2], angle), spec.velocity[2]]),
    )
    turned_wrench = np.column_stack([turned(wrench[:, :2].T, angle).T, wrench[:, 2]])
    here, there = simulate(spec, wrench), simulate(moved, turned_wrench)
    np.testing.assert_allclose(there[:, :2], turned(here[:, :2].T, angle).T + shift, rtol=0, atol=1e-9)
    np.testing.assert_allclose(there[:, 2] - angle, here[:, 2], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["hinge", "pivot", "wheel+hinge", "wheel+pivot"])
@pytest.mark.parametrize("seed", range(5))
def test_hinge_keeps_its_radius(kind: str, seed: int) -> None:
    spec = random_spec(kind, seed)
    wrench = random_wrench(spec, seed) * 0.2
    states = simulate(spec, wrench)
    p = spec.parameters
    arm = np.array([p.anchor_x, p.anchor_y]) - mass_properties(spec.footprint).com
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    r = np.stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]], -1)
    distance = np.linalg.norm(states[:, :2] + r - [p.hinge_x, p.hinge_y], axis=1)
    velocity = states[:, 3:5] + states[:, 5:] * np.stack([-r[:, 1], r[:, 0]], -1)
    # A straight step leaves the circle by at most s^2 / 2 of the curves anchor and arm run on; Baumgarte's share
    # of the error goes in each step, so the error stays below the geometric sum.
    bend = np.sum(velocity**2, axis=1) / max(p.hinge_radius, 0.2) + states[:, 5] ** 2 * np.linalg.norm(arm)
    bound = 0.5 * DT**2 * bend.max() / (1.0 - ERROR_BIAS**DT)
    assert np.abs(distance - p.hinge_radius).max() < 2.0 * bound + 1e-9


def test_wheel_turned_by_ninety_degrees_with_coefficients_exchanged_is_the_same_wheel() -> None:
    spec = random_spec("wheel+hinge", 1)
    wrench = random_wrench(spec, 1)
    p = spec.parameters
    same = replace(p, wheel_theta=p.wheel_theta + np.pi / 2, mu_x=p.mu_y, mu_y=p.mu_x)
    half = replace(p, wheel_theta=p.wheel_theta + np.pi)
    for other in (same, half):
        np.testing.assert_allclose(simulate(replace(spec, parameters=other), wrench), simulate(spec, wrench), atol=1e-8)


def test_wheel_on_the_pivot_itself_changes_nothing() -> None:
    spec = random_spec("pivot", 2)
    p = spec.parameters
    on_it = replace(p, wheel_x=p.anchor_x, wheel_y=p.anchor_y, mu_x=0.4, mu_y=0.7)
    wrench = random_wrench(spec, 2)
    np.testing.assert_allclose(simulate(replace(spec, parameters=on_it), wrench), simulate(spec, wrench), atol=1e-9)


def test_box_impulses_minimise_the_quadratic() -> None:
    rng = np.random.default_rng(0)
    for _ in range(2000):
        levers = rng.normal(size=2)
        a = np.eye(2) * rng.uniform(0, 1) + np.outer(levers, levers)
        b, limit = rng.normal(size=2) * 2, rng.uniform(0, 1, 2)
        p = np.array(kernel.box_impulses(a[0, 0], a[0, 1], a[1, 1], *b, *limit))
        assert np.all(np.abs(p) <= limit)
        slip = a @ p + b
        # Projected gradient: what is left points out of the box, or is nothing.
        left = p - np.clip(p - slip, -limit, limit)
        np.testing.assert_allclose(left, 0.0, rtol=0, atol=1e-12)


def test_box_impulses_with_parallel_rows_still_minimise() -> None:
    """Rows of rank one, as a wheel on a pivot has: any split of the impulse will do, but the slip has to be right."""
    rng = np.random.default_rng(1)
    for _ in range(500):
        levers, limit = rng.normal(size=2), rng.uniform(0, 1, 2)
        a, b = np.outer(levers, levers), levers * rng.normal()
        p = np.array(kernel.box_impulses(a[0, 0], a[0, 1], a[1, 1], *b, *limit))
        assert np.all(np.abs(p) <= limit)
        np.testing.assert_allclose(p - np.clip(p - (a @ p + b), -limit, limit), 0.0, rtol=0, atol=1e-11)


def test_cosine_and_sine_are_those_of_the_library() -> None:
    rng = np.random.default_rng(2)
    angles = np.concatenate([rng.uniform(-size, size, 2000) for size in (1e-8, 1.0, 10.0, 1e3, 1e6)])
    quarters = np.arange(-8, 9) * np.pi / 4
    for angle in [*angles, *quarters, *np.nextafter(quarters, 9.0), *np.nextafter(quarters, -9.0), 0.0]:
        c, s = kernel.cos_sin(angle)
        assert abs(c - np.cos(angle)) <= 2.3e-16 and abs(s - np.sin(angle)) <= 2.3e-16


@pytest.mark.parametrize("kind", ["free", "wheel", "hinge", "wheel+ground"])
def test_wrench_of_the_body_turns_with_the_simulated_heading(kind: str) -> None:
    """Against pymunk, told at every step what the kernel is to work out: the force at the heading the step leads to."""
    spec = random_spec(kind, 5)
    wrench = random_wrench(spec, 5)
    world = PhysicsWorld(DT, 300)
    world.add_body(spec)
    states = [world.com_state(kind)]
    for push in wrench:
        heading = states[-1][2] + states[-1][5] * DT
        world.apply_wrench(kind, [*turned(push[:2], heading), push[2]])
        world.step()
        states.append(world.com_state(kind))
    found = simulate(spec, wrench, body_wrench=True)
    np.testing.assert_allclose(found[:, :3], np.array(states)[:, :3], rtol=0, atol=1e-6 if "+" in kind else 1e-9)


def test_one_core_and_two_give_the_same_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(import_module("pbrl_model.rollout"), "SERIAL_STEPS", 0)
    rng = np.random.default_rng(5)
    specs = [random_spec("wheel+hinge", seed) for seed in range(40)]
    rows = np.array([spec.parameters.to_vector() for spec in specs])
    wrench = np.array([random_wrench(specs[0], seed) for seed in range(3)])
    steps = np.array([STEPS, 123, 0])
    initial = rng.normal(size=(40, 3, 6))
    together = rollout(rows, initial, wrench, 0.07, (0.1, 0.2), DT, steps)
    alone = rollout(rows, initial, wrench, 0.07, (0.1, 0.2), DT, steps, parallel=False)
    assert together.tobytes() == alone.tobytes()
    again = rollout(rows, initial, wrench, 0.07, (0.1, 0.2), DT, steps)
    assert together.tobytes() == again.tobytes()


def test_ground_friction_stops_a_sliding_body_where_coulomb_says() -> None:
    """v^2 / (2 mu g) on, and not a hair further, however long one waits."""
    footprint = np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
    spec = BodySpec("box", footprint, BodyParameters(20.0, mu_ground=0.03), np.zeros(3), np.array([0.4, 0.3, 0.0]))
    states = simulate(spec, np.zeros((2500, 3)), dt=0.001)
    travelled = np.linalg.norm(states[-1, :2])
    assert travelled == pytest.approx(0.5**2 / (2 * 0.03 * GRAVITY), rel=2e-3)
    np.testing.assert_array_equal(states[-1, 3:], 0.0)


def test_ground_friction_holds_a_body_below_breakaway_and_lets_go_above() -> None:
    footprint = np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
    spec = BodySpec("box", footprint, BodyParameters(20.0, mu_ground=0.03), np.zeros(3))
    limit = 0.03 * 20.0 * GRAVITY
    held = simulate(spec, np.tile([0.99 * limit, 0.0, 0.0], (100, 1)))
    np.testing.assert_array_equal(held[-1], 0.0)
    gone = simulate(spec, np.tile([2.0 * limit, 0.0, 0.0], (100, 1)))
    assert gone[-1, 3] == pytest.approx(limit / 20.0 * 100 * DT, rel=1e-9)


def test_ground_friction_about_a_held_point_acts_on_the_radius_of_inertia() -> None:
    """A body pinned off its centre slows at mu g / sqrt(d^2 + I/m), the pin stays where it is."""
    footprint = np.array([[-0.4, -0.7], [0.4, -0.7], [0.4, 0.7], [-0.4, 0.7]])
    parameters = BodyParameters(30.0, wheel_x=-0.3, wheel_y=-0.6, mu_x=0.9, mu_y=0.9, mu_ground=0.01)
    omega = 0.8
    spec = BodySpec("table", footprint, parameters, np.zeros(3), omega * np.array([-0.6, 0.3, 1.0]))
    states = simulate(spec, np.zeros((50, 3)), dt=0.001)
    arm = np.sqrt(0.3**2 + 0.6**2 + mass_properties(footprint).inertia_per_mass)
    # A pin that is stepped costs a little speed by itself; what the floor takes is the difference.
    smooth = simulate(replace(spec, parameters=replace(parameters, mu_ground=0.0)), np.zeros((50, 3)), dt=0.001)
    assert smooth[-1, 5] - states[-1, 5] == pytest.approx(0.01 * GRAVITY / arm * 0.05, rel=1e-3)
    theta = states[:, 2]
    pin = states[:, :2] + np.stack([turned(np.array([-0.3, -0.6]), angle) for angle in theta])
    np.testing.assert_allclose(pin, np.broadcast_to([-0.3, -0.6], pin.shape), atol=1e-4)
