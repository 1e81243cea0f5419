# SPDX-License-Identifier: Apache-2.0
"""Keeps ROS 2 on this machine unless the shell says otherwise."""

import os
from pathlib import Path

RANGE, HERE = "ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"
PROFILES, RMW, FAST = "FASTDDS_DEFAULT_PROFILES_FILE", "RMW_IMPLEMENTATION", "rmw_fastrtps_cpp"
# The range alone keeps discovery local, but Fast DDS still receives at every address.
LOOPBACK = Path(__file__).with_name("loopback.xml")


def keep_local() -> str | None:
    """To be called before rclpy is initialised; returns what the user should know, if anything."""
    told = RANGE in os.environ
    os.environ.setdefault(RANGE, HERE)
    if os.environ[RANGE] == HERE and os.environ.get(RMW, FAST) == FAST:
        os.environ.setdefault(PROFILES, str(LOOPBACK))
    if told:
        return None
    return f"ROS 2 is kept to this machine; {RANGE}=SUBNET reaches other ones"
