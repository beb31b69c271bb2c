"""An arm straightens a desk: `ros2 launch pbrl_config tabletop.launch.py`; options by `--show-args`."""

from pbrl_bringup.ros.launching import describe


def generate_launch_description():
    """Return the nodes of `config/params/graphs/tabletop.yaml`."""
    return describe("tabletop")
