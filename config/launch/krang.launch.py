"""Krang in its room, to be driven: `ros2 launch pbrl_config krang.launch.py`; options by `--show-args`."""

from pbrl_bringup.ros.launching import describe


def generate_launch_description():
    """Return the nodes of `config/params/graphs/krang.yaml`."""
    return describe("krang")
