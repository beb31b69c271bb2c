"""Krang pushes a table as a plan says: `ros2 launch pbrl_config krang_push.launch.py`; options by `--show-args`."""

from pbrl_bringup.ros.launching import describe


def generate_launch_description():
    """Return the nodes of `config/params/graphs/krang_push.yaml`."""
    return describe("krang_push")
