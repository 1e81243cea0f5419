# SPDX-License-Identifier: Apache-2.0
# pyright: reportMissingImports=false
"""What is felt as ROS 2 messages.

Contacts travel as JSON in a `std_msgs/String`, with the keys of `contacts.parquet`. No standard
message holds a link, its probability, a point with covariance and a force together. A message of
our own would have to be built on every machine that listens. Markers and wrenches are standard.
"""

import json
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.live.rcl import Rcl
from touchline.live.sample import Sample, whole_nanoseconds
from touchline.live.session import Session
from touchline.live.streams import Stream, StreamState
from touchline.model.robot import Robot
from touchline.native import core
from touchline.pipeline.pipeline import Result
from touchline.result.contact import Contact
from touchline.touch.touch import TouchEvent

METRES_PER_NEWTON = 0.01  # length of arrows
SHAFT, HEAD, POINT = 0.008, 0.02, 0.02  # m
SIGMAS = 2.0  # of the region that is drawn
FELT, BLOW = (0.84, 0.37, 0.0, 0.9), (0.8, 0.1, 0.1, 0.9)  # colours: red, green, blue, opacity
REGION = (0.84, 0.37, 0.0, 0.25)
TORQUES, CONTACTS = "~/external_joint_torques", "~/contacts"
TOUCH = "~/touch"  # presses, values, strokes and gestures, where the robot has an `interface`
SHOWN = 0.5  # s for which a marker is shown that is not renewed


class Messages:
    """Makes messages.

    Args:
        robot: whose names they carry.
        frame: name of the world frame.
    """

    def __init__(self, robot: Robot, frame: str) -> None:
        from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
        from geometry_msgs.msg import Point, WrenchStamped
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Bool, String
        from visualization_msgs.msg import Marker, MarkerArray

        self._robot, self._frame = robot, frame
        self._state, self._wrench, self._text, self._flag = JointState, WrenchStamped, String, Bool
        self._marker, self._markers, self._point = Marker, MarkerArray, Point
        self._array, self._status, self._pair = DiagnosticArray, DiagnosticStatus, KeyValue
        self._forces = [name for name in robot.segment_names if name != "root"]
        self._drawn = 0

    def writer(
        self, core_robot: core.Robot, rcl: Rcl, publishers: Mapping[str, Any]
    ) -> core.TopicWriter:
        """What publishes contacts, torques and wrenches from the thread that feels.

        Args:
            core_robot: of the pipeline.
            rcl: functions that publish.
            publishers: topic -> rclpy's publisher, for all of `kinds`.
        """
        pointers = {name: publisher.handle.pointer for name, publisher in publishers.items()}
        segments = enumerate(self._robot.segment_names)
        return core.TopicWriter(
            core_robot,
            self._frame,
            rcl.publish,
            pointers[CONTACTS],
            pointers[TORQUES],
            [(pointers[wrench_topic(n)], k) for k, n in segments if n in self._forces],
        )

    def kinds(self) -> dict[str, Any]:
        """Topic -> type of message."""
        return {
            TORQUES: self._state,
            **{wrench_topic(name): self._wrench for name in self._forces},
            CONTACTS: self._text,
            **({TOUCH: self._text} if self._robot.description.interface else {}),
            "~/collision": self._flag,
            "~/markers": self._markers,
            "/diagnostics": self._array,
        }

    def markers(self, sample: Sample, result: Result) -> Any:
        """What is drawn of a sample; None where nothing is and nothing was."""
        return self._draw(sample, result.contacts) if result.contacts or self._drawn else None

    def collision(self, collision: bool) -> Any:
        """Whether there was one since the last reset."""
        return self._flag(data=collision)

    def touch(self, event: TouchEvent) -> Any:
        """What a person did with the arm's interface, as JSON."""
        return self._text(data=json.dumps(event.as_json()))

    def _head(self, header: Any, sample: Sample, frame: str) -> None:
        seconds, rest = divmod(whole_nanoseconds(sample.time), 10**9)
        header.stamp.sec, header.stamp.nanosec, header.frame_id = seconds, rest, frame

    def _draw(self, sample: Sample, contacts: list[Contact]) -> Any:
        """An arrow to each contact that is located, its region, and points that may be touched."""
        found: list[Any] = []
        for number, contact in enumerate(contacts):
            colour = BLOW if contact.level == "collision" else FELT
            if contact.position is not None and contact.force is not None:
                start = contact.position - METRES_PER_NEWTON * contact.force
                arrow = self._new(sample, "force", number, self._marker.ARROW, colour)
                arrow.points = [self._at(start), self._at(contact.position)]
                arrow.scale.x, arrow.scale.y = SHAFT, HEAD
                found.append(arrow)
            if contact.position is not None and contact.covariance is not None:
                found.append(self._region(sample, number, contact))
            if contact.position is None and contact.candidates:
                points = self._new(sample, "candidates", number, self._marker.POINTS, colour)
                points.points = [self._at(c.position) for c in contact.candidates]
                points.scale.x = points.scale.y = POINT
                found.append(points)
        if not found:
            found = [self._marker(action=self._marker.DELETEALL)]
        self._drawn = len(contacts)
        return self._markers(markers=found)

    def _region(self, sample: Sample, number: int, contact: Contact) -> Any:
        """A sphere as large as the uncertainty is in its worst direction."""
        ball = self._new(sample, "region", number, self._marker.SPHERE, REGION)
        assert contact.position is not None and contact.covariance is not None
        ball.pose.position = self._at(contact.position)
        spread = float(np.sqrt(max(np.linalg.eigvalsh(contact.covariance)[-1], 0.0)))
        ball.scale.x = ball.scale.y = ball.scale.z = max(2 * SIGMAS * spread, POINT)
        return ball

    def _new(self, sample: Sample, name: str, number: int, kind: int, colour: Any) -> Any:
        marker = self._marker(ns=name, id=number, type=kind, action=self._marker.ADD)
        self._head(marker.header, sample, self._frame)
        marker.pose.orientation.w = 1.0
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour
        marker.lifetime.nanosec = int(SHOWN * 1e9)
        return marker

    def _at(self, position: Array) -> Any:
        x, y, z = (float(value) for value in position)
        return self._point(x=x, y=y, z=z)

    def diagnostics(self, session: Session, stamp: Any, node: str) -> Any:
        """Each stream's state, rate, age, losses, gate ratio and resets."""
        message = self._array()
        message.header.stamp = stamp
        now, source = time.monotonic(), session.connection.source.name
        streams = session.connection.streams
        ratios = _gate_ratios(session.result, len(streams), len(self._robot.joint_names))
        resets = _resets(session.result, self._robot, len(streams))
        message.status = [
            self._status(
                level=self._level(stream.state(now)),
                name=f"{node}: {stream.name}",
                message=str(stream.state(now)),
                hardware_id=source,
                values=[
                    self._pair(key=key, value=value)
                    for key, value in [
                        *_facts(stream, now),
                        ("gate_ratio", ratio),
                        ("resets", count),
                    ]
                ],
            )
            for stream, ratio, count in zip(streams, ratios, resets, strict=True)
        ]
        return message

    def _level(self, state: StreamState) -> bytes:
        if state is StreamState.OK:
            return self._status.OK
        if state is StreamState.SLOW:
            return self._status.WARN
        return self._status.STALE if state is StreamState.STALE else self._status.ERROR


