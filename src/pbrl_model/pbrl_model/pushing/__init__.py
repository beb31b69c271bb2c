"""Boxes on a table that are pushed by a ball: quasi-static physics, and what it takes to learn it."""

from pbrl_model.pushing.learn import ObservedPush, PushPosterior, PushProblem, learn_pushes, predicted

__all__ = ["ObservedPush", "PushPosterior", "PushProblem", "learn_pushes", "predicted"]
