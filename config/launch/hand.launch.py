"""A hand that pushes when `/push` is called: `ros2 launch pbrl_config hand.launch.py`, options by `--show-args`."""

from pbrl_bringup.ros.launching import describe


def generate_launch_description():
    """Return the nodes of `config/params/graphs/hand.yaml`."""
    return describe("hand")