def _gate_ratios(result: Result | None, streams: int, joints: int) -> list[str]:
    """Of each stream: the largest step of a channel over what its gate believes at once."""
    if result is None:
        return [""] * streams
    parts = [result.ratios]
    if streams > 1:  # the joints', then one for each sensor
        parts = [result.ratios[: 3 * joints], *result.ratios[3 * joints :].reshape(-1, 6)]
    return [f"{np.nan_to_num(part).max(initial=0.0):.2f}" for part in parts]


def _resets(result: Result | None, robot: Robot, streams: int) -> list[str]:
    """Of each stream: how often an estimate that begins with it has begun anew; the largest."""
    if result is None:
        return [""] * streams
    counts = {reset.name: reset.count for reset in result.resets}
    if streams == 1:
        return [str(max(counts.values()))]
    joints = max(counts[name] for name in robot.joint_names)
    return [str(joints), *(str(counts.get(name, "")) for name in robot.sensor_names)]


def _facts(stream: Stream, now: float) -> list[tuple[str, str]]:
    age = stream.age(now)
    lost = stream.lost / max(stream.received + stream.lost, 1)
    return [
        ("rate_hz", f"{stream.rate:.1f}"),
        ("age_ms", f"{1e3 * age:.1f}" if np.isfinite(age) else ""),
        ("received", str(stream.received)),
        ("lost", str(stream.lost)),
        ("lost_share", f"{lost:.6f}"),
        ("refused", str(stream.refused)),
    ]


def wrench_topic(segment: str) -> str:
    """The topic of a segment's wrench; a name of ROS has letters, digits and underscores."""
    plain = "".join(c if c.isalnum() and c.isascii() else "_" for c in segment)
    return f"~/{plain if not plain[:1].isdigit() else '_' + plain}/wrench"
