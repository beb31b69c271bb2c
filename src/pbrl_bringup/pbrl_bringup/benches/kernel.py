"""Steps a second of the compiled world model, against pymunk called from Python; contact; bytes on one core and all.

Times are of this process's own work (CPU seconds), the best of several runs, wrappers and their checks included, so
that what else the machine does matters little.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pymunk
from numpy.typing import NDArray

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_model.distributions import Uniform
from pbrl_model.engines.contact_world import ContactScene, contact_scene, rollout_contact, start_states
from pbrl_model.geometry import mass_properties
from pbrl_model.inference.infer import infer
from pbrl_model.inference.open_loop import OpenLoop
from pbrl_model.parameters import BodyParameters
from pbrl_model.priors import Prior
from pbrl_model.rollout import rollout, rollout_states
from pbrl_model.world import BodySpec, PhysicsWorld, simulate_body

Array = NDArray[np.float64]

DT = 0.01
TABLE = np.array([[-0.75, -0.375], [0.75, -0.375], [0.75, 0.375], [-0.75, 0.375]])
SQUARE = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])
ROOM = np.array([[-2.0, -2.0], [3.0, -2.0], [3.0, 2.0], [-2.0, 2.0]])
WHEEL = {"wheel_x": -0.6, "wheel_y": 0.3, "wheel_theta": 0.4, "mu_x": 0.02, "mu_y": 0.5}
KINDS = {
    "free": BodyParameters(30.0),
    "wheel": BodyParameters(30.0, **WHEEL),
    "wheel and floor": BodyParameters(30.0, **WHEEL, mu_ground=0.01),
    "joint": BodyParameters(30.0, hinge_x=0.0, hinge_y=1.0, hinge_radius=1.0),
    "wheel and joint": BodyParameters(30.0, **WHEEL, hinge_x=0.0, hinge_y=1.0, hinge_radius=1.0),
}
ROWS, WINDOWS, STEPS = 256, 8, 500
CONVERGED = 300  # sweeps after which Chipmunk's wheel has settled
COMPARED = 500  # steps
COMPARABLE = ("free", "wheel", "wheel and floor", "joint")
"""Every kind of body but a wheel with a joint, where Chipmunk itself converges too slowly to be compared with."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Time rollouts of every kind of body, the same step through pymunk, and contact."""
    rng = np.random.default_rng(seed)
    repeats = 5 if quick else 20
    kernel = {name: kernel_seconds(body, rng, ROWS // (4 if quick else 1), repeats) for name, body in KINDS.items()}
    alone = kernel_seconds(KINDS["wheel"], rng, 1, repeats, windows=1)
    rows = [
        speed_row(kernel, alone),
        ratio_row(kernel["wheel"], rng, repeats),
        agreement_row(rng, 2 if quick else 20),
        contact_row(rng, repeats),
        bytes_row(rng),
    ]
    return Measured(rows, {"seconds_per_step": kernel, "seconds_per_step_of_one_body_alone": alone})


def speed_row(kernel: dict[str, float], alone: float) -> Row:
    """Return the row of steps a second on one core."""
    others = {f"{name} [1/s]": 1.0 / seconds for name, seconds in kernel.items() if name != "wheel"}
    return at_least(
        "steps a second of a body with a wheel, on one core",
        1.0 / kernel["wheel"],
        "1/s",
        20e6,
        **others,
        **{"wheel, one row and one window in a call [1/s]": 1.0 / alone},
    )


def ratio_row(kernel: float, rng: np.random.Generator, repeats: int) -> Row:
    """Return the row of the same step through pymunk from Python over the kernel's."""
    user, space, least = (pymunk_seconds(rng, repeats, how) for how in ("user", "space", "least"))
    return at_least(
        "a step of a body with a wheel: pymunk from Python over the kernel",
        user / kernel,
        "1",
        100.0,
        **{
            "kernel [us]": kernel * 1e6,
            "pymunk: push, step, read [us]": user * 1e6,
            "pymunk: space.step alone [us]": space * 1e6,
            "pymunk: space.step alone, 10 sweeps [us]": least * 1e6,
        },
    )


def agreement_row(rng: np.random.Generator, trials: int) -> Row:
    """Return the row of how far the kernel's poses are from those of pymunk's converged sweeps."""
    worst = {name: max(disagreement(KINDS[name], rng) for _ in range(trials)) for name in COMPARABLE}
    return at_most(
        f"rollouts of {COMPARED} steps: furthest from pymunk with {CONVERGED} sweeps",
        max(worst.values()),
        "m",
        1e-6,
        **{f"{name} [m]": value for name, value in worst.items()},
    )


def contact_row(rng: np.random.Generator, repeats: int) -> Row:
    """Return the row of three bodies that touch: pymunk from Python over the compiled driving of Chipmunk."""
    scene, rows, start = touching()
    wrench = pushes(rng, 1, 200, 3)[0]
    compiled = best(lambda: rollout_contact(scene, rows, start, wrench, DT, parallel=False), repeats) / len(wrench)
    few = best(lambda: rollout_contact(scene, rows, start, wrench, DT, iterations=10, parallel=False), repeats)
    python = best(lambda: contact_through_pymunk(wrench), 3) / len(wrench)
    return at_least(
        "a step of three bodies and a wheel in contact: pymunk from Python over ours",
        python / compiled,
        "1",
        3.0,
        **{
            "ours [us]": compiled * 1e6,
            "ours, 10 sweeps [us]": few / len(wrench) * 1e6,
            "pymunk: push, step, read [us]": python * 1e6,
        },
    )


def bytes_row(rng: np.random.Generator) -> Row:
    """Return the row of results whose bytes depend on how many cores worked on them."""
    table, cores = mass_properties(TABLE), numba.get_num_threads()
    rows = np.array([body.to_vector() for body in KINDS.values()] * 40)
    rows[:, 0] *= rng.uniform(0.5, 2.0, len(rows))
    wrench, start = pushes(rng, 6, STEPS), np.zeros((6, 6))
    scene, bodies, poses = touching()
    worlds = np.tile(bodies, (20, 1, 1)) * rng.uniform(0.8, 1.2, (20, 1, 1))
    contact = pushes(rng, 1, 100, 3)[0]
    problem = pushed_table(rng)
    theta = problem.sample_prior(rng, 512)
    seed = int(rng.integers(2**31))
    work: dict[str, Callable[[bool], Array]] = {
        "rollouts": lambda all_cores: rollout(rows, start, wrench, table.inertia_per_mass, parallel=all_cores),
        "contact": lambda all_cores: rollout_contact(scene, worlds, poses, contact, DT, parallel=all_cores),
        "likelihood": lambda all_cores: replace(problem, parallel=all_cores).log_likelihood(theta),
        "posterior": lambda all_cores: (
            infer(np.random.default_rng(seed), replace(problem, parallel=all_cores), guesses=theta[:1]).draws
        ),
    }
    same = {name: float(run(True).tobytes() == run(False).tobytes()) for name, run in work.items()}
    what = f"of {', '.join(work)}: how many have the same bytes on one core and on all"
    return at_least(what, sum(same.values()), "1", len(work), cores=cores, **same)


def pushed_table(rng: np.random.Generator) -> OpenLoop:
    """Return what a push of three seconds, seen from the body, says of a table's mass and wheel."""
    body, names = mass_properties(TABLE), ("mass", "wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y")
    wrench = pushes(rng, 1, 300)[0]
    idle = np.concatenate([wrench, np.zeros((1, 3))])[None]
    row = KINDS["wheel"].to_vector()[None]
    poses = rollout(row, np.zeros((1, 6)), idle, body.inertia_per_mass, dt=DT, body_wrench=True)[0, 0, 2:]
    noise = np.array([0.003, 0.003, 0.01])
    low, high = (5.0, -0.75, -0.375, -np.pi / 2, 0.0, 0.0), (90.0, 0.75, 0.375, np.pi / 2, 1.0, 1.0)
    prior = Prior({name: Uniform(*ends) for name, *ends in zip(names, low, high, strict=True)})
    return OpenLoop(prior, wrench, poses + rng.normal(size=poses.shape) * noise, noise, body.inertia_per_mass, dt=DT)


def kernel_seconds(
    body: BodyParameters, rng: np.random.Generator, rows: int, repeats: int, windows: int = WINDOWS
) -> float:
    """Return the CPU seconds of one step of one body in the kernel, on one core."""
    table = mass_properties(TABLE)
    parameters = np.tile(body.to_vector(), (rows, 1))
    parameters[:, 0] *= rng.uniform(0.8, 1.2, rows)
    wrench, start = pushes(rng, windows, STEPS), np.zeros((windows, 6))
    seconds = best(lambda: rollout(parameters, start, wrench, table.inertia_per_mass, dt=DT, parallel=False), repeats)
    return seconds / (rows * windows * STEPS)


def pymunk_seconds(rng: np.random.Generator, repeats: int, how: str) -> float:
    """Return the CPU seconds of one step of a body with a wheel in pymunk.

    Args:
        rng: of the pushes.
        repeats: of which the best counts.
        how: "user": push, step and read the state, as one would write it; "space": the space's step alone; "least": the
            same with Chipmunk's own ten sweeps.
    """
    spec = BodySpec("table", TABLE, KINDS["wheel"], np.zeros(3))
    wrench = pushes(rng, 1, 300)[0]

    def run() -> None:
        world = PhysicsWorld(DT, 10) if how == "least" else PhysicsWorld(DT)
        world.add_body(spec)
        if how == "user":
            for push in wrench:
                world.apply_wrench("table", push)
                world.step()
                world.com_state("table")
        else:
            space: pymunk.Space = world.space
            for _ in wrench:
                space.step(DT)

    return best(run, repeats) / len(wrench)


def disagreement(body: BodyParameters, rng: np.random.Generator) -> float:
    """Return how far a random table of one kind gets from where pymunk takes it [m]."""
    table = mass_properties(TABLE)
    vector = body.to_vector()
    vector[:6] *= rng.uniform(0.5, 1.5, 6)
    spec = BodySpec("table", TABLE, BodyParameters.from_vector(vector), np.zeros(3))
    wrench = pushes(rng, 1, COMPARED)[0]
    ours = rollout_states(vector[None], np.zeros((1, 6)), wrench[None], table.inertia_per_mass, table.com, DT)[0, 0]
    return float(np.abs(ours[:, :2] - simulate_body(spec, wrench, DT, CONVERGED)[:, :2]).max())


def pushes(rng: np.random.Generator, windows: int, steps: int, *bodies: int) -> Array:
    """Return random wrenches (windows, steps, *bodies, 3) that change every quarter of a second."""
    levels = rng.normal(size=(windows, steps // 25, *bodies, 3)) * [60.0, 60.0, 15.0]
    return np.repeat(levels, 25, axis=1)


def touching() -> tuple[ContactScene, Array, Array]:
    """Return a square that stands at a table with a wheel and at another square: scene, parameters, start."""
    scene = contact_scene([SQUARE, TABLE, SQUARE], [ROOM])
    bodies = (BodyParameters(10.0), KINDS["wheel"], BodyParameters(8.0, mu_ground=0.02))
    rows = np.array([[*body.to_vector(), 0.1, 0.4] for body in bodies])
    return scene, rows, start_states(scene, np.array(PLACES))


PLACES = [[-0.7, 0.0, 0.1], [0.45, 0.2, 0.1], [-0.7, 0.7, 0.0]]


def contact_through_pymunk(wrench: Array) -> None:
    """Do what `rollout_contact` does, as one would write it with pymunk."""
    _, rows, _ = touching()
    world = PhysicsWorld(DT)
    world.add_walls(ROOM)
    for k, footprint in enumerate((SQUARE, TABLE, SQUARE)):
        body = BodyParameters.from_vector(rows[k, :12])
        world.add_body(BodySpec(str(k), footprint, body, np.array(PLACES[k]), np.zeros(3), 0.1, 0.4))
    for push in wrench:
        for k in range(3):
            world.apply_wrench(str(k), push[k])
        world.step()
        for k in range(3):
            world.com_state(str(k))


def best(run: Callable[[], object], repeats: int) -> float:
    """Return the least CPU seconds of several runs, after one that does not count."""
    run()
    least = np.inf
    for _ in range(repeats):
        started = time.process_time()
        run()
        least = min(least, time.process_time() - started)
    return float(least)
