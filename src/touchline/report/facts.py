# SPDX-License-Identifier: Apache-2.0
"""What the summary and the report say of an analysis, as rows of plain values."""

from dataclasses import dataclass

import numpy as np

from touchline.detector.thresholds import Thresholds
from touchline.health import HEALTH_MEANING
from touchline.model.robot import Robot
from touchline.report.statistics import Statistics
from touchline.result.event import Event
from touchline.result.kinds import Watch

UNWATCHED = (Watch.DEGRADED, Watch.BLIND)

SURE = 0.995  # a probability from here on is not told: it would read 100 %


@dataclass(frozen=True)
class JointFacts:
    """External torque of one joint [Nm]; NaN where it is not known, `threshold` None if untested.

    `rms`, `mean` and `largest` count all settled samples, `quiet_rms` those without contact.
    """

    name: str
    rms: float
    quiet_rms: float
    mean: float
    largest: float
    threshold: float | None


@dataclass(frozen=True)
class SegmentFacts:
    """External wrench on one segment [N, Nm]: size of the vectors, root mean square."""

    name: str
    force_rms: float
    quiet_force_rms: float
    moment_rms: float
    quiet_moment_rms: float
    force_threshold: float
    moment_threshold: float


def joint_facts(
    robot: Robot, statistics: Statistics, thresholds: Thresholds
) -> tuple[JointFacts, ...]:
    """One row per joint."""
    limits = {row.joint: row.contact for row in thresholds.rows if row.joint >= 0}
    torque, quiet = statistics.torque, statistics.quiet_torque
    return tuple(
        JointFacts(
            name,
            float(torque.rms[j]),
            float(quiet.rms[j]),
            float(torque.mean[j]),
            float(torque.largest[j]),
            limits.get(j),
        )
        for j, name in enumerate(robot.joint_names)
    )


def segment_facts(
    robot: Robot, statistics: Statistics, thresholds: Thresholds
) -> tuple[SegmentFacts, ...]:
    """One row per segment whose wrench is measured."""
    wrench, quiet = statistics.wrench, statistics.quiet_wrench
    rows = []
    for g, name in enumerate(robot.segment_names):
        if name == "root":
            continue
        limits = {row.component: row.contact for row in thresholds.rows if row.segment == g}
        force, moment = slice(6 * g, 6 * g + 3), slice(6 * g + 3, 6 * g + 6)
        rows.append(
            SegmentFacts(
                name,
                float(np.linalg.norm(wrench.rms[force])),
                float(np.linalg.norm(quiet.rms[force])),
                float(np.linalg.norm(wrench.rms[moment])),
                float(np.linalg.norm(quiet.rms[moment])),
                max(limits[i] for i in range(3)),
                max(limits[i] for i in range(3, 6)),
            )
        )
    return tuple(rows)


def health_facts(statistics: Statistics) -> tuple[tuple[str, int, str], ...]:
    """Name, count and meaning of every health bit that occurs."""
    return tuple(
        (bit.name.lower(), count, HEALTH_MEANING[bit])
        for bit, count in statistics.health.items()
        if count and bit.name
    )


def event_where(event: Event) -> str:
    """The best word there is for where an event was: a link, else the most distal loaded joint."""
    if event.link is not None:
        return event.link
    if event.status == "not_separable":
        return "several touches, or a twist"
    return f"beyond {event.joint}" if event.joint else ""


def event_place(event: Event) -> str:
    """The same, with its status where the event is not located, and its probability if not 1."""
    doubt = event_status(event).removeprefix("located").removeprefix(", ")
    return f"{event_where(event)} ({doubt})".lstrip() if doubt else event_where(event)


def event_status(event: Event) -> str:
    """Status of an event in words, and the probability of its body if that is not 1."""
    status = str(event.status).replace("_", " ")
    if event.link is None or (event.body_probability or 1.0) >= SURE:
        return status
    return f"{status}, {100 * (event.body_probability or 0.0):.0f} %"


def event_doubt(event: Event) -> str:
    """What is known of an event that is not located, and what is not, in sentences."""
    equations = f" ({event.rank} equations, {event.unknowns} unknowns)" if event.rank else ""
    radius = max((candidate.radius for candidate in event.candidates), default=0.0)
    words = {
        "ambiguous": "One contact at any of the marked places explains the measurements"
        f"{equations}; the percentages say how likely each is.",
        "not_separable": f"One push on {event.segment} cannot explain the measurements{equations}: "
        f"there are {_at_least(event)} at the same time, or one that pulls or twists. The arrow is "
        "the sum of the forces; their places cannot be told.",
        "wrench_only": "The force is known, its place is not: no push at a point of the surface "
        "explains the measurements.",
    }.get(event.status, "")
    if radius > 0.0:
        words += (
            " A mark stands for the part of its link around it that may be touched, up to "
            f"{100 * radius:.0f} cm away, and the percentage for how much speaks for it."
        )
    return words


def _at_least(event: Event) -> str:
    numbers = {2: "two contacts or more", 3: "three contacts or more"}
    return numbers.get(event.at_least or 0, "several contacts")


def detection_fact(robot: Robot, thresholds: Thresholds) -> str:
    """Which tests detect, and whether they have a rate of false alarms."""
    detection = robot.description.detection
    calibrated = f"calibrated for {detection.false_alarms:g} false alarms an hour"
    return f"{', '.join(detection.method)}; {thresholds.note or calibrated}"


def watch_warnings(robot: Robot, statistics: Statistics) -> list[str]:
    """A line for each segment of which a touch was felt worse than the robot can, or not at all."""
    lines = []
    for name, counts in zip(robot.segment_names, statistics.watch, strict=True):
        settled = max(int(counts.sum()), 1)
        degraded, blind = (100 * counts[list(Watch).index(w)] / settled for w in UNWATCHED)
        if degraded:
            lines.append(
                f"segment {name}: degraded in {degraded:.3g} % of the settled samples: "
                "a signal was missing, and others stood in"
            )
        if blind:
            lines.append(
                f"segment {name}: blind in {blind:.3g} % of the settled samples: "
                "a touch there moves no signal that is there"
            )
    return lines
