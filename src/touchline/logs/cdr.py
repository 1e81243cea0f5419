# SPDX-License-Identifier: Apache-2.0
"""Decodes serialized JointState and WrenchStamped messages, many at a time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline import _logs
from touchline.logs.messages import Messages

JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH_STAMPED = "geometry_msgs/msg/WrenchStamped"
_HEADER = 4  # bytes of the encapsulation; alignment counts from behind it


@dataclass(frozen=True)
class Decoded:
    """Messages of one topic.

    Attributes:
        stamps: (m,) [s]; NaN where the message cannot be decoded.
        fields: name -> (m, n); NaN where a message lacks the value.
        complete: (m,) the message names every joint that is asked for.
    """

    stamps: np.ndarray
    fields: dict[str, np.ndarray]
    complete: np.ndarray


class Decoder:
    """Decodes the messages of one topic into arrays in the asked order.

    A damaged message costs its own row, whatever it claims its lengths to be.

    Attributes:
        undecodable: number of messages that could not be decoded.
    """

    def __init__(self, kind: str, joints: Sequence[str] = ()):
        """Prepare for messages of type `kind`; `joints` are the names wanted of a JointState."""
        self.kind = kind
        self.joints = tuple(joints)
        self.undecodable = 0
        self._states = _logs.JointStateDecoder(list(joints))

    @property
    def seen(self) -> list[str]:
        """Names of all joints met so far, in the order in which they came."""
        return self._states.seen

    def decode(self, messages: Messages) -> Decoded:
        """Decode serialized messages, in their order."""
        where = messages.buffer, messages.start, messages.size
        if self.kind == JOINT_STATE:
            stamps, *values, complete, damaged = self._states.decode(*where)
            names = ["position", "velocity", "effort"]
            fields = dict(zip(names, values, strict=True))
        else:
            stamps, wrench, damaged = _logs.decode_wrenches(*where)
            fields, complete = {"wrench": wrench}, np.isfinite(stamps)
        self.undecodable += damaged
        return Decoded(stamps, fields, complete)


def field_places(data: bytes, kind: str) -> dict[str, tuple[int, int]]:
    """Where the numbers stand in a whole little-endian message, for a writer that fills them in.

    Returns:
        Field -> offset of its first number, and their count.
    """
    at = _HEADER + 8  # behind the stamp

    def word() -> int:
        nonlocal at
        at += -at % 4 + 4
        return int.from_bytes(data[at - 4 : at], "little")

    def doubles(count: int) -> tuple[int, int]:
        nonlocal at
        at += -(at - _HEADER) % 8 if count else 0
        at += 8 * count
        return at - 8 * count, count

    size = word()  # of the frame
    at += size
    if kind == WRENCH_STAMPED:
        return {"wrench": doubles(6)}
    for _ in range(word()):
        size = word()
        at += size
    return {name: doubles(word()) for name in ("position", "velocity", "effort")}
