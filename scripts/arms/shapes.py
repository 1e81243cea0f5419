# SPDX-License-Identifier: Apache-2.0
"""The outer shells, link by link, in link axes (parallel to world when stretched)."""

from dataclasses import dataclass

import numpy as np

from arms import kinematics as k
from arms.sdf import (
    Array,
    Field,
    column,
    corner,
    difference,
    half_space,
    intersection,
    loop_tube,
    moved,
    normalized,
    quintic,
    rounded_box,
    rounded_cylinder,
    smoothstep,
    union,
)

GAP = 0.0006  # half the slit of a roll joint
SLIT = 0.0022  # half the slit of a pitch joint
FOLDED = np.pi - k.FOLD  # between the bars of a pitch joint at its limit
EARLY = 0.80  # how far inside the neighbour's reach a bar begins to swing to the middle


@dataclass(frozen=True)
class Shell:
    """A link's solid with the box [m] that contains it."""

    field: Field
    low: tuple[float, float, float]
    high: tuple[float, float, float]


def pitch_to_roll(length: float, pitch: float, width: float, roll: float) -> Field:
    """From a pitch housing on the +y side at the origin up to a round joint face at z = `length`.

    Seen along y it is a disc that runs out into a waisted bar; its two sides swing from the housing
    to the roll axis, and its edges grow from a fillet to the full round of the joint face.
    """
    top = length - 0.014
    to_roll = smoothstep(0.0, top)
    waist = 0.055 * pitch

    def field(points: Array) -> Array:
        x, y, z = points.T
        t = np.clip(z / length, 0.0, 1.0)
        half_x = pitch + (roll - pitch) * to_roll(z) - waist * 16 * (t * (1 - t)) ** 2
        side = np.where(z > 0, np.abs(x) - half_x, np.hypot(x, z) - pitch)
        high = width + (roll - width) * to_roll(z)
        first = (pitch + np.hypot(x, 0.03) / np.tan(FOLDED)) * EARLY
        low = SLIT - (roll + SLIT) * quintic((z - first) / np.maximum(top - first, 0.015))
        middle = (high + low) / 2
        edge = np.where(y > middle, 0.024, 0.004)
        edge = np.minimum(edge + (roll - edge) * to_roll(z), (high - low) / 2)
        across = np.where(y > middle, y - high, low - y)
        return corner(side + edge, across + edge) - edge

    bar = intersection(0.004, normalized(field), half_space(2, length - GAP, 1))
    return difference(2 * SLIT, bar, swept_by_neighbour(pitch + 0.004))


def swept_by_neighbour(radius: float) -> Field:
    """Where the other link of a pitch joint turns: its disc, and its bar up to the limits."""
    cos, sin = np.cos(FOLDED), np.sin(FOLDED)

    def disc(points: Array) -> Array:
        return np.hypot(points[:, 0], points[:, 2]) - radius

    def bar(points: Array) -> Array:
        return points[:, 2] * sin - np.abs(points[:, 0]) * cos - radius

    return intersection(0.003, union(0.004, disc, bar), half_space(1, -0.9 * SLIT, 1))


def roll_to_pitch(length: float, roll: float, pitch: float, width: float) -> Field:
    """From a round joint face at the origin up to a pitch housing on the -y side at `length`."""
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = length
    return moved(pitch_to_roll(length, pitch, width, roll), T)


def base() -> Field:
    """The pedestal: flange with counterbored bolts, flared column, plug at the back."""
    top, flare = k.BASE_TO_ROLL_1, smoothstep(0.0, 0.11)
    pillar = column(lambda z: k.R1 + 0.020 * (1 - flare(z)), 0.014, top + 0.01)
    pillar = intersection(0.004, pillar, half_space(2, top - GAP, 1))
    foot = rounded_cylinder(2, 0.122, GAP, 0.018, 0.004)
    plug = rounded_box((-0.098, 0.0, 0.056), np.array([0.030, 0.030, 0.020]), 0.008)
    bolt = rounded_cylinder(2, 0.0062, 0.010, 0.1, 0.001)

    def bolts(points: Array) -> Array:
        x, y, z = points.T
        eighth = np.pi / 4
        angle = np.mod(np.arctan2(y, x), eighth) - eighth / 2
        r = np.hypot(x, y)
        return bolt(np.column_stack([r * np.cos(angle) - 0.1105, r * np.sin(angle), z]))

    return difference(0.0015, union(0.008, union(0.012, pillar, foot), plug), bolts)


