# SPDX-License-Identifier: Apache-2.0
"""Which column of a table carries which signal: the description's `log` key.

Every key is optional; what is left out has the name of the contract (`time`, `q.JOINT`,
`qd.JOINT`, `tau.JOINT`, `SENSOR.fx` ...). A COLUMN is a name, or `{column: NAME, factor: 0.001}`
where the factor turns logged units into SI and may be negative.

    log:
      time: COLUMN                       # e.g. {column: Time, factor: 0.001} for milliseconds
      q: COLUMN                          # a pattern with {joint}, {i} (from 0) or {i1} (from 1)
      qd: [COLUMN, ...]                  # or one per joint, in the order of `joints`
      tau: {JOINT: COLUMN, ...}          # or by joint
      sensors:
        SENSOR: COLUMN                   # a pattern with {axis} and perhaps {sensor}
        OTHER: {fx: COLUMN, ...}         # or by axis; `factor` beside them counts for all
        THIRD: [COLUMN, ...]             # or one per axis, in the order of the sensor's `axes`
      topics:                            # rosbag2
        joint_states: /joint_states
        wrench: {SENSOR: /topic, ...}
      joint_names: {JOINT: name_in_the_log, ...}

In a rosbag2 only the factors of q, qd, tau and the sensors count. `{i}` follows `joints`.
"""

import re
from dataclasses import dataclass
from typing import Any

from touchline.errors import InputError
from touchline.model.description import RobotDescription
from touchline.suggest import unknown

JOINT_SIGNALS = ("q", "qd", "tau")
LOG_KEYS = ("time", *JOINT_SIGNALS, "sensors", "topics", "joint_names")


@dataclass(frozen=True)
class Column:
    """A column's name and the factor that turns its values into SI units."""

    name: str
    factor: float = 1.0


@dataclass(frozen=True)
class Naming:
    """Where every signal of a robot is found in a log.

    Attributes:
        time: the column of the time stamps.
        joints: signal ("q", "qd", "tau") -> one column per joint.
        sensors: sensor -> axis -> column, for the axes it measures.
        joint_states: topic of the joint states, or None to look for it.
        wrench_topics: sensor -> topic, where given.
        joint_names: each joint's name in the log, in the order of `joints`.
        source: what to name in messages.
    """

    time: Column
    joints: dict[str, tuple[Column, ...]]
    sensors: dict[str, dict[str, Column]]
    joint_states: str | None
    wrench_topics: dict[str, str]
    joint_names: tuple[str, ...]
    source: str


