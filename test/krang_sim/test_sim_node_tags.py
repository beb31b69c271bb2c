"""Where tags come from, as a parameter of the node."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix


@pytest.mark.parametrize("value", ["renderd", "1.0"])
def test_a_source_of_tags_that_there_is_not_is_one_line(value):
    executable = Path(get_package_prefix("krang_sim")) / "lib" / "krang_sim" / "sim_node"
    done = subprocess.run(
        [str(executable), "--ros-args", "-p", f"tags:={value}"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("sim_node: tags: expected ") and value.strip("0").rstrip(".") in line
