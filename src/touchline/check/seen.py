# SPDX-License-Identifier: Apache-2.0
"""One pass over a recording: its stamps, its signals, and what the model expects of them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from touchline.check.mending import Mending
from touchline.check.repeats import Repeats
from touchline.check.signals import SignalTable
from touchline.check.stamps import Stamps
from touchline.check.windows import WindowMaker, Windows
from touchline.identify.noise_meter import NoiseMeter
from touchline.logs.period import typical_period
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

FIRST = 20_000  # samples that are kept for trying one change after another


@dataclass(frozen=True)
class Seen:
    """What a recording shows, with its signals mended.

    Attributes:
        stamps: of time.
        table: every signal by itself.
        repeats: rows that hold the numbers of the row before.
        windows: readings beside what the model expects.
        first: the first samples, as logged.
        torque_noise, wrench_noise: the meters of these signals; the latter of six columns a sensor.
    """

    stamps: Stamps
    table: SignalTable
    repeats: Repeats
    windows: Windows
    first: list[Samples]
    torque_noise: NoiseMeter
    wrench_noise: NoiseMeter


def look(robot: Robot, parts: Iterable[Samples], mending: Mending) -> Seen | None:
    """Reads a recording once; None where it holds no samples."""
    stamps = maker = None
    table, repeats, first = SignalTable(robot), Repeats(robot), []
    torque = NoiseMeter(len(robot.joint_names))
    wrench = NoiseMeter(6 * len(robot.sensor_names))
    kept = 0
    for raw in parts:
        if kept < FIRST:
            first.append(raw.where(np.arange(len(raw)) < FIRST - kept))
            kept += len(raw)
        for part in mending.apply([raw]):
            if stamps is None or maker is None:
                period = typical_period(part.time)
                stamps, maker = Stamps(period), WindowMaker(robot, period)
            stamps.add(part.time)
            table.add(part)
            repeats.add(part)
            maker.add(part)
            torque.add(part.tau)
            wrench.add(part.wrench.reshape(len(part), -1))
    if stamps is None or maker is None or not stamps.samples:
        return None
    return Seen(stamps, table, repeats, maker.windows(), first, torque, wrench)


def windows_of(robot: Robot, seen: Seen, mending: Mending) -> Windows:
    """The windows of the first samples, as another mending makes them."""
    maker = WindowMaker(robot, seen.stamps.period)
    for part in mending.apply(seen.first):
        maker.add(part)
    return maker.windows()
