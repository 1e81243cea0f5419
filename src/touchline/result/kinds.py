# SPDX-License-Identifier: Apache-2.0
"""The words in which contacts and events are told: text with a fixed choice."""

from enum import StrEnum


class Status(StrEnum):
    """How much of the place of a contact is known."""

    LOCATED = "located"  # one place, and sure of it
    AMBIGUOUS = "ambiguous"  # the best of several places, or a place that is not sure
    NOT_SEPARABLE = "not_separable"  # several contacts that cannot be told apart
    WRENCH_ONLY = "wrench_only"  # no place is an honest answer


class ContactLevel(StrEnum):
    """Contact or collision."""

    CONTACT = "contact"
    COLLISION = "collision"


class Zone(StrEnum):
    """Which part of a robot is meant to be touched."""

    STRUCTURE = "structure"
    END_EFFECTOR = "end_effector"
    HANDLE = "handle"


class Happened(StrEnum):
    """What a sample did to an event; changed are its level, its decision or its clamping."""

    BEGAN = "began"
    CHANGED = "changed"
    ENDED = "ended"


class Watch(StrEnum):
    """Whether a touch of a segment can be felt."""

    WATCHED = "watched"
    DEGRADED = "degraded"  # with fewer signals than the robot has
    BLIND = "blind"  # not at all: settling, or nothing that feels it is left


class Fault(StrEnum):
    """What is wrong with a channel; but for spikes and suspects it is left out, as if missing."""

    NONE = "none"
    SPIKE = "spike"  # far from the samples before: the last good reading stands for it
    STEP = "step"  # a new level that a sensor inboard would have to feel too, and does not
    WILD = "wild"  # such jumps that go on
    STUCK = "stuck"  # the same value again and again while the arm moves
    DISAGREES = "disagrees"  # no derivative of its position, or a load that others contradict
    SUSPECT = "suspect"  # it alone explains what is felt; it counts on, but no contact is sure
    ABSENT = "absent"  # position or velocity: not there, the other one stands in for it
