"""Errors of pbrl_model. Each message is one line: what was expected, what was got, what to do."""

from __future__ import annotations


class ModelError(Exception):
    """A model, its data or its options cannot be used; the message says why in one line."""
