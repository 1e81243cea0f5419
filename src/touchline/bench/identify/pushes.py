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

FORCE, LASTS, RISE = 25.0, 0.5, 0.05  # N, s, s: of any direction
BEYOND = 0.1  # m, of the place from the last joint along its axis
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
    return {name: _judged(robot, kind, rest) for name, kind in kinds.items()}


def _samples(robot: Robot, logs: list[Path]) -> tuple[Samples, Samples]:
    """What goes in, and what is judged."""
    recordings = []
    for log in logs:
        with open_log(log, robot.description) as recording:
            chunks = list(recording.chunks(1 << 15))
        recordings.append(
            Samples(
                np.concatenate([c.time for c in chunks]),
                np.concatenate([c.q for c in chunks]),
                np.concatenate([c.qd for c in chunks]),
                np.concatenate([c.tau for c in chunks]),
                np.concatenate([c.wrench for c in chunks]),
            )
        )
    if len(recordings) > 1:
        return recordings[0], recordings[1]
    (whole,) = recordings
    early = np.arange(len(whole)) < len(whole) // 2
    return whole.where(early), whole.where(~early)


def _judged(plain: Robot, kind: Robot, rest: Samples) -> Detected:
    found, end = Detected(), float(rest.time[-1])
    felt = _felt(kind, rest)
    found.share = sum(min(last, end) - first for first, last in felt) / (end - rest.time[0])
    for number in range(SETS):
        begins = np.arange(rest.time[0] + FIRST + LATER * number, end - 2 * LASTS, APART)
        events = _felt(kind, _pushed(plain, rest, begins, np.random.default_rng(number)))
        found.pushes += len(begins)
        found.found += sum(any(b <= first <= b + LASTS for first, _ in events) for b in begins)
        found.false += sum(
            not any(b <= first <= b + LASTS + AFTER for b in begins) for first, _ in events
        )
    return found


def _felt(robot: Robot, s: Samples) -> list[tuple[float, float]]:
    """Begin and end [s] of the events."""
    pipeline = Pipeline(robot, period=float(np.median(np.diff(s.time))))
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    return [(e.detected, np.inf if e.cleared is None else e.cleared) for e in pipeline.events]


def _pushed(robot: Robot, s: Samples, begins: Array, rng: np.random.Generator) -> Samples:
    tau = s.tau.copy()
    number = max(k for k, node in enumerate(robot.nodes) if node.joint == robot.joint_names[-1])
    link = robot.nodes[number].links[0]
    for begin in begins:
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        rows = np.flatnonzero((s.time >= begin) & (s.time < begin + LASTS))
        T = np.array([robot.poses(q)[number] for q in s.q[rows]])
        at = T[:, :3, 3] + BEYOND * T[:, :3, 2]
        size = FORCE * np.minimum(1.0, (s.time[rows] - begin) / RISE)
        force = size[:, None] * way
        wrench = np.hstack([force, np.cross(at, force)])
        tau[rows] -= contact_loads(robot, s.q[rows], link, wrench).torque
    return replace(s, tau=tau)
