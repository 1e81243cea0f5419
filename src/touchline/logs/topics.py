# SPDX-License-Identifier: Apache-2.0
"""Which topics of a rosbag2 carry a robot's signals."""

from touchline.errors import InputError
from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED
from touchline.logs.naming import Naming
from touchline.model.description import RobotDescription
from touchline.suggest import did_you_mean


def choose_topics(
    topics: dict[str, str], description: RobotDescription, naming: Naming, path: str
) -> tuple[str, dict[str, str]]:
    """The topic of the joint states, and each sensor's topic.

    A topic that is not named under `log.topics` is chosen where there is only one candidate; for
    sensors also where one candidate's path holds the sensor's name.

    Args:
        topics: topic -> message type, as recorded.
        description: names the sensors.
        naming: holds what `log.topics` says.
        path: of the log, for messages.

    Raises:
        InputError: with all topics and how to choose, where a topic is missing or not unique.
    """
    problems: list[str] = []
    joint_states = naming.joint_states
    if joint_states is not None:
        _check(joint_states, JOINT_STATE, "joint_states", topics, problems)
    else:
        joint_states = _only(topics, JOINT_STATE, "joint_states: /TOPIC", problems)
    wrench: dict[str, str] = {}
    for sensor in (s.name for s in description.sensors):
        named = naming.wrench_topics.get(sensor)
        if named is not None:
            _check(named, WRENCH_STAMPED, f"wrench.{sensor}", topics, problems)
        else:
            named = _of_sensor(topics, sensor, len(description.sensors), problems)
        wrench[sensor] = named
    for topic in {t for t in wrench.values() if t and list(wrench.values()).count(t) > 1}:
        users = ", ".join(s for s, t in wrench.items() if t == topic)
        problems.append(f"topic {topic} serves several sensors: {users}")
    if problems:
        listed = "; ".join(f"{name} ({kind})" for name, kind in topics.items())
        raise InputError([f"{path}: {p}" for p in problems] + [f"{path}: topics: {listed}"])
    return joint_states, wrench


def _check(topic: str, kind: str, key: str, topics: dict[str, str], problems: list[str]) -> None:
    if topic not in topics:
        hint = did_you_mean(topic, topics)
        problems.append(f"log.topics.{key}: there is no topic {topic!r}{hint}")
    elif topics[topic] != kind:
        problems.append(f"log.topics.{key}: {topic} carries {topics[topic]}, not {kind}")


def _only(topics: dict[str, str], kind: str, choice: str, problems: list[str]) -> str:
    found = [topic for topic, carried in topics.items() if carried == kind]
    if len(found) == 1:
        return found[0]
    if found:
        problems.append(
            f"several topics carry {kind} ({', '.join(found)}); "
            f"choose with `log: {{topics: {{{choice}}}}}`"
        )
    else:
        problems.append(f"no topic carries {kind}")
    return ""


def _of_sensor(topics: dict[str, str], sensor: str, sensors: int, problems: list[str]) -> str:
    found = [t for t, kind in topics.items() if kind == WRENCH_STAMPED]
    named = [t for t in found if sensor in t.split("/")]
    if len(named) == 1:
        return named[0]
    if sensors == 1 or not found:
        return _only(topics, WRENCH_STAMPED, f"wrench: {{{sensor}: /TOPIC}}", problems)
    problems.append(
        f"no single topic of sensor {sensor!r} among {', '.join(found)}; "
        f"choose with `log: {{topics: {{wrench: {{{sensor}: /TOPIC}}}}}}`"
    )
    return ""
