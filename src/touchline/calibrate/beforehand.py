# SPDX-License-Identifier: Apache-2.0
"""Recordings that nothing can be identified from, because their signals are not what they seem."""

from pathlib import Path

from touchline.calibrate.recordings import Recordings
from touchline.check.coarse import next_step
from touchline.check.mending import Mending
from touchline.check.seen import look
from touchline.errors import InputError
from touchline.model.robot import Robot


def refuse_wrong_signals(robot: Robot, recordings: Recordings, logs: list[Path]) -> None:
    """Refuses wrong units, signs, columns and another robot's log: least squares would absorb them.

    Raises:
        InputError: what is wrong with which recording, and what to do about it.
    """
    problems: list[str] = []
    for number, log in enumerate(logs):
        mending = Mending.none(robot)
        seen = look(robot, recordings.of(number), mending)
        step = None if seen is None else next_step(robot, seen, mending)
        if step is not None:
            problems += [f"{log}: {line}" for line in step.words]
    if problems:
        raise InputError(
            [
                *problems,
                "nothing written: mend this first (touchline check ROBOT LOG, --fix), or name the "
                "recordings of one robot alone; --trust takes the signals as they are",
            ]
        )
