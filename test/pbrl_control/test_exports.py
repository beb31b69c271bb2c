"""What the package offers a library user, and what importing it does not cost."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

import pbrl_control


@pytest.mark.parametrize("name", pbrl_control.__all__)
def test_every_name_is_there(name: str) -> None:
    assert getattr(pbrl_control, name).__name__ == name


@pytest.mark.parametrize("module", pbrl_control.LATER)
def test_what_comes_later_is_what_its_module_has(module: str) -> None:
    for name in pbrl_control.LATER[module]:
        assert name in pbrl_control.__all__
        assert getattr(pbrl_control, name) is getattr(importlib.import_module(module), name)


def test_a_name_that_is_not_there_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'sample_grasp'"):
        pbrl_control.sample_grasp  # noqa: B018


def test_a_controller_starts_without_models_planners_and_ros() -> None:
    code = "import pbrl_control, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"pbrl_model", "pymunk", "ompl", "rclpy"} & set(result.stdout.split())
