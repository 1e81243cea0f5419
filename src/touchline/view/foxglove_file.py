# SPDX-License-Identifier: Apache-2.0
"""Writes results as an MCAP file for Foxglove."""

from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.extras import need
from touchline.folder import replaced_file
from touchline.model.surface import Surface
from touchline.result.contact import Contact
from touchline.view.moments import (
    SHELL,
    Colour,
    Moment,
    arrow,
    colour,
    curves,
    moments,
    surfaces,
    told,
    wrenches,
)
from touchline.view.pose import quaternion_to, quaternions
from touchline.view.replay import Replay

WORLD = "world"  # with "_" behind it where a link is called so
SHAFT, HEAD, HEAD_SHARE, DOT = 0.012, 0.03, 0.25, 0.03  # m, m, of the length, m
_VECTOR = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
_WRENCH = {
    "title": "touchline.Wrench",
    "type": "object",
    "properties": {"frame_id": {"type": "string"}, "force": _VECTOR, "torque": _VECTOR},
}
_EVENT = {"title": "touchline.Event", "type": "object"}
_ALONG_X = quaternion_to(np.array([1.0, 0.0, 0.0]))


def write_foxglove(replay: Replay, path: Path) -> None:
    """Write the arm, its contacts, external torques, wrenches and events.

    Topics are `/tf` and `/robot` (frames and shapes of the links) and `/contacts` (an arrow for
    each force, a dot for each candidate). `/tau_ext` has joint efforts [Nm]. Wrenches [N, Nm] are
    `/wrench/NAME.seg` of segments (world frame and origin) and `/wrench/NAME.ext` of sensors
    (their frames). `/events` (as in `events.json`) and `/log` tell the rest. Poses come 30 times a
    second, curves 100 times.

    Args:
        replay: the results.
        path: of the MCAP file; an old one is replaced once the new one is whole.

    Raises:
        ModuleNotFoundError: foxglove-sdk is not installed.
        InputError: another process writes the file.
    """
    foxglove = need("foxglove")
    channels, messages = need("foxglove.channels"), need("foxglove.messages")
    context = foxglove.Context()
    with (
        replaced_file(path) as draft,
        foxglove.open_mcap(draft, allow_overwrite=True, context=context),
    ):
        links = replay.robot.mechanism.links
        writer = _Writer(foxglove, channels, messages, context, links)
        writer.robot(surfaces(replay), replay.start)
        writer.events(replay)
        for moment in moments(replay):
            writer.moment(moment)
        writer.curves(replay)