def flange() -> Field:
    """Link 7: the short output drum of joint 7 with the collar of the wrist sensor."""
    h = k.ROLL_7_TO_FLANGE
    drum = rounded_cylinder(2, k.R7, GAP, h - 0.018, 0.004)
    waist = rounded_cylinder(2, k.R7 - 0.006, 0.010, h - 0.004, 0.002)
    plate = rounded_cylinder(2, k.R7 - 0.001, h - 0.013, h - GAP, 0.003)
    return union(0.002, drum, waist, plate)


def tool() -> Field:
    """The end effector: adapter plate and a body that tapers to a round tip."""
    tip, taper = k.FLANGE_TO_TIP, smoothstep(0.016, 0.112)
    plate = rounded_cylinder(2, k.R7 - 0.001, GAP, 0.013, 0.003)

    def radius(z: Array) -> Array:
        return 0.0385 + (0.0235 - 0.0385) * taper(z)

    stem = column(radius, 0.0065, tip + 0.04)
    return union(0.005, plate, intersection(0.018, stem, half_space(2, tip, 1)))


def handle() -> Field:
    """The grip: a closed bow on a shoe, on the neck that is its sensor; z points off the arm."""
    neck = rounded_cylinder(2, 0.028, GAP, 0.013, 0.002)
    shoe = rounded_box((0.0, 0.0, 0.0125), np.array([0.0165, 0.066, 0.0068]), 0.0066)
    swell = smoothstep(0.030, 0.078)
    bow = loop_tube(0.066, 0.0135, 0.085, 0.027, lambda z: 0.0095 + 0.0045 * swell(z))
    return union(0.006, union(0.004, neck, shoe), bow)


def shells() -> dict[str, Shell]:
    """Every link that can be touched, by name."""
    w2, w4, w6 = k.W2 + 0.01, k.W4 + 0.01, k.W6 + 0.01
    p2, p4, p6 = k.P2 + 0.01, k.P4 + 0.01, k.P6 + 0.01
    l1, l2, l3 = k.ROLL_1_TO_SHOULDER, k.SHOULDER_TO_ROLL_3, k.ROLL_3_TO_ELBOW
    l4, l5, l6 = k.ELBOW_TO_ROLL_5, k.ROLL_5_TO_WRIST, k.WRIST_TO_ROLL_7
    return {
        "link0": Shell(base(), (-0.14, -0.13, -0.01), (0.13, 0.13, l1)),
        "link1": Shell(roll_to_pitch(l1, k.R1, k.P2, k.W2), (-p2, -w2, -0.01), (p2, p2, l1 + p2)),
        "link2": Shell(pitch_to_roll(l2, k.P2, k.W2, k.R3), (-p2, -p2, -p2), (p2, w2, l2 + 0.01)),
        "link3": Shell(roll_to_pitch(l3, k.R3, k.P4, k.W4), (-p4, -w4, -0.01), (p4, p4, l3 + p4)),
        "link4": Shell(pitch_to_roll(l4, k.P4, k.W4, k.R5), (-p4, -p4, -p4), (p4, w4, l4 + 0.01)),
        "link5": Shell(roll_to_pitch(l5, k.R5, k.P6, k.W6), (-p6, -w6, -0.01), (p6, p6, l5 + p6)),
        "link6": Shell(pitch_to_roll(l6, k.P6, k.W6, k.R7), (-p6, -p6, -p6), (p6, w6, l6 + 0.01)),
        "link7": Shell(flange(), (-0.06, -0.06, -0.01), (0.06, 0.06, 0.07)),
        "tool": Shell(tool(), (-0.06, -0.06, -0.01), (0.06, 0.06, 0.14)),
        "handle": Shell(handle(), (-0.04, -0.09, -0.01), (0.04, 0.09, 0.11)),
    }


def box(shell: Shell) -> tuple[Array, Array]:
    """The shell's box as two arrays."""
    return np.array(shell.low), np.array(shell.high)
