"""Names, columns and classes of parameters."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_model import kernel
from pbrl_model.errors import ModelError
from pbrl_model.parameters import KERNEL_COLUMNS, MODEL_CLASSES, UNITS, BodyParameters, expand, free_columns


def test_vector_round_trip() -> None:
    vector = np.arange(1.0, 13.0)
    np.testing.assert_array_equal(BodyParameters.from_vector(vector).to_vector(), vector)
    assert BodyParameters.from_vector(vector).mu_ground == 12.0


def test_the_kernel_counts_columns_as_the_names_do() -> None:
    for index, name in enumerate(KERNEL_COLUMNS):
        assert getattr(kernel, name.upper()) == index
    assert set(UNITS) == set(KERNEL_COLUMNS)


def test_defaults_are_a_free_body() -> None:
    body = BodyParameters(3.0)
    assert not body.has_wheel and not body.has_hinge
    assert BodyParameters(3.0, mu_y=0.1).has_wheel
    assert BodyParameters(3.0, hinge_radius=0.0).has_hinge


@pytest.mark.parametrize("name", MODEL_CLASSES)
def test_expand_fills_learned_columns_and_keeps_the_others(name: str) -> None:
    base = BodyParameters.from_vector(np.arange(1.0, 13.0))
    names = free_columns(name)
    free = np.random.default_rng(0).normal(size=(4, len(names)))
    rows = expand(free, names, base)
    for column, known in enumerate(KERNEL_COLUMNS):
        expected = free[:, names.index(known)] if known in names else np.full(4, column + 1.0)
        np.testing.assert_array_equal(rows[:, column], expected)


def test_misspelt_names_are_answered_with_the_nearest() -> None:
    with pytest.raises(ModelError, match="did you mean 'wheel'"):
        free_columns("wheels")
    with pytest.raises(ModelError, match="did you mean 'mass'"):
        expand(np.ones((1, 1)), ("mas",), BodyParameters(1.0))
    with pytest.raises(ModelError, match="1 columns"):
        expand(np.ones((1, 2)), ("mass",), BodyParameters(1.0))
    with pytest.raises(ModelError, match="12 columns"):
        BodyParameters.from_vector(np.ones(10))
