"""Slow pushes: the kernel against the pymunk world, what follows from the laws, and learning with a known answer."""

from __future__ import annotations

import math

import numpy as np
import pymunk
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.geometry import MassProperties
from pbrl_model.inference.infer import InferenceOptions
from pbrl_model.parameters import BodyParameters
from pbrl_model.pushing import ObservedPush, PushProblem, learn_pushes, predicted
from pbrl_model.pushing.kernel import twist_of
from pbrl_model.world import BodySpec, PhysicsWorld

HALF, BALL = np.array([0.065, 0.025]), 0.012
GYRATION = math.hypot(0.13, 0.05) / math.sqrt(12.0)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def path(x: float, y: float, angle: float, travel: float = 0.05) -> np.ndarray:
    """A way of the ball that touches at a point of the box's border, from outside."""
    way = np.array([math.cos(angle), math.sin(angle)])
    return np.array([np.array([x, y]) - 0.02 * way, np.array([x, y]) + (travel - BALL) * way])


PATHS = [
    path(-0.065, 0.0, 0.0),
    path(0.055, -0.025, math.pi / 2),
    path(0.02, 0.025, -math.pi / 2),
    path(-0.03, -0.025, 1.2),
    path(0.065, 0.01, math.pi + 0.3),
]


def row(x: float = 0.0, y: float = 0.0, radius: float = GYRATION, mu: float = 0.3) -> np.ndarray:
    return np.array([[x, y, math.log(radius), mu, 0.0]])


def in_pymunk(way: np.ndarray, com: tuple[float, float], mu: float) -> np.ndarray:
    """Push the same box in `PhysicsWorld` by a ball that goes slowly, whatever it meets.

    That world takes friction from the speed that contact gave: what is taken in a step has to be far below it.
    """
    corners = HALF * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    told = MassProperties(4 * HALF.prod(), np.array(com), GYRATION**2)
    world = PhysicsWorld(dt=5e-4, iterations=60)
    world.space.collision_slop = 1e-5
    world.add_body(
        BodySpec(
            "box", corners, BodyParameters(0.1, mu_ground=0.1), np.zeros(3), contact_friction=mu, mass_properties=told
        )
    )
    ball = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    shape = pymunk.Circle(ball, BALL)
    shape.friction, shape.elasticity = 1.0, 0.0
    ball.position = tuple(way[0])
    world.space.add(ball, shape)
    length = float(np.hypot(*(way[1] - way[0])))
    speed = 0.02
    ball.velocity = tuple(speed / length * (way[1] - way[0]))
    for _ in range(round(length / speed / world.dt)):
        world.step()
    return world.pose("box")


@pytest.mark.parametrize("number", range(len(PATHS)))
@pytest.mark.parametrize("com", [(0.0, 0.0), (-0.02, 0.006)])
def test_the_kernel_is_the_slow_limit_of_the_pymunk_world(number: int, com: tuple[float, float]) -> None:
    expected = in_pymunk(PATHS[number], com, 0.3)
    found = predicted(row(*com), HALF, BALL, PATHS[number].reshape(1, 4))[0, 0]
    np.testing.assert_allclose(found[:2], expected[:2], atol=4e-4)
    assert abs(found[2] - expected[2]) < 0.012


def test_a_push_through_the_centre_turns_nothing_and_goes_as_far_as_the_ball() -> None:
    moved = predicted(row(), HALF, BALL, PATHS[0].reshape(1, 4))[0, 0]
    np.testing.assert_allclose(moved, [0.05, 0.0, 0.0], atol=2e-4)


def test_mirrored_pushes_do_mirrored_things() -> None:
    for way in PATHS:
        mirrored = way * [1.0, -1.0]
        one, other = (predicted(row(), HALF, BALL, each.reshape(1, 4))[0, 0] for each in (way, mirrored))
        np.testing.assert_allclose(one * [1.0, -1.0, -1.0], other, atol=1e-9)


def test_twists_keep_the_contact_or_the_friction_cone(rng: np.random.Generator) -> None:
    sliding = 0
    for _ in range(300):
        px, py, angle, way, mu = *rng.uniform(-0.1, 0.1, 2), *rng.uniform(-3, 3, 2), rng.uniform(0.05, 0.8)
        n, v = (np.array([math.cos(a), math.sin(a)]) for a in (angle, way))
        twist = np.array(twist_of(px, py, *n, *v, 0.05, mu))
        if v @ n <= 0.0:
            assert not twist.any(), "a ball that goes away moves nothing"
            continue
        point = twist[:2] + twist[2] * np.array([-py, px])
        assert point @ n == pytest.approx(v @ n), "the side gives way as fast as the ball comes"
        force = twist[:2]  # the ellipsoid's normal: the force, up to a factor
        along, normal = -force[0] * n[1] + force[1] * n[0], force @ n
        assert abs(along) <= mu * normal + 1e-9
        assert twist[2] == pytest.approx((px * force[1] - py * force[0]) / 0.05**2)
        if abs(abs(along) - mu * normal) < 1e-9:
            sliding += 1
        else:
            np.testing.assert_allclose(point, v, atol=1e-9)
    assert 20 < sliding < 280


def test_friction_is_learned_from_three_pushes_and_predicts_others(rng: np.random.Generator) -> None:
    truth = row(-0.02, 0.003, 0.045, 0.25)
    noise = np.array([0.0005, 0.0005, 0.005])
    seen = [
        ObservedPush(way, predicted(truth, HALF, BALL, way.reshape(1, 4))[0, 0] + noise * rng.normal(size=3))
        for way in PATHS[:3]
    ]
    known = learn_pushes(np.random.default_rng(1), HALF, BALL, seen)
    assert known.inference.converged, known.inference.notes
    mean, spread = known.predict(PATHS[3:])
    expected = np.array([predicted(truth, HALF, BALL, way.reshape(1, 4))[0, 0] for way in PATHS[3:]])
    assert (np.abs(mean - expected) < 4.0 * spread + 1e-4).all()
    assert abs(known.draws[:, 0].mean() + 0.02) < 4.0 * known.draws[:, 0].std()
    again = learn_pushes(np.random.default_rng(1), HALF, BALL, seen)
    assert known.draws.tobytes() == again.draws.tobytes()


def test_the_evidence_is_that_of_a_sum_over_the_prior(rng: np.random.Generator) -> None:
    seen = [ObservedPush(PATHS[1], np.array([0.0, 0.02, 0.5]))]
    problem = PushProblem(HALF, BALL, seen)
    values = problem.log_likelihood(problem.sample_prior(rng, 40_000))
    plain = float(np.log(np.mean(np.exp(values - values.max()))) + values.max())
    known = learn_pushes(np.random.default_rng(2), HALF, BALL, seen, InferenceOptions(draws=4000))
    assert known.inference.log_evidence == pytest.approx(plain, abs=0.15)


def test_what_is_no_push_is_refused() -> None:
    with pytest.raises(ModelError, match="at least one"):
        learn_pushes(np.random.default_rng(0), HALF, BALL, [])
    with pytest.raises(ModelError, match="finite path"):
        learn_pushes(np.random.default_rng(0), HALF, BALL, [ObservedPush(np.full((2, 2), np.nan), np.zeros(3))])
    with pytest.raises(ModelError, match="all finite"):
        learn_pushes(np.random.default_rng(0), HALF, BALL, [ObservedPush(PATHS[0], np.array([0.0, np.inf, 0.0]))])
