"""The world model: pymunk world, compiled kernel, priors, likelihood, inference; model_node."""

from pbrl_model.errors import ModelError
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.fitting.fit import Fit, ObjectFit, fit_recording
from pbrl_model.fitting.options import FitOptions
from pbrl_model.parameters import BodyParameters
from pbrl_model.posterior import Posterior
from pbrl_model.predict import Prediction, predict, unlearned
from pbrl_model.rollout import rollout, rollout_states
from pbrl_model.world import BodySpec, PhysicsWorld

__all__ = [
    "BodyParameters",
    "BodySpec",
    "Fit",
    "FitOptions",
    "ModelError",
    "ObjectFit",
    "PhysicsWorld",
    "Posterior",
    "Prediction",
    "fit_recording",
    "motions_of",
    "predict",
    "rollout",
    "rollout_states",
    "unlearned",
]
