# SPDX-License-Identifier: Apache-2.0
"""Recordings that nothing can be identified from, because their signals are not what they seem."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from touchline.calibrate.lacking import ADVICE, MOST_LACKING
from touchline.calibrate.recordings import Recordings
from touchline.check.coarse import next_step
from touchline.check.mending import Mending
from touchline.check.seen import look
from touchline.errors import InputError
from touchline.identify.choice import POSES
from touchline.identify.evidence import Evidence
from touchline.model.robot import Robot


def named(logs: list[Path]) -> str:
    """The recordings, as a message begins."""
    return ", ".join(map(str, logs))


@contextmanager
def naming(logs: list[Path], recordings: Recordings) -> Iterator[None]:
    """Has messages begin with all recordings, or with what most of their samples lack."""
    try:
        yield
    except InputError as error:
        first, *more = error.problems
        lacking = recordings.samples - recordings.moving
        if lacking > MOST_LACKING * recordings.samples:
            what = "a position or velocity that is not a number, and show nothing"
            told = f"{lacking} of {recordings.samples} samples have {what}"
            if recordings.lacking:
                told += f": {'; '.join(recordings.lacking.values())}"
            advice = [ADVICE[signal] for signal in recordings.lacking]
            raise InputError([f"{named(logs)}: {told}", *error.problems, *advice]) from None
        if any(str(log) in first for log in logs):
            raise
        raise InputError([f"{named(logs)}: {first}", *more]) from None


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


def refuse_one_pose(evidence: Evidence, logs: list[Path]) -> None:
    """Refuses recordings of a single pose, in which an offset and a mass read the same.

    What has no joints stands in the one pose that it has: nothing else can be recorded.

    Raises:
        InputError: what to record instead.
    """
    moved = float(np.ptp(evidence.q, axis=0).max(initial=0.0))
    if evidence.q.shape[1] > 0 and moved < POSES:
        raise InputError(
            [
                f"{named(logs)}: one pose alone: no joint moves by more than {moved:.2g} rad, "
                f"{POSES:g} rad are needed. An offset of a sensor then reads the same as a mass",
                "nothing written. Record a minute in which all joints move, or let the arm rest in "
                "some ten poses for three seconds each: touchline calibrate --plan ROBOT proposes "
                "both. The noise of this pose alone is measured with --no-identify",
            ]
        )
