# SPDX-License-Identifier: Apache-2.0
"""Decodes serialized JointState and WrenchStamped messages, many at a time.

Messages of one publisher differ only in their numbers: where every number stands is learned from
one message and the rest are read through strided views. Any message that does not fit is
deserialized on its own by the rosbags package.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH_STAMPED = "geometry_msgs/msg/WrenchStamped"
FIELDS = {JOINT_STATE: ("position", "velocity", "effort"), WRENCH_STAMPED: ("wrench",)}

_LITTLE_ENDIAN = b"\x00\x01"
_HEADER = 4  # alignment counts from behind the encapsulation header
_MAX_LAYOUTS = 16


@dataclass(frozen=True)
class Layout:
    """Where the numbers stand in messages of one size and one list of names.

    Attributes:
        structure: (s,) indices of the bytes that lengths and names occupy.
        expected: (s,) what stands there.
        fields: name -> offset of its first number and their count.
        names: joint names of the message, empty for a wrench.
    """

    structure: np.ndarray
    expected: np.ndarray
    fields: dict[str, tuple[int, int]]
    names: tuple[str, ...]

    def matches(self, table: np.ndarray) -> np.ndarray:
        """(m,) which of the (m, size) messages have this layout."""
        return np.all(table[:, self.structure] == self.expected, axis=1)

    def numbers(self, table: np.ndarray, field: str) -> np.ndarray:
        """(m, count) values of a field."""
        offset, count = self.fields[field]
        cells = np.ascontiguousarray(table[:, offset : offset + 8 * count])
        return cells.view("<f8").reshape(len(table), count)

    def stamps(self, table: np.ndarray) -> np.ndarray:
        """(m,) header stamps [s]."""
        cells = np.ascontiguousarray(table[:, _HEADER : _HEADER + 8])
        return cells.view("<i4")[:, 0] + cells.view("<u4")[:, 1] * 1e-9


class _Cursor:
    """Steps through one message and notes which bytes are structure."""

    def __init__(self, data: bytes):
        self.data = data
        self.at = _HEADER + 8  # behind the stamp
        self.structure = list(range(_HEADER))

    def align(self, size: int) -> None:
        self.at += -(self.at - _HEADER) % size

    def count(self) -> int:
        self.align(4)
        start, self.at = self.at, self.at + 4
        self.structure += range(start, self.at)
        return int.from_bytes(self.data[start : self.at], "little")

    def text(self, fixed: bool) -> str:
        size = self.count()
        start, self.at = self.at, self.at + size
        if fixed:
            self.structure += range(start, self.at)
        return self.data[start : self.at - 1].decode()

    def doubles(self, count: int) -> tuple[int, int]:
        if count:  # an empty sequence is not aligned
            self.align(8)
        start, self.at = self.at, self.at + 8 * count
        return start, count


def learn_layout(data: bytes, kind: str) -> Layout | None:
    """The layout of a message, or None where it is not of the usual encoding."""
    if data[:2] != _LITTLE_ENDIAN:
        return None
    cursor = _Cursor(data)
    names: tuple[str, ...] = ()
    try:
        cursor.text(fixed=False)  # the frame's name
        if kind == JOINT_STATE:
            names = tuple(cursor.text(fixed=True) for _ in range(_plausible(cursor, 4)))
            fields = {f: cursor.doubles(_plausible(cursor, 8)) for f in FIELDS[JOINT_STATE]}
        else:
            fields = {"wrench": cursor.doubles(6)}
    except (UnicodeDecodeError, ValueError):
        return None
    if cursor.at > len(data):
        return None
    structure = np.array(cursor.structure)
    return Layout(structure, np.frombuffer(data, np.uint8)[structure], fields, names)


def _plausible(cursor: _Cursor, size: int) -> int:
    """A count of items of at least `size` bytes that can fit into the message."""
    count = cursor.count()
    if count * size > len(cursor.data):
        raise ValueError("count exceeds the message")
    return count


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

    Attributes:
        seen: names of all joints met so far, in the order in which they came.
        undecodable: number of messages that could not be decoded.
    """

    def __init__(self, kind: str, joints: Sequence[str] = (), fast: bool = True):
        """Prepare for messages of type `kind`; `joints` are the names wanted of a JointState."""
        self.kind = kind
        self.joints = tuple(joints)
        self.seen: dict[str, None] = {}
        self.undecodable = 0
        self._width = len(self.joints) if kind == JOINT_STATE else 6
        self._layouts: dict[int, list[Layout]] = {}
        self._fast = fast
        self._typestore: Any = None

    def decode(self, messages: Sequence[bytes]) -> Decoded:
        """Decode serialized messages, in their order."""
        count = len(messages)
        result = Decoded(
            np.full(count, np.nan),
            {name: np.full((count, self._width), np.nan) for name in FIELDS[self.kind]},
            np.zeros(count, dtype=bool),
        )
        sizes = np.fromiter(map(len, messages), dtype=np.intp, count=count)
        for size in np.unique(sizes):
            at = np.flatnonzero(sizes == size)
            if self._fast:
                at = self._decode_equal(messages, at, int(size), result)
            for index in at.tolist():
                self._decode_one(messages[index], index, result)
        return result

    def _decode_equal(
        self, messages: Sequence[bytes], at: np.ndarray, size: int, result: Decoded
    ) -> np.ndarray:
        """Decode messages of one size; returns those that fit no layout."""
        joined = b"".join([messages[int(i)] for i in at])
        table = np.frombuffer(joined, np.uint8).reshape(len(at), size)
        layouts = self._layouts.setdefault(size, [])
        known = 0
        left: list[int] = []
        while len(at):
            if known == len(layouts):
                layout = learn_layout(messages[at[0]], self.kind)
                if layout is None or known >= _MAX_LAYOUTS:
                    left.append(int(at[0]))
                    if layout is not None:
                        return np.array([*left, *at[1:]], dtype=np.intp)
                    at, table = at[1:], table[1:]
                    continue
                layouts.append(layout)
            layout = layouts[known]
            fits = layout.matches(table)
            self._fill(layout, table[fits], at[fits], result)
            at, table, known = at[~fits], table[~fits], known + 1
        return np.array(left, dtype=np.intp)

    def _fill(self, layout: Layout, table: np.ndarray, at: np.ndarray, result: Decoded) -> None:
        if not len(at):
            return
        result.stamps[at] = layout.stamps(table)
        order = self._order(layout.names)
        for name in FIELDS[self.kind]:
            self._place(result, name, at, layout.numbers(table, name), order, layout.names)
        result.complete[at] = order is not None

    def _order(self, names: Sequence[str]) -> list[int] | None:
        """Where the wanted joints stand among a message's names; None where one is missing."""
        if self.kind != JOINT_STATE:
            return list(range(6))
        self.seen.update(dict.fromkeys(names))
        if not set(self.joints) <= set(names):
            return None
        return [names.index(joint) for joint in self.joints]

    def _place(
        self,
        result: Decoded,
        name: str,
        at: np.ndarray,
        values: np.ndarray,
        order: list[int] | None,
        names: Sequence[str],
    ) -> None:
        expected = len(names) if self.kind == JOINT_STATE else 6
        if order is not None and values.shape[1] == expected:
            result.fields[name][at] = values[:, order]

    def _decode_one(self, message: bytes, index: int, result: Decoded) -> None:
        """The general way, one message at a time."""
        try:
            read = self._deserialize(message)
        except Exception:  # damaged bytes can fail in any way
            self.undecodable += 1
            return
        stamp = read.header.stamp
        result.stamps[index] = stamp.sec + stamp.nanosec * 1e-9
        names = read.name if self.kind == JOINT_STATE else ()
        order, at = self._order(names), np.array([index])
        for name in FIELDS[self.kind]:
            self._place(result, name, at, _field(read, name)[None, :], order, names)
        result.complete[index] = order is not None

    def _deserialize(self, message: bytes) -> Any:
        if self._typestore is None:
            from rosbags.typesys import Stores, get_typestore

            # Both types are the same in every distribution.
            self._typestore = get_typestore(Stores.ROS2_HUMBLE)
        return self._typestore.deserialize_cdr(message, self.kind)


def _field(message: Any, name: str) -> np.ndarray:
    if name != "wrench":
        return np.asarray(getattr(message, name), dtype=np.float64)
    parts = (message.wrench.force, message.wrench.torque)
    return np.array([getattr(part, axis) for part in parts for axis in "xyz"])
