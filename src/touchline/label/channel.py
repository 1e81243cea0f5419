# SPDX-License-Identifier: Apache-2.0
"""The touch channel: what was felt in each sample of an episode, as numbers for learning."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Index, Mask
from touchline.errors import InputError
from touchline.logs.blocks import Block
from touchline.logs.log import Log
from touchline.logs.source import HEAD_ROWS
from touchline.model.description import RobotDescription
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.pipeline.table import ContactTable
from touchline.result.native import LEVELS as NATIVE_LEVELS

BEFORE = 0.5  # s before a contact that `soon` marks: what a policy needs to slow down
LEVELS = ("none", "contact", "collision")
_LEVELS = np.array([LEVELS.index(level) for level in NATIVE_LEVELS])


@dataclass(frozen=True)
class Channel:
    """What was felt in N samples; of several contacts the strongest is told.

    Attributes:
        tau_ext: (N, n) external joint torques [Nm].
        contact: (N,) whether anything is touched.
        link: (N,) index of the touched link in the list of `links`; -1: none, or not known.
        position: (N, 3) [m] in world, on that link; zeros where no place is known.
        force: (N, 3) on the robot [N], world axes; zeros without contact, or where not known.
        level: (N,) index in LEVELS.
        soon: (N,) no contact yet, but one begins within BEFORE.
        health: (N,) bits of `touchline.Health`.
    """

    tau_ext: NDArray[np.float32]
    contact: Mask
    link: Index
    position: NDArray[np.float32]
    force: NDArray[np.float32]
    level: Index
    soon: Mask
    health: Index

    def columns(self) -> dict[str, NDArray]:
        """The arrays by name."""
        return dict(self.__dict__)


def parts(robot: Robot) -> dict[str, tuple[str, ...]]:
    """Names of the numbers of each array, as a data set's description wants them."""
    xyz = ("x", "y", "z")
    several = {"tau_ext": robot.joint_names, "position": xyz, "force": xyz}
    return {name: several.get(name, (name,)) for name in Channel.__annotations__}


class Feeler:
    """Feels episodes, each from its own beginning.

    Args:
        robot: the robot.
        period: between samples [s].
        bandwidth: of the observer [rad/s], or None for the description's.

    Attributes:
        links: names that `Channel.link` counts.
    """

    def __init__(self, robot: Robot, period: float, bandwidth: float | None) -> None:
        self.robot, self.period = robot, period
        self._pipeline = Pipeline(robot, bandwidth, period=period)
        self._fresh = True
        self.links = tuple(dict.fromkeys(p.link for p in self._pipeline.skin.patches))
        self._index = {name: i for i, name in enumerate(self.links)}

    def feel(self, samples: Samples) -> Channel:
        """The channel of one episode."""
        if not self._fresh:
            self._pipeline.reset()
        self._fresh = False
        estimate, _ = self._pipeline.run(
            samples.time, samples.q, samples.qd, samples.tau, samples.wrench
        )
        count = len(samples)
        link, level = np.full(count, -1, np.int64), np.zeros(count, np.int64)
        position, force = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
        contact = np.zeros(count, bool)
        table = self._strongest(self._pipeline.contacts)
        at, told = table.sample, table.columns()
        contact[at] = True
        level[at] = _LEVELS[table.level]
        link[at] = [self._index.get(name, -1) for name in told["link"]]
        known = np.isfinite(table.position).all(axis=1)
        position[at[known]] = table.position[known]
        link[at[~known]] = -1
        pushes = np.column_stack([told[name] for name in ("fx", "fy", "fz")])
        force[at] = np.where(np.isfinite(pushes), pushes, 0.0)
        soon = _soon(samples.time, contact, self.period)
        tau = estimate.tau_ext.astype(np.float32)
        health = estimate.health.astype(np.int64)
        return Channel(tau, contact, link, position, force, level, soon, health)

    @staticmethod
    def _strongest(table: ContactTable) -> ContactTable:
        """One row for each touched sample."""
        if not len(table):
            return table
        told = table.columns()
        size = np.linalg.norm(np.column_stack([told[n] for n in ("fx", "fy", "fz")]), axis=1)
        order = np.lexsort((np.nan_to_num(-size), table.sample))
        first = np.flatnonzero(np.diff(table.sample[order], prepend=-1))
        rows = order[first]
        return ContactTable(table.sample[rows], table.numbers[rows], table.names)


def _soon(time: NDArray, contact: Mask, period: float) -> Mask:
    before = BEFORE + 0.5 * period  # whatever the rounding of the stamps
    onsets = np.flatnonzero(contact & ~np.concatenate([[False], contact[:-1]]))
    soon = np.zeros(len(time), bool)
    for onset in onsets:
        soon |= (time >= time[onset] - before) & (time < time[onset])
    return soon & ~contact


class _Episode:
    """An episode in memory, as the source of a log: velocities and delays are seen to there."""

    columns: tuple[str, ...] = ()
    delayed_wrenches = True
    duration: float | None = None

    def __init__(self, block: Block, without_velocity: bool) -> None:
        self._block = block
        self.topics: dict[str, str] = {}
        self.metadata: dict[str, Any] = {}
        self.warnings: list[str] = []
        self.losses: list[str] = []
        self.rows = len(block["time"])
        joints = range(block["q"].shape[1]) if without_velocity else ()
        self.without_velocity = tuple(joints)

    def head(self) -> Block:
        return {name: values[:HEAD_ROWS] for name, values in self._block.items()}

    def blocks(self) -> Iterator[Block]:
        yield self._block

    def progress(self) -> float:
        return 1.0

    def close(self) -> None:
        pass


def episode_samples(
    path: Path,
    description: RobotDescription,
    time: NDArray,
    q: NDArray,
    qd: NDArray | None,
    tau: NDArray | None,
    wrench: NDArray | None,
) -> Samples:
    """The samples of an episode, with velocities from the positions where it has none.

    Args:
        path: of the data set, for messages.
        description: of the robot, n joints and k sensors.
        time: (N,) [s].
        q: (N, n) [rad or m].
        qd: (N, n) or None.
        tau: (N, n) [Nm] or None.
        wrench: (N, 6 k) or None.

    Raises:
        InputError: no samples, or neither torques nor wrenches.
    """
    count, joints, sensors = len(time), len(description.joints), len(description.sensors)
    if not count:
        raise InputError(f"{path}: an episode holds no samples")
    if tau is None and wrench is None:
        raise InputError(f"{path}: neither joint torques nor wrenches: nothing can be felt")
    missing = np.full((count, joints), np.nan)
    block = {
        "time": time,
        "q": q,
        "qd": missing if qd is None else qd,
        "tau": missing if tau is None else tau,
        "wrench": (
            np.full((count, sensors, 6), np.nan)
            if wrench is None
            else wrench.reshape(count, sensors, 6)
        ),
    }
    log = Log(path, description, _Episode(block, qd is None))
    return next(log.chunks(count))