class _Writer:
    def __init__(
        self, foxglove: Any, channels: Any, messages: Any, context: Any, links: Any
    ) -> None:
        self._foxglove, self._m, self._context = foxglove, messages, context
        self._tf = channels.FrameTransformsChannel("/tf", context=context)
        self._robot = channels.SceneUpdateChannel("/robot", context=context)
        self._contacts = channels.SceneUpdateChannel("/contacts", context=context)
        self._torques = channels.JointStatesChannel("/tau_ext", context=context)
        self._log = channels.LogChannel("/log", context=context)
        self._shown: set[str] = set()
        self._world = WORLD if WORLD not in links else f"{WORLD}_"

    def robot(self, shapes: dict[str, Surface], time: float) -> None:
        m = self._m
        entities = []
        for link, surface in shapes.items():
            points = [m.Point3(x=x, y=y, z=z) for x, y, z in surface.vertices.tolist()]
            indices = np.asarray(surface.faces).ravel().tolist()
            mesh = m.TriangleListPrimitive(
                pose=self._pose(np.zeros(3)),
                points=points,
                indices=indices,
                color=self._colour(SHELL),
            )
            entities.append(
                m.SceneEntity(
                    timestamp=self._stamp(time),
                    frame_id=link,
                    id=link,
                    frame_locked=True,
                    triangles=[mesh],
                )
            )
        self._robot.log(m.SceneUpdate(entities=entities), log_time=_nanoseconds(time))

    def moment(self, moment: Moment) -> None:
        m, at, stamp = self._m, _nanoseconds(moment.time), self._stamp(moment.time)
        turns = quaternions(np.array([pose[:3, :3] for pose in moment.poses.values()]))
        transforms = [
            m.FrameTransform(
                timestamp=stamp,
                parent_frame_id=self._world,
                child_frame_id=link,
                translation=self._vector(pose[:3, 3]),
                rotation=self._turn(wxyz),
            )
            for (link, pose), wxyz in zip(moment.poses.items(), turns, strict=True)
        ]
        self._tf.log(m.FrameTransforms(transforms=transforms), log_time=at)
        entities = [self._contact(contact, stamp) for contact in moment.contacts]
        names = {f"event {contact.event}" for contact in moment.contacts}
        gone = [
            m.SceneEntityDeletion(
                timestamp=stamp, type=m.SceneEntityDeletionType.MatchingId, id=name
            )
            for name in sorted(self._shown - names)
        ]
        if entities or gone:
            self._contacts.log(m.SceneUpdate(entities=entities, deletions=gone), log_time=at)
        self._shown = names

    def _contact(self, contact: Contact, stamp: Any) -> Any:
        m, paint = self._m, self._colour(colour(contact))
        arrows, dots = [], []
        if (found := arrow(contact)) is not None:
            tail, vector = found
            length = float(np.linalg.norm(vector))
            turn = _product(quaternion_to(vector), _conjugate(_ALONG_X))
            arrows.append(
                m.ArrowPrimitive(
                    pose=self._pose(tail, turn),
                    shaft_length=(1 - HEAD_SHARE) * length,
                    shaft_diameter=SHAFT,
                    head_length=HEAD_SHARE * length,
                    head_diameter=HEAD,
                    color=paint,
                )
            )
        size = m.Vector3(x=DOT, y=DOT, z=DOT)
        for candidate in contact.candidates:
            dots.append(
                m.SpherePrimitive(pose=self._pose(candidate.position), size=size, color=paint)
            )
        facts = {"segment": contact.segment, "link": contact.link, "level": contact.level}
        facts |= {"status": contact.status}
        return m.SceneEntity(
            timestamp=stamp,
            frame_id=self._world,
            id=f"event {contact.event}",
            arrows=arrows,
            spheres=dots,
            metadata=[m.KeyValuePair(key=k, value=str(v)) for k, v in facts.items() if v],
        )

    def curves(self, replay: Replay) -> None:
        m = self._m
        joints = {name: f"tau_ext.{name}" for name in replay.robot.joint_names}
        columns = wrenches(replay)
        channels = {name: self._json(f"/wrench/{name}", _WRENCH) for name in columns}
        for times, values in curves(replay):
            for row, time in enumerate(times.tolist()):
                at = _nanoseconds(time)
                states = [
                    m.JointState(name=name, effort=float(values[column][row]))
                    for name, column in joints.items()
                    if np.isfinite(values[column][row])
                ]
                self._torques.log(
                    m.JointStates(timestamp=self._stamp(time), joints=states), log_time=at
                )
                for name, six in columns.items():
                    wrench = [float(values[column][row]) for column in six]
                    if np.isfinite(wrench).all():
                        frame = self._world if name.endswith(".seg") else name.removesuffix(".ext")
                        parts = {"force": wrench[:3], "torque": wrench[3:]}
                        message = {k: dict(zip("xyz", v, strict=True)) for k, v in parts.items()}
                        channels[name].log({"frame_id": frame} | message, log_time=at)

    def events(self, replay: Replay) -> None:
        m, channel = self._m, self._json("/events", _EVENT)
        for time, text, facts in told(replay.events):
            at = _nanoseconds(time)
            level = m.LogLevel.Warning if facts["level"] == "collision" else m.LogLevel.Info
            self._log.log(
                m.Log(timestamp=self._stamp(time), level=level, message=text, name="touchline"),
                log_time=at,
            )
            channel.log(facts, log_time=at)

    def _json(self, topic: str, schema: dict[str, Any]) -> Any:
        return self._foxglove.Channel(topic, schema=schema, context=self._context)

    def _stamp(self, time: float) -> Any:
        at = _nanoseconds(time)
        return self._m.Timestamp(sec=at // 10**9, nsec=at % 10**9)

    def _vector(self, xyz: Array) -> Any:
        x, y, z = (float(value) for value in xyz)
        return self._m.Vector3(x=x, y=y, z=z)

    def _turn(self, wxyz: Array) -> Any:
        w, x, y, z = (float(value) for value in wxyz)
        return self._m.Quaternion(x=x, y=y, z=z, w=w)

    def _pose(self, position: Array, wxyz: Array | None = None) -> Any:
        turn = np.array([1.0, 0.0, 0.0, 0.0]) if wxyz is None else wxyz
        return self._m.Pose(position=self._vector(position), orientation=self._turn(turn))

    def _colour(self, rgb: Colour) -> Any:
        r, g, b = (value / 255.0 for value in rgb)
        return self._m.Color(r=r, g=g, b=b, a=1.0)


def _nanoseconds(time: float) -> int:
    """Of a stamp [s]; stamps before 0 cannot be told and become 0."""
    return max(round(time * 1e9), 0)


def _conjugate(wxyz: Array) -> Array:
    return wxyz * np.array([1.0, -1.0, -1.0, -1.0])


def _product(a: Array, b: Array) -> Array:
    """Of quaternions (4,), w x y z."""
    w = a[0] * b[0] - a[1:] @ b[1:]
    return np.concatenate([[w], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])
