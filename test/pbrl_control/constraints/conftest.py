"""Objects of each model class, drawn at random."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_model.parameters import BodyParameters

TABLE = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])


@pytest.fixture
def table() -> Callable[..., ObjectModel]:
    def make(mass: float = 33.0, **parameters: float) -> ObjectModel:
        return ObjectModel.uniform(BodyParameters(mass=mass, **parameters), TABLE)

    return make


@pytest.fixture
def draw(rng: np.random.Generator) -> Callable[[str], ObjectModel]:
    """Return a maker of random models of a kind: free, wheel, locked, pivot, bar (a hinge at a distance)."""

    def make(kind: str) -> ObjectModel:
        place = {"wheel_x": rng.uniform(-0.3, 0.3), "wheel_y": rng.uniform(-0.7, 0.7)}
        place["wheel_theta"] = rng.uniform(-np.pi, np.pi)
        anchor = {"anchor_x": rng.uniform(-0.4, 0.4), "anchor_y": rng.uniform(-0.7, 0.7)}
        low, high = rng.uniform(0.01, 0.05), rng.uniform(0.35, 0.9)
        few = {
            "free": {**place, "mu_x": low, "mu_y": rng.uniform(0.0, 0.03)},
            "wheel": {**place, "mu_x": low, "mu_y": high}
            if rng.random() < 0.5
            else {**place, "mu_x": high, "mu_y": low},
            "locked": {**place, "mu_x": high, "mu_y": rng.uniform(0.35, 0.9)},
            "pivot": {**anchor, "hinge_x": 1.0, "hinge_y": -0.5, "hinge_radius": 0.0},
            "bar": {**anchor, "hinge_x": 1.0, "hinge_y": -0.5, "hinge_radius": rng.uniform(0.3, 1.0)},
        }[kind]
        shift = rng.uniform(-0.2, 0.2, size=2)
        parameters = BodyParameters(mass=rng.uniform(20.0, 45.0), mu_ground=rng.uniform(0.01, 0.08), **few)
        return ObjectModel.uniform(parameters, TABLE + shift)

    return make


def pose_of(model: ObjectModel, rng: np.random.Generator) -> np.ndarray:
    """Return a random pose (3,) in which the object's anchor is at its distance from the hinge."""
    parameters = model.parameters
    theta = rng.uniform(-np.pi, np.pi)
    c, s = np.cos(theta), np.sin(theta)
    anchor = np.array([[c, -s], [s, c]]) @ [parameters.anchor_x, parameters.anchor_y]
    way = rng.uniform(-np.pi, np.pi)
    radius = parameters.hinge_radius if parameters.has_hinge else 0.0
    end = np.array([parameters.hinge_x, parameters.hinge_y]) + radius * np.array([np.cos(way), np.sin(way)])
    return np.array([*(end - anchor), theta])


@pytest.fixture
def place(rng: np.random.Generator) -> Callable[[ObjectModel], np.ndarray]:
    return lambda model: pose_of(model, rng)
