# SPDX-License-Identifier: Apache-2.0
"""Which arrays of a data set carry which signals."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from touchline.errors import InputError
from touchline.model.description import RobotDescription

# Looked for in this order; what is measured comes before what is computed.
KNOWN: dict[str, tuple[str, ...]] = {
    "q": (
        "observation.state.joint_position",
        "observation.state.joint_positions",
        "observation.joint_position",
        "observation.joint_positions",
        "observation/robot_state/joint_positions",
        "observation.state",
        "obs/joint_positions",
    ),
    "qd": (
        "observation.state.joint_velocity",
        "observation.state.joint_velocities",
        "observation.joint_velocity",
        "observation.joint_velocities",
        "observation.velocity",
        "observation/robot_state/joint_velocities",
        "obs/joint_velocities",
    ),
    "tau": (
        "observation.state.joint_torque",
        "observation.state.joint_torques",
        "observation.joint_torque",
        "observation.joint_torques",
        "observation.effort",
        "observation/robot_state/motor_torques_measured",
        "obs/joint_torques",
    ),
    "wrench": ("observation.wrench", "observation.force_torque", "obs/wrench"),
    "time": ("observation/timestamp/robot_state/read_start",),
}


@dataclass(frozen=True)
class Given:
    """Names that the user gives; None: those of KNOWN are looked for.

    Attributes:
        q: array with the joint positions [rad or m], and `qd` with velocities.
        tau: with the joint torques [Nm].
        wrench: with six numbers for each sensor [N, Nm].
        rate: samples per second, or None for what the data set tells.
        bandwidth: of the observer [rad/s], or None for the description's.
    """

    q: str | None = None
    qd: str | None = None
    tau: str | None = None
    wrench: str | None = None
    rate: float | None = None
    bandwidth: float | None = None

    def check(self) -> None:
        """Raise an InputError where a number makes no sense."""
        for name in ("rate", "bandwidth"):
            value = getattr(self, name)
            if value is not None and not 0 < value < float("inf"):
                raise InputError(f"--{name} {value:g}: must be a positive number")


def choose(
    path: Path, given: Given, widths: Mapping[str, int], description: RobotDescription
) -> dict[str, str]:
    """Signal -> array; a signal that the data set lacks is left out.

    Args:
        path: of the data set, for messages.
        given: by the user.
        widths: of the arrays that there are.
        description: of the robot.

    Raises:
        InputError: an array is missing, or has a wrong width.
    """
    joints, sensors = len(description.joints), 6 * len(description.sensors)
    wanted = {"q": joints, "qd": joints, "tau": joints, "wrench": sensors}
    chosen, problems = {}, []
    for signal, width in wanted.items():
        name = getattr(given, signal)
        if name is None:
            fitting = (n for n in KNOWN[signal] if width and widths.get(n) == width)
            name = next(fitting, None)
        elif name not in widths:
            problems.append(f"{path}: --{signal} {name}: no such array; there are {_list(widths)}")
        elif widths[name] != width:
            found = widths[name]
            problems.append(f"{path}: --{signal} {name}: {found} numbers, but {width} are needed")
        if name is not None:
            chosen[signal] = name
    if not problems and "q" not in chosen:
        told = _list(widths)
        problems.append(f"{path}: no {joints} joint positions found; name them by --q; {told}")
    if not problems and "tau" not in chosen and "wrench" not in chosen:
        problems.append(
            f"{path}: no {joints} joint torques found: without them nothing can be felt; "
            f"name them by --tau; there are {_list(widths)}"
        )
    if problems:
        raise InputError(problems)
    return chosen


def _list(widths: Mapping[str, int]) -> str:
    return ", ".join(f"{name} ({width})" for name, width in widths.items()) or "none"
