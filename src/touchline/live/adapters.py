# SPDX-License-Identifier: Apache-2.0
"""From the state objects of robots' own libraries to samples, in one line of the user's loop.

result = pipeline.update(*tl.live.from_franka(robot, arm.state))       # franky, pylibfranka
result = pipeline.update(*tl.live.from_ur_rtde(robot, receive))        # ur-rtde
"""

import time
from typing import Any

from touchline.live.sample import Sample, make_sample, on_nanoseconds
from touchline.model.robot import Robot


def from_franka(
    robot: Robot, state: Any, wrench: Any = None, arrival: float | None = None
) -> Sample:
    """A sample of a Franka arm.

    Args:
        robot: its joints in the arm's order.
        state: of franky or pylibfranka: an object with `time`, `q`, `dq` and `tau_J`.
        wrench: of a force-torque sensor that the arm's library does not know (6,), if there is one.
        arrival: when it came, on the monotonic clock [s]; default: now.

    Raises:
        ValueError: the robot has another number of joints.
    """
    at = _seconds(state.time)
    arrival = time.monotonic() if arrival is None else arrival
    number = round(at * 1e3)  # the arm's clock counts milliseconds
    return make_sample(
        robot, at, state.q, state.dq, state.tau_J, wrench, arrival=arrival, sequence=number
    )


def _seconds(clock: Any) -> float:
    """A time of either library [s]."""
    for name in ("to_sec", "toSec"):
        if hasattr(clock, name):
            return on_nanoseconds(float(getattr(clock, name)()))
    return on_nanoseconds(float(clock))


def from_ur_rtde(robot: Robot, receive: Any, arrival: float | None = None) -> Sample:
    """A sample of a UR arm.

    Torques are currents [A], which the gains of the description turn into Nm. The wrench is
    `getFtRawWrench`, and `getActualTCPForce` where the description says that the weight is out.

    Args:
        robot: its joints in the arm's order.
        receive: `RTDEReceiveInterface` of ur-rtde.
        arrival: when it came, on the monotonic clock [s]; default: now.

    Raises:
        ValueError: the robot has another number of joints.
    """
    wrench = None
    if robot.description.sensors:
        raw = robot.description.sensors[0].compensated == "none"
        wrench = receive.getFtRawWrench() if raw else receive.getActualTCPForce()
    return make_sample(
        robot,
        on_nanoseconds(receive.getTimestamp()),
        receive.getActualQ(),
        receive.getActualQd(),
        receive.getActualCurrent(),
        wrench,
        arrival=time.monotonic() if arrival is None else arrival,
    )
