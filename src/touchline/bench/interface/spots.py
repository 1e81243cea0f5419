# SPDX-License-Identifier: Apache-2.0
"""Spots taught on a real arm by joint torques alone: are later touches told?"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from touchline.bench.real.recordings import Recording, read_touched, touched_files
from touchline.bench.tables import Row
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.touch.teach import teach
from touchline.touch.touch import Touch

Array = NDArray[np.float64]

TAUGHT = 3  # touches that teach a spot
MARGIN = 0.15  # s; a press counts for a labelled touch from so long before it to so long after


def taught_spots(data: Path) -> list[tuple[str, ...]]:
    """Real recordings: one spot each, taught with its first touches, judged on the others."""
    with TemporaryDirectory() as scratch:
        found = [read_touched(file, Path(scratch)) for file in touched_files(data)]
    if not found:
        raise InputError(f"--data {data}: holds no recording (panda_touches/*.csv.gz)")
    robot, logs = found[0].robot, {recording.name: recording for recording in found}
    taught = {}
    for name, recording in logs.items():
        taught[name] = teach(robot, *_signals(recording), touches=TAUGHT).widget
    rows: list[Row] = [("real Panda, joint torques alone", "right", "another", "none of them")]
    rows.append(("taught, later touches", *_judged(robot, logs, taught, list(logs), TAUGHT)))
    left_out = np.zeros(3, int)
    for link in sorted({name[0] for name in logs}):
        others = {name: widget for name, widget in taught.items() if name[0] != link}
        own = [name for name in logs if name[0] == link]
        left_out += np.array([int(x) for x in _judged(robot, logs, others, own, 0)])
    rows.append(("on links that were not taught", *(str(x) for x in left_out)))
    return rows


def _signals(recording: Recording) -> tuple[Array, Array, Array, Array, Array]:
    s = recording.samples
    return s.time, s.q, s.qd, s.tau, s.wrench


def _judged(robot, logs, taught, names, first: int) -> tuple[str, str, str]:
    robot = Robot(replace(robot.description, interface=taught), robot.mechanism)
    right = other = none = 0
    for name in names:
        recording = logs[name]
        pipeline, touch = Pipeline(robot, period=recording.period), Touch(robot)
        found = []
        for row in zip(*_signals(recording), strict=True):
            found += [e for e in touch.update(pipeline.update(*row)) if e.kind == "press"]
        for begin, end in recording.touches[first:]:
            named = {e.widget for e in found if begin - MARGIN <= e.time <= end + MARGIN}
            right += named == {name}
            other += bool(named - {name})
            none += not named
    return str(right), str(other), str(none)
