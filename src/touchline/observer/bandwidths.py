# SPDX-License-Identifier: Apache-2.0
"""Bandwidths in use, beside the sample rate."""

from touchline.model.robot import Robot
from touchline.tuning import DEFAULTS

TUSTIN_LIMIT, RINGING = DEFAULTS["observer.tustin_steps"], 1.0  # of bandwidth times period
SUGGESTED = 1 / 3
MERGES = DEFAULTS["detector.confirm"]  # times 1 / K: what stood there before a touch takes so long


def bandwidths(robot: Robot, override: float | None) -> dict[float, list[str]]:
    """Every bandwidth in use [rad/s], with the joints and sensors that use it."""
    users: dict[float, list[str]] = {}
    joints = robot.description.bandwidth_joints
    if len(set(joints)) == 1 or override:
        users[override or joints[0]] = ["all joints"]
    else:
        for name, value in zip(robot.joint_names, joints, strict=True):
            users.setdefault(value, []).append(name)
    for name in robot.sensor_names:
        users.setdefault(override or robot.description.bandwidth_sensors[name], []).append(name)
    return users


def bandwidth_warnings(users: dict[float, list[str]], period: float) -> list[str]:
    """What there is to say of bandwidths that are high for the sample rate."""
    lines = []
    for value, names in users.items():
        product = value * period
        if product <= TUSTIN_LIMIT:
            continue
        what = f"bandwidth {value:g} rad/s at {1 / period:.4g} Hz (K dt = {product:.2f}"
        who = ", ".join(names)
        if product > RINGING:
            better = one_digit(SUGGESTED / period)
            lines.append(
                f"{what} > 1) of {who}: the estimates are as noisy as single samples; about "
                f"{better:g} (--bandwidth {better:g}, or under observer) makes them smoother, but "
                f"touches shorter than {MERGES / better:.1g} s are missed or flow together"
            )
        else:
            lines.append(f"{what} > 0.5) of {who}: the exponential form of the filter is in use")
    return lines


def one_digit(value: float) -> float:
    """The value rounded to one significant digit."""
    return float(f"{value:.0e}")
