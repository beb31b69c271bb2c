"""What is compiled beforehand is all that a tick needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from pbrl_control.settings import BaseSettings

MOST = 0.05  # [s] of processor time in a tick
TICKS = """
import sys, time
from collections.abc import Iterator
from pathlib import Path
import numpy as np
from numba.core import event
from pbrl_control.controller import BodyController
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.settings import BaseSettings, ControllerSettings
from pbrl_control.types import BodyState, Hold, PlanarTwist
from pbrl_control.whole_body.prepare import compile_kernels

settings = ControllerSettings(base=BaseSettings(steering=sys.argv[2]))
compile_kernels(settings)
with event.install_recorder("numba:compile") as compiled:
    controller = BodyController(RobotKinematics.from_file(Path(sys.argv[1])), settings)
    nominal = np.array(settings.nominal)
    state = BodyState(Posture(2.732, 0.0, nominal, -nominal))
    forces = np.arange(12.0)
    forces.flags.writeable = False
    wrenches = {"left": forces[::2], "right": np.arange(6)}  # neither of the layout and type that is usual
    table = {side: Hold("table", np.arange(2), 0, np.ones(3)) for side in SIDES}
    scenes = [
        ({"base": PlanarTwist(0.1)}, {}),
        ({"left_ft": PlanarTwist(0.1), "right_ft": PlanarTwist(vz=0.1)}, {}),
        ({"table": PlanarTwist(0.1, 0.1, 0.1)}, {"left": Hold("table", np.zeros(2))}),
        ({"table": PlanarTwist(0.1, 0.1, 0.1)}, table),
        ({}, table),
    ]
    longest = 0.0
    for twists, holds in scenes:
        for _ in range(3):
            started = time.thread_time()
            command = controller.tick(state, twists, holds, wrenches, 0.01)
            longest = max(longest, time.thread_time() - started)
            assert not command.report, command.report
print(len(compiled.buffer), longest)
"""


@pytest.mark.parametrize("steering", get_args(BaseSettings.model_fields["steering"].annotation))
def test_after_it_no_tick_compiles_anything(steering: str, root: Path) -> None:
    command = [sys.executable, "-c", TICKS, str(root / "urdf/krang/krang.urdf"), steering]
    result = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
    assert result.returncode == 0, result.stderr
    compiled, longest = result.stdout.split()
    assert int(compiled) == 0
    assert float(longest) < MOST
