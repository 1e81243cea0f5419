# SPDX-License-Identifier: Apache-2.0
"""The outer shells of the arm, link by link, in link axes (all parallel to world when stretched)."""

from dataclasses import dataclass

import numpy as np

from arms import kinematics as k
from arms.sdf import (
    Array,
    Field,
    difference,
    half_space,
    intersection,
    loop_tube,
    moved,
    pebble,
    revolved,
    rounded_box,
    rounded_cylinder,
    smoothstep,
    swept,
    union,
)

GAP = 0.0006  # half the slit between two links that turn against each other


@dataclass(frozen=True)
class Shell:
    """A link's solid with the box [m] that contains it."""

    field: Field
    low: tuple[float, float, float]
    high: tuple[float, float, float]


def pitch_to_roll(length: float, pitch: float, width: float, roll: float) -> Field:
    """From a pitch housing on the +y side at the origin up to a round joint face at z = `length`."""
    housing = pebble(1, pitch, GAP, width, (0.003, 0.022))
    blend = smoothstep(0.15 * pitch, length - 0.012)
    middle = (width + GAP) / 2
    body = swept(
        lambda z: middle * (1 - blend(z)),
        lambda z: roll * blend(z) + 0.90 * pitch * (1 - blend(z)),
        lambda z: roll * blend(z) + 0.96 * (width - GAP) / 2 * (1 - blend(z)),
        lambda z: 2.0 + 1.2 * (1 - blend(z)),
    )
    trunk = intersection(0.004, body, half_space(2, length - GAP, 1))
    trunk = intersection(0.0, trunk, half_space(2, 0.0, -1))
    neighbour = pebble(1, pitch + 0.005, -1.0, GAP, (0.003, 0.003))
    return union(0.020, housing, difference(0.006, trunk, neighbour))


def roll_to_pitch(length: float, roll: float, pitch: float, width: float) -> Field:
    """From a round joint face at the origin up to a pitch housing on the -y side at `length`."""
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = length
    return moved(pitch_to_roll(length, pitch, width, roll), T)


def base() -> Field:
    """The pedestal: flange with counterbored bolts, flared column, plug at the back."""
    top = k.BASE_TO_ROLL_1
    column = swept(
        lambda z: 0.0 * z,
        lambda z: k.R1 + 0.020 * (1 - smoothstep(0.0, 0.11)(z)),
        lambda z: k.R1 + 0.020 * (1 - smoothstep(0.0, 0.11)(z)),
        lambda z: 2.0 + 0.0 * z,
    )
    column = intersection(0.004, column, half_space(2, top - GAP, 1), half_space(2, GAP, -1))
    flange = rounded_cylinder(2, 0.122, GAP, 0.018, 0.004)
    body = union(0.012, column, flange)
    plug = rounded_box((-0.098, 0.0, 0.052), np.array([0.030, 0.030, 0.020]), 0.008)
    body = union(0.008, body, plug)
    bolts = []
    for angle in np.arange(8) * np.pi / 4 + np.pi / 8:
        T = np.eye(4)
        T[:3, 3] = 0.1105 * np.cos(angle), 0.1105 * np.sin(angle), 0.0
        bolts.append(moved(rounded_cylinder(2, 0.0062, 0.010, 0.1, 0.001), T))
    return difference(0.0015, body, *bolts)


def flange() -> Field:
    """Link 7: the short output drum of joint 7 with the collar of the wrist sensor."""
    h = k.ROLL_7_TO_FLANGE
    drum = rounded_cylinder(2, k.R7, GAP, h - 0.014, 0.004)
    waist = rounded_cylinder(2, k.R7 - 0.006, 0.010, h - 0.004, 0.002)
    plate = rounded_cylinder(2, k.R7 - 0.001, h - 0.012, h - GAP, 0.003)
    return union(0.002, drum, waist, plate)


def tool() -> Field:
    """The end effector: adapter plate, tapered body, round tip."""
    e = 0.004
    tip = k.FLANGE_TO_TIP
    plate = rounded_cylinder(2, k.R7 - 0.001, GAP, 0.014, 0.003)
    body = revolved(
        [(0, 0.010), (0.034, 0.010), (0.034, 0.050), (0.022, 0.090), (0.022, tip - 0.022), (0, tip - 0.022)],
        e,
    )
    nose = rounded_cylinder(2, 0.026, 0.070, tip, 0.024)
    return union(0.010, plate, union(0.020, body, nose))


def handle() -> Field:
    """The grip: a closed bow on a shoe, on the neck that is its sensor; z points off the arm."""
    neck = rounded_cylinder(2, 0.027, GAP, 0.014, 0.002)
    shoe = rounded_box((0.0, 0.0, 0.0125), np.array([0.017, 0.070, 0.0065]), 0.006)
    bow = loop_tube(
        0.064, 0.014, 0.082, 0.026, lambda y: 0.0115 + 0.0035 * (1 - smoothstep(0.0, 0.06)(np.abs(y)))
    )
    return union(0.006, union(0.004, neck, shoe), bow)


def shells() -> dict[str, Shell]:
    """Every link that can be touched, by name."""
    w2, w4, w6 = k.W2 + 0.01, k.W4 + 0.01, k.W6 + 0.01
    p2, p4, p6 = k.P2 + 0.01, k.P4 + 0.01, k.P6 + 0.01
    l1, l2, l3 = k.ROLL_1_TO_SHOULDER, k.SHOULDER_TO_ROLL_3, k.ROLL_3_TO_ELBOW
    l4, l5, l6 = k.ELBOW_TO_ROLL_5, k.ROLL_5_TO_WRIST, k.WRIST_TO_ROLL_7
    return {
        "link0": Shell(base(), (-0.14, -0.13, -0.01), (0.13, 0.13, l1)),
        "link1": Shell(
            roll_to_pitch(l1, k.R1, k.P2, k.W2), (-p2, -w2, -0.01), (p2, p2, l1 + p2)
        ),
        "link2": Shell(pitch_to_roll(l2, k.P2, k.W2, k.R3), (-p2, -p2, -p2), (p2, w2, l2 + 0.01)),
        "link3": Shell(
            roll_to_pitch(l3, k.R3, k.P4, k.W4), (-p4, -w4, -0.01), (p4, p4, l3 + p4)
        ),
        "link4": Shell(pitch_to_roll(l4, k.P4, k.W4, k.R5), (-p4, -p4, -p4), (p4, w4, l4 + 0.01)),
        "link5": Shell(
            roll_to_pitch(l5, k.R5, k.P6, k.W6), (-p6, -w6, -0.01), (p6, p6, l5 + p6)
        ),
        "link6": Shell(pitch_to_roll(l6, k.P6, k.W6, k.R7), (-p6, -p6, -p6), (p6, w6, l6 + 0.01)),
        "link7": Shell(flange(), (-0.06, -0.06, -0.01), (0.06, 0.06, 0.07)),
        "tool": Shell(tool(), (-0.06, -0.06, -0.01), (0.06, 0.06, 0.14)),
        "handle": Shell(handle(), (-0.04, -0.09, -0.01), (0.04, 0.09, 0.11)),
    }


def box(shell: Shell) -> tuple[Array, Array]:
    """The shell's box as two arrays."""
    return np.array(shell.low), np.array(shell.high)
