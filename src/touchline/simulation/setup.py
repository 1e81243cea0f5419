# SPDX-License-Identifier: Apache-2.0
"""How a robot stands and how stiffly it is held in the simulation."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.model.robot import Robot

FILE = "simulation.yaml"  # beside the model


@dataclass(frozen=True)
class Setup:
    """Poses and gains, (n,) each.

    Attributes:
        home: a pose away from singularities [rad].
        stretched: a singular pose [rad]; where none is given, all joints at 0 or close to it.
        stiffness: of joint impedance control [Nm/rad]; None: not known.
        damping: [Nm s/rad]; None: not known.
        lower, upper: the range that motions keep to [rad].
        speed: limits [rad/s].
    """

    home: Array
    stretched: Array
    stiffness: Array | None
    damping: Array | None
    lower: Array
    upper: Array
    speed: Array


def read_setup(robot: Robot) -> Setup:
    """The file beside the robot's model where there is one; otherwise the middle of the ranges.

    Raises:
        InputError: the file does not fit the robot, or the robot has no joint.
    """
    if not robot.joint_names:
        raise InputError(f"robot {robot.name}: has no joint, and only arms are simulated")
    joints = [robot.mechanism.joints[name] for name in robot.joint_names]
    lower = np.array([max(j.lower, -np.pi if j.kind == "revolute" else -0.5) for j in joints])
    upper = np.array([min(j.upper, np.pi if j.kind == "revolute" else 0.5) for j in joints])
    margin = 0.02 * (upper - lower)
    values = _file_values(robot.description.model.parent / FILE, len(joints))
    middle = (lower + upper) / 2
    return Setup(
        values.get("home", middle),
        values.get("stretched", np.minimum(np.maximum(lower + margin, 0.0), upper - margin)),
        values.get("stiffness"),
        values.get("damping"),
        lower + margin,
        upper - margin,
        np.array([j.velocity for j in joints]),
    )


def _file_values(path: Path, n: int) -> dict[str, Array]:
    import yaml

    if not path.is_file():
        return {}
    known = ("home", "stretched", "stiffness", "damping")
    values: dict[str, Array] = {}
    problems = []
    for key, value in (yaml.safe_load(path.read_text()) or {}).items():
        if key not in known:
            problems.append(f"{path}: unknown key '{key}'; allowed: {', '.join(known)}")
        elif np.shape(value) != (n,):
            problems.append(f"{path}: {key} has shape {np.shape(value)}, but {n} joints observed")
        else:
            values[key] = np.array(value, float)
    if problems:
        raise InputError(problems)
    return values
