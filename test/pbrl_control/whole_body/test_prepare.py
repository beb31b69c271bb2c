"""What is compiled beforehand is all that a tick needs."""

from __future__ import annotations

from typing import get_args

import pytest

from pbrl_control.limits_kernel import velocity_range
from pbrl_control.settings import BaseSettings, ControllerSettings
from pbrl_control.whole_body.prepare import compile_kernels
from pbrl_control.whole_body.program_kernel import lay_program
from pbrl_control.whole_body.steering_kernel import steer


@pytest.mark.parametrize("steering", get_args(BaseSettings.model_fields["steering"].annotation))
def test_every_kernel_is_compiled_whatever_the_steering(steering: str) -> None:
    compile_kernels(ControllerSettings(base=BaseSettings(steering=steering)))
    assert velocity_range.signatures
    assert lay_program.signatures
    assert steer.signatures or steering != "predictive"
