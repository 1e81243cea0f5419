# SPDX-License-Identifier: Apache-2.0
"""Spots taught on a real arm by joint torques alone: are later touches told?"""

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from tqdm import tqdm

from touchline.arrays import Array
from touchline.bench.tables import Row
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.touch.teach import teach
from touchline.touch.touch import Touch, TouchEvent
from touchline.trials.real_recordings import Recording, read_touched, touched_files

FIRST = "panda_touches"  # folder of the recordings that the rules were made with
TAUGHT = 3  # touches that teach a spot
MARGIN = 0.15  # s; a press counts for a labelled touch from so long before it to so long after


def taught_spots(data: Path) -> list[Row]:
    """Real recordings: one spot each, taught with its first touches, judged on the others.

    Those of `panda_touches` for themselves, then together with `panda_touches_more`.
    """
    files = touched_files(data)
    with TemporaryDirectory() as scratch:
        found = {file: read_touched(file, Path(scratch)) for file in files}
    if not found:
        raise InputError(f"--data {data}: holds no recording (panda_touches/*.csv.gz)")
    first = [found[file] for file in files if file.parent.name == FIRST]
    rows: list[Row] = [("real Panda, joint torques alone", "right", "another", "none of them")]
    rows += _told(first) if first else []
    if len(first) < len(found):
        rows += _told(list(found.values()))
    return rows


def _told(recordings: list[Recording]) -> list[Row]:
    """Of spots that are all taught on one robot."""
    robot, logs = recordings[0].robot, {recording.name: recording for recording in recordings}
    taught = {name: teach(robot, *_first(recording)).widget for name, recording in logs.items()}
    known, unknown = np.zeros(3, int), np.zeros(3, int)
    for name, recording in tqdm(logs.items(), file=sys.stderr, leave=False, disable=None):
        others = {other: widget for other, widget in taught.items() if other[0] != name[0]}
        both = _judged(robot, recording, (taught, others))
        known += np.sum(both[0][TAUGHT:], axis=0)
        unknown += np.sum(both[1], axis=0)
    rows: list[Row] = []
    for what, counts in (("later touches", known), ("on links not taught", unknown)):
        total = counts.sum()
        name = f"{len(logs)} spots: {what}"
        rows.append((name, *(f"{count}/{total}" for count in counts)))
    return rows


def _first(recording: Recording) -> tuple[Array, Array, Array, Array, Array]:
    """The signals until the touches that teach are over."""
    s, touches = recording.samples, recording.touches
    rows = s.time < 0.5 * (touches[TAUGHT - 1, 1] + touches[TAUGHT, 0])
    return s.time[rows], s.q[rows], s.qd[rows], s.tau[rows], s.wrench[rows]


def _judged(robot: Robot, recording: Recording, interfaces) -> list[Array]:
    """For each interface and labelled touch (T, 3): right, another, none of them."""
    s, pipeline = recording.samples, Pipeline(robot, period=recording.period)
    touch = [
        Touch(Robot(replace(robot.description, interface=widgets), robot.mechanism), pipeline.skin)
        for widgets in interfaces
    ]
    found: list[list[TouchEvent]] = [[] for _ in touch]
    for row in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        result = pipeline.update(*row)
        for one, events in zip(touch, found, strict=True):
            events += [event for event in one.update(result) if event.kind == "press"]
    judged = []
    for events in found:
        counts = np.zeros((len(recording.touches), 3), int)
        for i, (begin, end) in enumerate(recording.touches):
            named = {e.widget for e in events if begin - MARGIN <= e.time <= end + MARGIN}
            counts[i] = named == {recording.name}, bool(named - {recording.name}), not named
        judged.append(counts)
    return judged
