"""Krang finds its way among furniture: `ros2 launch pbrl_config namo.launch.py`; options by `--show-args`."""

from pbrl_bringup.ros.launching import describe


def generate_launch_description():
    """Return the nodes of `config/params/graphs/namo.yaml`."""
    return describe("namo")
