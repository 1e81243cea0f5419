# SPDX-License-Identifier: Apache-2.0
"""Writes results as an RRD file for Rerun."""

from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.extras import need
from touchline.folder import replaced_file
from touchline.view.moments import (
    EPOCH,
    METRES_PER_NEWTON,
    SHELL,
    Moment,
    arrow,
    colour,
    curves,
    moments,
    surfaces,
    told,
)
from touchline.view.pose import quaternions
from touchline.view.replay import Replay

TIMELINE = "time"
RADIUS, DOT = 0.006, 0.015  # m


def write_rerun(replay: Replay, path: Path) -> None:
    """Write the arm, its contacts, the curves of the estimates, and the events.

    Entities: `world/LINK` (shape and pose), `world/contacts` (an arrow for each force),
    `world/candidates`, `estimates/SIGNAL` as in `estimates.parquet`, and `events`. The time line is
    called `time`: dates, or the time since 0 [s]. Poses come 30 times a second, curves 100 times.

    Args:
        replay: the results.
        path: of the RRD file; an old one is replaced once the new one is whole.

    Raises:
        ModuleNotFoundError: rerun-sdk is not installed.
        InputError: another process writes the file.
    """
    rr = need("rerun")
    dated = abs(replay.start) > EPOCH
    with replaced_file(path) as draft:
        name = replay.origin.log.name
        recording = rr.RecordingStream("touchline", recording_id=name)
        recording.set_log_time_enabled(False)  # when the file was written is nothing to show
        recording.set_log_tick_enabled(False)
        recording.save(draft)
        try:
            recording.send_recording_name(name)
            recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            for link, surface in surfaces(replay).items():
                mesh = rr.Mesh3D(
                    vertex_positions=surface.vertices,
                    triangle_indices=surface.faces,
                    albedo_factor=SHELL,
                )
                recording.log(f"world/{link}", mesh, static=True)
            writer = _Writer(rr, recording, dated)
            writer.moments(replay)
            for times, values in curves(replay):
                writer.curves(times, values)
            writer.events(replay)
        finally:
            recording.flush()
            recording.disconnect()


class _Writer:
    def __init__(self, rr: Any, recording: Any, dated: bool) -> None:
        self._rr, self._recording, self._dated = rr, recording, dated
        self._shown = False

    def moments(self, replay: Replay) -> None:
        times: list[float] = []
        poses: dict[str, list[Array]] = {}
        for moment in moments(replay):
            times.append(moment.time)
            for link, pose in moment.poses.items():
                poses.setdefault(link, []).append(pose)
            self._contacts(moment)
        for link, found in poses.items():
            T = np.array(found)
            turns = quaternions(T[:, :3, :3])
            columns = self._rr.Transform3D.columns(
                translation=T[:, :3, 3], quaternion=np.roll(turns, -1, axis=1)
            )
            self._send(f"world/{link}", np.array(times), columns)

    def _contacts(self, moment: Moment) -> None:
        if not moment.contacts and not self._shown:
            return
        self._at(moment.time)
        rr, contacts = self._rr, moment.contacts
        drawn = [(contact, found) for contact in contacts if (found := arrow(contact)) is not None]
        arrows = rr.Arrows3D(
            origins=np.reshape([tail for _, (tail, _) in drawn], (-1, 3)),
            vectors=np.reshape([vector for _, (_, vector) in drawn], (-1, 3)),
            colors=[colour(contact) for contact, _ in drawn],
            radii=[RADIUS] * len(drawn),
            labels=[
                f"{np.linalg.norm(vector) / METRES_PER_NEWTON:.0f} N, {contact.link}"
                for contact, (_, vector) in drawn
            ],
        )
        self._recording.log("world/contacts", arrows)
        places = [(c, candidate) for c in contacts for candidate in c.candidates]
        dots = rr.Points3D(
            np.reshape([candidate.position for _, candidate in places], (-1, 3)),
            radii=[DOT] * len(places),
            colors=[colour(contact) for contact, _ in places],
        )
        self._recording.log("world/candidates", dots)
        self._shown = bool(contacts)

    def curves(self, times: Array, values: dict[str, Array]) -> None:
        for signal, value in values.items():
            known = np.isfinite(value)
            if known.any():
                columns = self._rr.Scalars.columns(scalars=value[known])
                self._send(f"estimates/{signal}", times[known], columns)

    def events(self, replay: Replay) -> None:
        for time, text, facts in told(replay.events):
            self._at(time)
            level = "WARN" if facts["level"] == "collision" else "INFO"
            self._recording.log("events", self._rr.TextLog(text, level=level))

    def _at(self, time: float) -> None:
        stamp = {"timestamp": time} if self._dated else {"duration": time}
        self._recording.set_time(TIMELINE, **stamp)

    def _send(self, entity: str, times: Array, columns: Any) -> None:
        stamps = {"timestamp": times} if self._dated else {"duration": times}
        index = self._rr.TimeColumn(TIMELINE, **stamps)
        self._recording.send_columns(entity, indexes=[index], columns=columns)
