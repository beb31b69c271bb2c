"""How the middleware of a graph's nodes is told to stay on this machine, and off shared memory."""

from __future__ import annotations

from collections.abc import Mapping

from pbrl_bringup.paths import config_file

RANGE, PROFILES = "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"
TRANSPORTS, MIDDLEWARE = "FASTDDS_BUILTIN_TRANSPORTS", "RMW_IMPLEMENTATION"
LOCALHOST = "LOCALHOST"


def on_this_machine(environment: Mapping[str, str]) -> dict[str, str]:
    """Return variables with which nodes find and hear each other on this machine only.

    With Fast DDS that is a profile of UDP on the loopback interface. `LOCALHOST` would mean shared memory as well,
    whatever `FASTDDS_BUILTIN_TRANSPORTS` says (rmw_fastrtps adds it), and there whoever is killed may take with it what
    others hear or say (Fast DDS 5469, rmw_fastrtps 908). What a user has settled stays: another range, a profile,
    transports, another middleware.

    Args:
        environment: the nodes' own, so far.

    Raises:
        BringupError: the workspace's configuration is not installed.
    """
    profile = str(config_file("middleware", "fast_dds", ".xml"))
    settled = (
        environment.get(RANGE, LOCALHOST) != LOCALHOST
        or environment.get(PROFILES, profile) != profile
        or TRANSPORTS in environment
        or not environment.get(MIDDLEWARE, "rmw_fastrtps_cpp").startswith("rmw_fastrtps")
    )
    if settled:
        return {RANGE: environment.get(RANGE, LOCALHOST)}
    return {PROFILES: profile, RANGE: "SYSTEM_DEFAULT"}
