# SPDX-License-Identifier: Apache-2.0
"""The touched arm calibrated on what is untouched of all recordings but the one that is judged."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from touchline.arrays import Mask
from touchline.calibrate.run import calibrate
from touchline.logs.csvtext import write_csv
from touchline.model.robot import load_robot
from touchline.trials.real_recordings import Recording

BESIDE = 0.25  # s before and after a labelled touch: the arm trembles and creeps for as long


def calibrated(recordings: Sequence[Recording], scratch: Path) -> Iterator[Recording]:
    """Each recording with a robot calibrated on the others; they show one pose.

    Args:
        recordings: of one robot with the columns of `panda_touches`.
        scratch: folder for files.
    """
    logs = [_written(recording, scratch) for recording in recordings]
    for number, recording in enumerate(recordings):
        others = [log for i, log in enumerate(logs) if i != number]
        out = scratch / f"without_{recording.name}.yaml"
        source = recording.robot.description.path
        assert source is not None
        calibrate(others, source, out, identification=False)
        yield replace(recording, robot=load_robot(out))


def untouched(recording: Recording) -> Mask:
    """(N,) samples that are far from each touch."""
    time = recording.samples.time
    near = np.zeros(len(time), bool)
    for begin, end in recording.touches:
        near |= (time > begin - BESIDE) & (time < end + BESIDE)
    return ~near


def _written(recording: Recording, scratch: Path) -> Path:
    s = recording.samples.where(untouched(recording))
    columns = {"time": s.time}
    for name, values in (("q", s.q), ("dq", s.qd), ("tau_J", s.tau)):
        columns |= {f"{name}{j}": values[:, j] for j in range(values.shape[1])}
    path = scratch / f"untouched_{recording.name}.csv"
    write_csv(path, columns)
    return path
