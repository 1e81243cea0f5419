# SPDX-License-Identifier: Apache-2.0
"""Recordings to be read: a joint state and a wrench of each sensor per sample."""

import sqlite3
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Index
from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED, field_places
from touchline.logs.mcap import FOOTER, MAGIC
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

CHUNK = 768 << 10  # bytes, as ros2 bag writes them
Bytes = NDArray[np.uint8]


@dataclass(frozen=True)
class Serialized:
    """Messages of N samples.

    Attributes:
        received: (N,) [ns].
        tables: topic -> (N, size) bytes of its messages.
        kinds: topic -> message type.
    """

    received: Index
    tables: dict[str, Bytes]
    kinds: dict[str, str]

    @property
    def count(self) -> int:
        """Number of messages."""
        return len(self.received) * len(self.tables)


def serialized(robot: Robot, samples: Samples) -> Serialized:
    """The messages of a recording."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    stamp = np.round(samples.time * 1e9).astype(np.int64)
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "base_link")
    n = len(robot.joint_names)
    names, zeros = list(robot.joint_names), np.zeros(n)
    vector = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    wrench = types["geometry_msgs/msg/Wrench"](vector, vector)
    blanks = {
        JOINT_STATE: types[JOINT_STATE](header, names, zeros, zeros, zeros),
        WRENCH_STAMPED: types[WRENCH_STAMPED](header, wrench),
    }
    kinds = {"/joint_states": JOINT_STATE}
    values = [{"position": samples.q, "velocity": samples.qd, "effort": samples.tau}]
    for k, sensor in enumerate(robot.sensor_names):
        kinds[f"/{sensor}/wrench"] = WRENCH_STAMPED
        values.append({"wrench": samples.wrench[:, k]})
    tables = {}
    for (topic, kind), fields in zip(kinds.items(), values, strict=True):
        blank = bytes(store.serialize_cdr(blanks[kind], kind))
        table = np.tile(np.frombuffer(blank, np.uint8), (len(stamp), 1))
        seconds, rest = np.divmod(stamp, 10**9)
        table[:, 4:8] = seconds.astype("<i4")[:, None].view(np.uint8)
        table[:, 8:12] = rest.astype("<u4")[:, None].view(np.uint8)
        for name, (at, count) in field_places(blank, kind).items():
            numbers = np.nan_to_num(fields[name]).astype("<f8")
            table[:, at : at + 8 * count] = np.ascontiguousarray(numbers).view(np.uint8)
        tables[topic] = table
    return Serialized(stamp, tables, kinds)


def write_sqlite(path: Path, messages: Serialized) -> None:
    """Write a rosbag2 sqlite3 file."""
    file = sqlite3.connect(path)
    file.execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, "
        "serialization_format TEXT, offered_qos_profiles TEXT)"
    )
    file.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
        "timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
    )
    file.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
    for number, (topic, kind) in enumerate(messages.kinds.items(), 1):
        file.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", (number, topic, kind))
    tables = list(messages.tables.values())
    rows = (
        (number, int(at), table[i].tobytes())
        for i, at in enumerate(messages.received)
        for number, table in enumerate(tables, 1)
    )
    file.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows)
    file.commit()
    file.close()


def write_mcap(path: Path, messages: Serialized, compression: str, summary: bool) -> None:
    """Write an MCAP file in chunks with indexes, compressed with "zstd", "lz4" or not ("")."""
    tables = list(messages.tables.values())
    rows = np.hstack([_records(n, messages.received, t) for n, t in enumerate(tables, 1)])
    head = _channels(messages.kinds)
    together = max(CHUNK // rows.shape[1], 1)
    sizes = [31 + table.shape[1] for table in tables]
    places = np.cumsum(sizes) - sizes  # of a sample's records
    chunks = []
    with path.open("wb") as file:
        file.write(MAGIC + _record(1, _text("ros2") + _text("touchline")))
        for first in range(0, len(rows), together):
            content = (b"" if first else head) + rows[first : first + together].tobytes()
            part = messages.received[first : first + together]
            times = _number(int(part[0]), 8) + _number(int(part[-1]), 8)
            squeezed = _squeezed(content, compression)
            body = times + _number(len(content), 8) + bytes(4) + _text(compression)
            start = file.tell()
            file.write(_record(6, body + _number(len(squeezed), 8) + squeezed))
            end, index = file.tell(), b""
            ahead = 0 if first else len(head)
            offsets = ahead + np.arange(len(part)) * rows.shape[1]
            for channel, place in enumerate(places, 1):
                entries = np.stack([part, offsets + place], axis=1).astype("<u8").tobytes()
                index += _number(channel, 2) + _number(file.tell(), 8)
                file.write(_record(7, _number(channel, 2) + _number(len(entries), 4) + entries))
            where = _number(start, 8) + _number(end - start, 8) + _number(len(index), 4) + index
            where += _number(file.tell() - end, 8) + _text(compression)
            where += _number(len(squeezed), 8) + _number(len(content), 8)
            chunks.append(_record(8, times + where))
        file.write(_record(15, bytes(4)))
        if not summary:
            file.write(FOOTER)
            return
        start = file.tell()
        file.write(head + b"".join(chunks) + _statistics(messages, len(chunks)))
        file.write(_record(2, _number(start, 8) + bytes(12)) + MAGIC)


def _records(channel: int, received: Index, table: Bytes) -> Bytes:
    size = table.shape[1]
    out = np.empty((len(table), 31 + size), np.uint8)
    out[:, :9] = np.frombuffer(_number(5, 1) + _number(22 + size, 8), np.uint8)
    out[:, 9:11] = np.frombuffer(_number(channel, 2), np.uint8)
    out[:, 11:15] = np.arange(len(table), dtype="<u4")[:, None].view(np.uint8)
    out[:, 15:23] = out[:, 23:31] = received.astype("<i8")[:, None].view(np.uint8)
    out[:, 31:] = table
    return out


def _channels(kinds: dict[str, str]) -> bytes:
    out = b""
    for number, (topic, kind) in enumerate(kinds.items(), 1):
        schema = _number(number, 2) + _text(kind) + _text("ros2msg") + _text("")
        channel = _number(number, 2) + _number(number, 2) + _text(topic) + _text("cdr") + bytes(4)
        out += _record(3, schema) + _record(4, channel)
    return out


def _statistics(messages: Serialized, chunks: int) -> bytes:
    count = len(messages.received)
    ends = _number(int(messages.received[0]), 8) + _number(int(messages.received[-1]), 8)
    each = b"".join(_number(n + 1, 2) + _number(count, 8) for n in range(len(messages.kinds)))
    topics = len(messages.kinds)
    numbers = _number(messages.count, 8) + _number(topics, 2) + _number(topics, 4) + bytes(8)
    return _record(11, numbers + _number(chunks, 4) + ends + _number(len(each), 4) + each)


def _squeezed(content: bytes, compression: str) -> bytes:
    if compression == "zstd":
        from backports import zstd

        return zstd.compress(content, 1)
    if compression == "lz4":
        import lz4.frame

        return lz4.frame.compress(content)
    return content


def _number(value: int, size: int) -> bytes:
    return value.to_bytes(size, "little")


def _text(text: str) -> bytes:
    return _number(len(text.encode()), 4) + text.encode()


def _record(code: int, body: bytes) -> bytes:
    return bytes([code]) + _number(len(body), 8) + body
