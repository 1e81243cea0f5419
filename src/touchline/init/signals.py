# SPDX-License-Identifier: Apache-2.0
"""Which of a recording's columns or topics are a robot's signals."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from touchline.init.contents import Contents, JointStates
from touchline.model.description import AXES
from touchline.model.guess import force_torque_links
from touchline.model.mechanism import Mechanism

TIME = re.compile(r"(time|timestamp|stamp|t|seconds)[ _(\[]*(s|sec|ms|us|ns)?[)\]]?", re.I)
CURRENTS = "actual_current", "motor_current", "joint_current", "current", "currents", "cur", "i"
NAMES = {
    "q": ("q", "pos", "position", "positions", "joint_position", "actual_q", "q_actual"),
    "qd": ("qd", "dq", "vel", "velocity", "velocities", "joint_velocity", "actual_qd", "qdot"),
    # The most telling first: a robot may log measured, commanded and estimated torques.
    "tau": (
        *("tau_j", "torquesm", "measured_torque", "joint_torque", "tau", "torque", "torques"),
        *("effort", "efforts", "joint_effort", *CURRENTS),
    ),
}
AXIS = re.compile(r"^(?P<name>.*?)[._/]?(?P<axis>f[xyz]|[mt][xyz]|force_[xyz]|torque_[xyz])$", re.I)
PERIODS = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
LEAST_JOINTS = 2  # of a recording that lacks others: a single name may be a chance
SLOWEST, FASTEST = 10.0, 20_000.0  # Hz, of recordings that are of use


@dataclass(frozen=True)
class FoundSensor:
    """A force-torque sensor that the recording shows.

    Attributes:
        name: in the description.
        link: the first link that it carries, as far as is known.
        source: the topic, or the columns' common name.
        columns: by axis, of a table whose names are not the contract's.
        why: how the link was chosen.
    """

    name: str
    link: str
    source: str
    why: str
    columns: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Signals:
    """What a description has to say about a recording.

    Attributes:
        log: the key `log`.
        sensors: the key `force_torque_sensors`.
        has_torque: whether there are joint torques.
        statements: each guess in a sentence.
        absent: joints that the recording lacks while it has others.
        silent: joints that it has without a torque while others have one.
        currents: whether the torques seem to be motor currents.
    """

    log: dict[str, Any]
    sensors: tuple[FoundSensor, ...]
    has_torque: bool
    statements: tuple[str, ...]
    absent: tuple[str, ...] = ()
    silent: tuple[str, ...] = ()
    currents: bool = False


def find_signals(contents: Contents, mechanism: Mechanism, joints: Sequence[str]) -> Signals:
    """Find the signals of some joints, and the force-torque sensors."""
    if contents.columns:
        return _in_table(contents.columns, mechanism, joints)
    return _in_bag(contents, mechanism, joints)


def _in_bag(contents: Contents, mechanism: Mechanism, joints: Sequence[str]) -> Signals:
    statements, topics = [], {}
    known = {t: len(set(joints) & set(found.joints)) for t, found in contents.joint_states.items()}
    most = max(known.values(), default=0)
    states: dict[str, JointStates] = {
        topic: found
        for topic, found in contents.joint_states.items()
        if known[topic] == most >= min(LEAST_JOINTS, len(joints))
    }
    renamed = {} if states else _other_names(contents.joint_states, joints)
    has_torque, absent, own_names = False, (), {}
    if states or renamed:
        found = states or {topic: contents.joint_states[topic] for topic in renamed}
        topic = max(found, key=lambda name: (found[name].effort, found[name].velocity))
        own_names = renamed.get(topic, {})
        recorded = [own_names.get(joint, joint) for joint in joints]
        absent = tuple(
            joint
            for joint, name in zip(joints, recorded, strict=True)
            if name not in found[topic].joints
        )
        topics["joint_states"] = topic
        has_torque = found[topic].effort
        filled = [n for n in ("velocity", "effort") if getattr(found[topic], n)]
        statements.append(
            f"joints are in {topic}, with position{''.join(f', {n}' for n in filled)}"
        )
        if own_names:
            pairs = ", ".join(f"{name} for {joint}" for joint, name in own_names.items())
            statements.append(f"joints have other names there, taken by {_how(own_names)}: {pairs}")
    else:
        names = {n for found in contents.joint_states.values() for n in found.joints}
        statements.append(
            f"no topic of joint states has these joints; those recorded: {', '.join(sorted(names))}"
        )
    sensors = []
    for topic, frame in contents.wrenches.items():
        name = _sensor_name(topic, [s.name for s in sensors])
        link, why = _sensor_link(mechanism, joints, name, frame)
        sensors.append(FoundSensor(name, link, topic, why))
    if sensors:
        topics["wrench"] = {sensor.name: sensor.source for sensor in sensors}
    statements += [_told(sensor) for sensor in sensors]
    log: dict[str, Any] = {"topics": topics} if topics else {}
    if own_names:
        log["joint_names"] = own_names
    return Signals(log, tuple(sensors), has_torque, tuple(statements), absent)


def _other_names(
    states: dict[str, JointStates], joints: Sequence[str]
) -> dict[str, dict[str, str]]:
    """By topic the name of each joint there, where all have other names than in the model.

    A prefix or suffix more is of a name space. Else as many joints are taken in their order.
    """
    found = {}
    for topic, state in states.items():
        around = [[name for name in state.joints if _spaced(name, joint)] for joint in joints]
        if joints and all(len(names) == 1 for names in around):
            found[topic] = {joint: names[0] for joint, names in zip(joints, around, strict=True)}
    if found:
        return found
    return {
        topic: dict(zip(joints, state.joints, strict=True))
        for topic, state in states.items()
        if len(state.joints) == len(joints) > 0
    }


def _spaced(name: str, joint: str) -> bool:
    return name.endswith(joint) or name.startswith(joint) and not name[len(joint)].isdigit()


def _how(names: dict[str, str]) -> str:
    spaced = all(_spaced(name, joint) for joint, name in names.items())
    return "what stands around them" if spaced else "their order, which may be another one"


def _in_table(
    columns: dict[str, np.ndarray], mechanism: Mechanism, joints: Sequence[str]
) -> Signals:
    log: dict[str, Any] = {}
    statements: list[str] = []
    _time(columns, log, statements)
    found: dict[str, str] = {}
    recorded = tuple(joints)
    silent: tuple[str, ...] = ()
    currents = False
    for signal in ("q", "qd", "tau"):
        ours = signal + ".{joint}"  # the contract's name, before all others
        if all(ours.replace("{joint}", joint) in columns for joint in recorded):
            found[signal] = ours
            continue
        pattern, name = _pattern(columns, NAMES[signal], recorded)
        if pattern is None and signal != "qd":
            pattern, name, having = _of_some(columns, NAMES[signal], recorded)
            if pattern is not None and signal == "q":
                recorded = having
            elif pattern is not None:
                silent = tuple(joint for joint in recorded if joint not in having)
        if pattern is None:
            if signal != "qd":
                statements.append(f"no columns were recognized as {signal}")
            continue
        found[signal] = pattern
        if pattern != signal + ".{joint}":
            log[signal] = pattern
            statements.append(f"{signal} is in the columns {pattern}")
        if name in CURRENTS:
            currents = True
            statements.append(
                f"{pattern} seem motor currents: write each joint's `gain`, Nm per ampere with the "
                "gear's ratio"
            )
    if silent:
        statements.append(f"no torque is recorded of {', '.join(silent)}: `torque: none`")
    if "qd" not in found:
        statements.append("velocities are not in the recording; they are estimated from positions")
    sensors = _sensor_columns(columns, mechanism, joints)
    named = {s.name: s.columns for s in sensors if s.columns}
    if named:
        log["sensors"] = named
    statements += [_told(sensor) for sensor in sensors]
    absent = tuple(joint for joint in joints if joint not in recorded)
    return Signals(log, tuple(sensors), "tau" in found, tuple(statements), absent, silent, currents)


def _time(columns: dict[str, np.ndarray], log: dict[str, Any], statements: list[str]) -> None:
    names = [name for name in columns if TIME.fullmatch(name)]
    if not names:
        statements.append("no column was recognized as the time")
        return
    name = names[0]
    steps = np.diff(columns[name])
    steps = steps[np.isfinite(steps) & (steps > 0)]
    period = float(np.median(steps)) if len(steps) else 1e-3
    fitting = [f for f in PERIODS if SLOWEST <= 1.0 / (f * period) <= FASTEST]
    factor = 1.0 if not fitting else fitting[0]
    if factor != 1.0:
        log["time"] = {"column": name, "factor": factor}
        rate = 1.0 / (factor * period)
        statements.append(f"the time is in {name}, in {PERIODS[factor]}: samples at {rate:.4g} Hz")
    elif name != "time":
        log["time"] = name
        statements.append(f"the time is in {name}, in s")


def _pattern(
    columns: dict[str, np.ndarray], names: Sequence[str], joints: Sequence[str]
) -> tuple[str | None, str]:
    """Return the pattern of columns that stand for all joints, by name or number, and its word.

    Of several the first in which something changes: a driver may fill what it does not measure
    with zeros.
    """
    found = list(_patterns(columns, names, joints))
    alive = (x for x in found if _changes(columns, x[0], joints))
    return next(alive, found[0] if found else (None, ""))


def _changes(columns: dict[str, np.ndarray], pattern: str, joints: Sequence[str]) -> bool:
    for i, joint in enumerate(joints):
        name = pattern.replace("{joint}", joint).replace("{i}", str(i)).replace("{i1}", str(i + 1))
        values = columns[name][np.isfinite(columns[name])]
        if len(values) and np.ptp(values) > 0.0:
            return True
    return False


def _patterns(
    columns: dict[str, np.ndarray], names: Sequence[str], joints: Sequence[str]
) -> Iterator[tuple[str, str]]:
    for name in names:
        pattern = _by_name(columns, name, joints[0]) if joints else None
        if pattern is not None and all(pattern.replace("{joint}", j) in columns for j in joints):
            yield pattern, name
        for column in columns:
            match = re.fullmatch(r"(.*?)[01]\]?", column)
            if match is None or _word(match[1]) != name:
                continue
            end = "]" if column.endswith("]") else ""
            for placeholder, first in (("{i}", 0), ("{i1}", 1)):
                numbered = [f"{match[1]}{i + first}{end}" for i in range(len(joints))]
                beyond = f"{match[1]}{len(joints) + first}{end}"
                if set(numbered) <= set(columns) and beyond not in columns:
                    yield match[1] + placeholder + end, name


def _of_some(
    columns: dict[str, np.ndarray], names: Sequence[str], joints: Sequence[str]
) -> tuple[str | None, str, tuple[str, ...]]:
    """Return the pattern that stands for the most joints, its word, and these joints."""
    best: tuple[str | None, str, tuple[str, ...]] = (None, "", ())
    for name in names:
        for pattern in {_by_name(columns, name, joint) for joint in joints} - {None}:
            assert pattern is not None
            having = tuple(j for j in joints if pattern.replace("{joint}", j) in columns)
            if len(having) >= max(LEAST_JOINTS, len(best[2]) + 1):
                best = pattern, name, having
    return best


def _by_name(columns: dict[str, np.ndarray], name: str, joint: str) -> str | None:
    """Return the pattern of the column that holds a joint's name and this word."""
    for column in columns:
        stem, middle, rest = _around(column, joint)
        if middle and _word(stem + rest) == name:
            return f"{stem}{{joint}}{rest}"
    return None


