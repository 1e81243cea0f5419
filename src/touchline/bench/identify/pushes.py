# SPDX-License-Identifier: Apache-2.0
"""Pushes computed into motion that played no part: does a calibrated arm find more, or less?"""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from touchline.arrays import Array
from touchline.bench.identify.arms import Arm
from touchline.calibrate.run import calibrate
from touchline.logs import open_log, write_table
from touchline.model.robot import Robot, load_robot
from touchline.observer.dynamics import contact_loads
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.wrong_arm import flange

FORCE, LASTS, RISE = 25.0, 0.5, 0.05  # N, s, s: of any direction, into real motion
BEYOND = 0.1  # m, of the place from the last joint or sensor, along its axis
FIRST, LATER, APART = (
    1.5,
    0.5,
    1.8,
)  # s: the first push, how much later in the next set, between two
SETS = 3  # of times
AFTER = 0.2  # s, within which what begins is still a push's


@dataclass
class Detected:
    """Of an arm by one description.

    Attributes:
        pushes: that were computed into its motion, `found` of them.
        false: events that are none of them.
        share: of the motion without pushes that it is in contact.
    """

    pushes: int = 0
    found: int = 0
    false: int = 0
    share: float = 0.0


def detect(arm: Arm, data: Path) -> dict[str, Detected]:
    """By the model alone, and calibrated on the first half or file; the rest is judged."""
    with TemporaryDirectory() as folder:
        source, out, log = (Path(folder) / name for name in ("a.yaml", "b.yaml", "first.parquet"))
        source.write_text(arm.text(data) + arm.log)
        first, rest = _samples(load_robot(source), [data / log for log in arm.logs])
        source.write_text(arm.text(data))
        robot = load_robot(source)
        write_table(log, first, robot.description)
        calibrate([log], source, out)
        kinds = {"before": robot, "after": load_robot(out)}
    return {name: judged(robot, kind, rest) for name, kind in kinds.items()}


def _samples(robot: Robot, logs: list[Path]) -> tuple[Samples, Samples]:
    """What goes in, and what is judged."""
    recordings = [_read(robot, log) for log in logs]
    if len(recordings) > 1:
        return recordings[0], recordings[1]
    (whole,) = recordings
    early = np.arange(len(whole)) < len(whole) // 2
    return whole.where(early), whole.where(~early)


def _read(robot: Robot, log: Path) -> Samples:
    """A whole log."""
    with open_log(log, robot.description) as recording:
        chunks = list(recording.chunks(1 << 15))
    return Samples(
        np.concatenate([c.time for c in chunks]),
        np.concatenate([c.q for c in chunks]),
        np.concatenate([c.qd for c in chunks]),
        np.concatenate([c.tau for c in chunks]),
        np.concatenate([c.wrench for c in chunks]),
    )


def judged(
    real: Robot, kind: Robot, rest: Samples, force: float = FORCE, sets: int = SETS
) -> Detected:
    """What an arm feels of pushes that are computed into its motion.

    Args:
        real: the arm that is pushed.
        kind: as it is described.
        rest: motion that nothing touches.
        force: of a push [N].
        sets: of times at which the arm is pushed.
    """
    found, end = Detected(), float(rest.time[-1])
    felt = _felt(kind, rest)
    found.share = sum(min(last, end) - first for first, last in felt) / (end - rest.time[0])
    for number in range(sets):
        begins = np.arange(rest.time[0] + FIRST + LATER * number, end - 2 * LASTS, APART)
        events = _felt(kind, _pushed(real, rest, begins, force, np.random.default_rng(number)))
        found.pushes += len(begins)
        found.found += sum(any(b <= first <= b + LASTS for first, _ in events) for b in begins)
        found.false += sum(
            not any(b <= first <= b + LASTS + AFTER for b in begins) for first, _ in events
        )
    return found


def _felt(robot: Robot, s: Samples) -> list[tuple[float, float]]:
    """Begin and end [s] of the events, of samples that are read as the description says."""
    with TemporaryDirectory() as folder:
        log = Path(folder) / "log.parquet"
        write_table(log, s, robot.description)
        read = _read(robot, log)
    pipeline = Pipeline(robot, period=float(np.median(np.diff(read.time))))
    pipeline.run(read.time, read.q, read.qd, read.tau, read.wrench)
    return [(e.detected, np.inf if e.cleared is None else e.cleared) for e in pipeline.events]


def _pushed(
    robot: Robot, s: Samples, begins: Array, force: float, rng: np.random.Generator
) -> Samples:
    tau, wrench = s.tau.copy(), s.wrench.copy()
    number, link = flange(robot)
    for begin in begins:
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        rows = np.flatnonzero((s.time >= begin) & (s.time < begin + LASTS))
        T = np.array([robot.poses(q)[number] for q in s.q[rows]])
        at = T[:, :3, 3] + BEYOND * T[:, :3, 2]
        size = force * np.minimum(1.0, (s.time[rows] - begin) / RISE)
        pushing = size[:, None] * way
        about_origin = np.hstack([pushing, np.cross(at, pushing)])
        loads = contact_loads(robot, s.q[rows], link, about_origin)
        tau[rows] -= loads.torque / [joint.gain for joint in robot.description.joints]
        wrench[rows] -= loads.wrench
    return replace(s, tau=tau, wrench=wrench)