class _Reader:
    """Collects every problem of one `log` mapping."""

    def __init__(self, description: RobotDescription):
        self.description = description
        self.joints = [joint.name for joint in description.joints]
        self.source = str(description.path or description.name)
        self.problems: list[str] = []

    def problem(self, key: str, text: str) -> None:
        self.problems.append(f"{self.source}: {key}: {text}")

    def mapping(self, key: str, value: Any, allowed: tuple[str, ...] | list[str]) -> dict[str, Any]:
        """A mapping with none but the allowed keys; an absent one is empty."""
        if value is None:
            return {}
        if not isinstance(value, dict):
            self.problem(key, f"must be a mapping, not {value!r}")
            return {}
        for name in value:
            if name not in allowed:
                self.problem(key, unknown(name, "key", allowed))
        return {name: item for name, item in value.items() if name in allowed}

    def factor(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or value == 0:
            self.problem(f"{key}.factor", f"must be a number other than 0, not {value!r}")
            return 1.0
        return float(value)

    def column(self, key: str, value: Any, default: str) -> Column:
        """One COLUMN; its name may still be a pattern."""
        if isinstance(value, str):
            return Column(value)
        if value is None:
            return Column(default)
        if not isinstance(value, dict):
            self.problem(key, f"must be a column's name or {{column, factor}}, not {value!r}")
            return Column(default)
        entry = self.mapping(key, value, ("column", "factor"))
        name = entry.get("column", default)
        if not isinstance(name, str):
            self.problem(f"{key}.column", f"must be a column's name, not {name!r}")
            name = default
        return Column(name, self.factor(key, entry.get("factor", 1.0)))

    def expand(self, key: str, pattern: str, values: dict[str, str]) -> str:
        """The pattern with its placeholders filled in."""

        def fill(match: re.Match[str]) -> str:
            if match[1] in values:
                return values[match[1]]
            allowed = ", ".join(f"{{{name}}}" for name in values)
            self.problem(key, f"unknown placeholder {match[0]} in {pattern!r}; allowed: {allowed}")
            return match[0]

        return re.sub(r"\{(\w*)\}", fill, pattern)


def _joint_columns(reader: _Reader, signal: str, value: Any, names: list[str]) -> list[Column]:
    key, joints = f"log.{signal}", reader.joints
    default = signal + ".{joint}"
    if isinstance(value, list):
        if len(value) != len(joints):
            reader.problem(key, f"has {len(value)} columns for {len(joints)} joints")
            value = None
        entries = value or [None] * len(joints)
    elif isinstance(value, dict) and not value.keys() <= {"column", "factor"}:
        by_name = reader.mapping(key, value, joints)
        entries = [by_name.get(name) for name in joints]
    else:
        entries = [value] * len(joints)
    columns = []
    for i, (name, entry) in enumerate(zip(names, entries, strict=True)):
        column = reader.column(key, entry, default)
        fields = {"joint": name, "i": str(i), "i1": str(i + 1)}
        columns.append(Column(reader.expand(key, column.name, fields), column.factor))
    return columns


def _sensor_columns(
    reader: _Reader, sensor: str, axes: tuple[str, ...], value: Any
) -> dict[str, Column]:
    key, default = f"log.sensors.{sensor}", "{sensor}.{axis}"
    shared, entries = 1.0, dict.fromkeys(axes, value)
    if isinstance(value, list):
        if len(value) != len(axes):
            reader.problem(key, f"has {len(value)} columns for {len(axes)} axes")
            value = [None] * len(axes)
        entries = dict(zip(axes, value, strict=True))
    elif isinstance(value, dict) and not value.keys() <= {"column", "factor"}:
        by_axis = reader.mapping(key, value, [*axes, "factor"])
        shared = reader.factor(key, by_axis.pop("factor", 1.0))
        entries = {axis: by_axis.get(axis) for axis in axes}
    columns = {}
    for axis, entry in entries.items():
        column = reader.column(key, entry, default)
        name = reader.expand(key, column.name, {"axis": axis, "sensor": sensor})
        columns[axis] = Column(name, column.factor * shared)
    return columns


def _check_distinct(reader: _Reader, naming: Naming) -> None:
    """Two signals from one column are a slip of the pen, such as a pattern without `{i}`."""
    users: dict[str, list[str]] = {naming.time.name: ["time"]}
    for signal, columns in naming.joints.items():
        for joint, column in zip(reader.joints, columns, strict=True):
            users.setdefault(column.name, []).append(f"{signal} of {joint}")
    for sensor, axes in naming.sensors.items():
        for axis, column in axes.items():
            users.setdefault(column.name, []).append(f"{axis} of {sensor}")
    for name, signals in users.items():
        if len(signals) > 1:
            reader.problem("log", f"column {name!r} is used for {', '.join(signals)}")


def _texts(reader: _Reader, key: str, entries: dict[str, Any]) -> dict[str, str]:
    for name, value in entries.items():
        if not isinstance(value, str):
            reader.problem(f"{key}.{name}", f"must be a name, not {value!r}")
    return {name: value for name, value in entries.items() if isinstance(value, str)}


def parse_naming(description: RobotDescription) -> Naming:
    """Read the `log` key of a description.

    Raises:
        InputError: with every unknown key, name, placeholder and factor at once.
    """
    reader = _Reader(description)
    log = reader.mapping("log", description.log, LOG_KEYS)
    sensors = {sensor.name: sensor.axes for sensor in description.sensors}
    renamed = _texts(
        reader,
        "log.joint_names",
        reader.mapping("log.joint_names", log.get("joint_names"), reader.joints),
    )
    names = [renamed.get(name, name) for name in reader.joints]
    topics = reader.mapping("log.topics", log.get("topics"), ("joint_states", "wrench"))
    wrench = reader.mapping("log.topics.wrench", topics.pop("wrench", None), list(sensors))
    by_sensor = reader.mapping("log.sensors", log.get("sensors"), list(sensors))
    naming = Naming(
        time=reader.column("log.time", log.get("time"), "time"),
        joints={
            signal: tuple(_joint_columns(reader, signal, log.get(signal), names))
            for signal in JOINT_SIGNALS
        },
        sensors={
            name: _sensor_columns(reader, name, axes, by_sensor.get(name))
            for name, axes in sensors.items()
        },
        joint_states=_texts(reader, "log.topics", topics).get("joint_states"),
        wrench_topics=_texts(reader, "log.topics.wrench", wrench),
        joint_names=tuple(names),
        source=reader.source,
    )
    _check_distinct(reader, naming)
    if reader.problems:
        raise InputError(reader.problems)
    return naming