def _around(column: str, joint: str) -> tuple[str, str, str]:
    return column.partition(joint)


def _word(text: str) -> str:
    return text.strip("._/[ ").lower()


def _sensor_columns(
    columns: dict[str, np.ndarray], mechanism: Mechanism, joints: Sequence[str]
) -> list[FoundSensor]:
    by_name: dict[str, dict[str, str]] = {}
    for column in columns:
        match = AXIS.match(column)
        if match is not None and not column.startswith("truth."):
            axis = match["axis"].lower().replace("force_", "f").replace("torque_", "m")
            by_name.setdefault(match["name"], {})[axis.replace("t", "m")] = column
    sensors: list[FoundSensor] = []
    for source, axes in by_name.items():
        if set(axes) != set(AXES):
            continue
        name = _sensor_name(source, [s.name for s in sensors])
        link, why = _sensor_link(mechanism, joints, name, "")
        plain = all(axes[axis] == f"{name}.{axis}" for axis in AXES)
        sensors.append(FoundSensor(name, link, source, why, {} if plain else axes))
    return sensors


def _sensor_name(source: str, taken: Sequence[str]) -> str:
    """Return a name that tells the sensor from others: of the parts of its topic or columns."""
    dull = {"wrench", "ft", "sensor", "broadcaster", "data", "raw", "force", "torque", ""}
    parts = [part for part in re.split(r"[/._\W]+", source) if part.lower() not in dull]
    name = "_".join(parts) or "ft"
    return name if name not in taken else f"{name}_{len(taken) + 1}"


def _sensor_link(
    mechanism: Mechanism, joints: Sequence[str], name: str, frame: str
) -> tuple[str, str]:
    """Return the first link that a sensor carries, and why it is taken for that."""
    if frame in mechanism.links:
        return frame, f"its messages are in the frame {frame}"
    named = [link for link in mechanism.links if name in link or link in name]
    if named:
        return named[0], "the link has its name"
    if "base" in name:
        return _first_with_mass(mechanism), "it is called a base sensor"
    links = force_torque_links(mechanism)
    if links:
        return links[0], "the model has a link that is named like a force-torque sensor"
    outermost = mechanism.joints[joints[-1]].child if joints else mechanism.root
    return outermost, "the model does not tell, so the link of the last joint is taken"


def _first_with_mass(mechanism: Mechanism) -> str:
    massive = (link.name for link in mechanism.links.values() if link.inertia.mass > 0)
    return next(massive, mechanism.root)


def _told(sensor: FoundSensor) -> str:
    source = sensor.source or ", ".join(sensor.columns.values())
    return f"sensor {sensor.name} ({source}) carries {sensor.link}: {sensor.why}"
