"""The PR2 pushes its cart through an office: `ros2 launch pbrl_config pr2.launch.py`; options by `--show-args`."""

from pbrl_bringup.ros.launching import describe


def generate_launch_description():
    """Return the nodes of `config/params/graphs/pr2.yaml`."""
    return describe("pr2")
