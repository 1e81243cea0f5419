# SPDX-License-Identifier: Apache-2.0
"""Writes the samples of a running robot as they came, so that a killed run can be read."""

import os
import struct
import time
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Protocol, Self

import numpy as np

from touchline.errors import InputError
from touchline.live.sample import Sample, whole_nanoseconds
from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED, field_places
from touchline.logs.mcap_writer import McapWriter
from touchline.logs.period import PERIOD_KEY, RECORDER, RECORDER_KEY
from touchline.logs.tables import table_columns
from touchline.logs.writer import TableWriter
from touchline.model.description import RobotDescription
from touchline.model.robot import Robot

FLUSH = 0.25  # s; what a kill can cost of an MCAP file
PART = 1.0  # s; what a kill can cost of a Parquet file
BATCH = 1024  # samples that wait at most
_STAMP = 4  # bytes of the encapsulation before a message's stamp


class Recorder(Protocol):
    """Takes samples."""

    def add(self, sample: Sample) -> None:
        """Writes one sample."""
        ...

    def close(self) -> None:
        """Ends the file."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...


def check_name(path: Path) -> None:
    """Whether a recording can have this name.

    Raises:
        InputError: it has another ending.
    """
    if path.suffix not in (".parquet", ".mcap"):
        raise InputError(f"--record {path}: a recording's name ends in .mcap or .parquet")


def make_recorder(path: Path, robot: Robot, period: float, source: str) -> Recorder:
    """A recorder for a file of that name; an old one is replaced.

    Args:
        path: ends in `.mcap` or `.parquet`.
        robot: whose samples come.
        period: with which they are judged live [s]; `analyze` takes the same one.
        source: their address, kept in the file.

    Raises:
        InputError: the name has another ending, or nothing can be written there.
    """
    kept = {RECORDER_KEY: RECORDER, PERIOD_KEY: period, "source": source, "robot": robot.name}
    if path.suffix == ".parquet":
        return ParquetRecorder(path, robot.description, kept)
    check_name(path)
    return McapRecorder(path, robot, kept)


class _Closing:
    def close(self) -> None:
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class ParquetRecorder(_Closing):
    """The contract's table, with `arrival`, `sequence` and each sensor's `SENSOR.age` beside it."""

    def __init__(self, path: Path, description: RobotDescription, kept: Mapping[str, Any]) -> None:
        # Arrow's own pool holds on to more of what was freed, by 1 MB in half an hour of recording.
        # Its writer asks the pool of the library, which is chosen as that is loaded.
        os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
        self._description = description
        self._ages = [f"{sensor.name}.age" for sensor in description.sensors]
        empty = self._columns([])
        kinds = {name: "i8" if name == "sequence" else "f8" for name in empty}
        self._table = TableWriter(path, kinds, kept, part_seconds=PART)
        self._waiting: list[Sample] = []
        self._written = time.monotonic()

    def _columns(self, samples: list[Sample]) -> dict[str, np.ndarray]:
        n, k = len(self._description.joints), len(self._description.sensors)
        signals = SimpleNamespace(
            time=np.array([sample.time for sample in samples], dtype=float),
            q=np.array([sample.q for sample in samples], dtype=float).reshape(-1, n),
            qd=np.array([sample.qd for sample in samples], dtype=float).reshape(-1, n),
            tau=np.array([sample.tau for sample in samples], dtype=float).reshape(-1, n),
            wrench=np.array([sample.wrench for sample in samples], dtype=float).reshape(
                len(samples), k, 6
            ),
        )
        columns = table_columns(signals, self._description)
        columns["arrival"] = np.array([sample.arrival for sample in samples], dtype=float)
        columns["sequence"] = np.array([sample.sequence for sample in samples], dtype=np.int64)
        ages = np.array([sample.ages for sample in samples], dtype=float).reshape(len(samples), k)
        return columns | dict(zip(self._ages, ages.T, strict=True))

    def add(self, sample: Sample) -> None:
        """Writes one sample."""
        self._waiting.append(sample)
        if len(self._waiting) >= BATCH or sample.arrival - self._written >= FLUSH:
            self._write()

    def _write(self) -> None:
        samples, self._waiting = self._waiting, []
        self._written = time.monotonic()
        if samples:
            self._table.write(self._columns(samples))

    def close(self) -> None:
        """Turns the parts into one file."""
        self._write()
        self._table.close()


class McapRecorder(_Closing):
    """`/joint_states`, and `/SENSOR/wrench` for each sensor with the stamps of the joint states."""

    def __init__(self, path: Path, robot: Robot, kept: Mapping[str, Any]) -> None:
        import json

        self._file = McapWriter(path, {key: json.dumps(value) for key, value in kept.items()})
        self._flushed = time.monotonic()
        joints = _Message(JOINT_STATE, robot.joint_names)
        self._joints = joints.announce(self._file, "/joint_states")
        self._wrenches = [
            _Message(WRENCH_STAMPED).announce(self._file, f"/{name}/wrench")
            for name in robot.sensor_names
        ]

    def add(self, sample: Sample) -> None:
        """Writes one sample."""
        at, received = whole_nanoseconds(sample.time), int(sample.arrival * 1e9)
        for k, wrench in enumerate(self._wrenches):
            wrench.write(self._file, sample.sequence, at, received, {"wrench": sample.wrench[k]})
        fields = {"position": sample.q, "velocity": sample.qd, "effort": sample.tau}
        self._joints.write(self._file, sample.sequence, at, received, fields)
        if sample.arrival - self._flushed >= FLUSH:
            self._flushed = sample.arrival
            self._file.flush()

    def close(self) -> None:
        """Ends the file."""
        self._file.close()


class _Message:
    """Messages of one topic, which differ only in their numbers."""

    def __init__(self, kind: str, joints: tuple[str, ...] = ()) -> None:
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS2_HUMBLE)
        self.kind, self.channel = kind, 0
        self.definition = store.generate_msgdef(kind)[0]
        blank = bytes(store.serialize_cdr(_blank(store.types, kind, joints), kind))
        self._blank, self._fields = bytearray(blank), field_places(blank, kind)

    def announce(self, file: McapWriter, topic: str) -> "_Message":
        self.channel = file.add_channel(topic, self.kind, self.definition)
        return self

    def write(
        self,
        file: McapWriter,
        sequence: int,
        at: int,
        received: int,
        fields: Mapping[str, np.ndarray],
    ) -> None:
        """Writes a message with these fields, stamped `at` [ns]."""
        data = self._blank
        struct.pack_into("<iI", data, _STAMP, *divmod(at, 10**9))
        for name, values in fields.items():
            offset, count = self._fields[name]
            struct.pack_into(f"<{count}d", data, offset, *values)
        file.write(self.channel, sequence, received, bytes(data))


def _blank(types: Mapping[str, Any], kind: str, joints: tuple[str, ...]) -> Any:
    time = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="")
    if kind == JOINT_STATE:
        zeros = np.zeros(len(joints))
        return types[kind](
            header=header, name=list(joints), position=zeros, velocity=zeros, effort=zeros
        )
    vector = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    wrench = types["geometry_msgs/msg/Wrench"](force=vector, torque=vector)
    return types[kind](header=header, wrench=wrench)
