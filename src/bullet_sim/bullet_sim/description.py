"""Where the installed workspace keeps the descriptions of its robots."""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from bullet_sim.errors import SimError


def installed_description(robot: str) -> Path:
    """Find the URDF of a robot, `krang` for example.

    Raises:
        SimError: the package of robot descriptions is not installed, or has no such robot.
    """
    try:
        share = Path(get_package_share_directory("pbrl_description"))
    except PackageNotFoundError:
        raise SimError(
            "package pbrl_description: expected in the ament index, not found; source the workspace"
        ) from None
    path = share / robot / f"{robot}.urdf"
    if not path.is_file():
        raise SimError(f"{path}: expected the URDF of {robot}, there is no such file; build the workspace again")
    return path
