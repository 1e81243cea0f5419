# SPDX-License-Identifier: Apache-2.0
"""Picks the columns of a table that a robot needs and puts them in the robot's order."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from touchline.errors import InputError
from touchline.logs.blocks import Block
from touchline.logs.naming import Column, Naming
from touchline.model.description import AXES, RobotDescription
from touchline.suggest import did_you_mean, listing

MOST_NAMED = 3  # missing columns that are told one by one


@dataclass(frozen=True)
class Pick:
    """One column to read and the place its values go to: `signal[:, *index]`."""

    column: Column
    signal: str
    index: tuple[int, ...]


@dataclass(frozen=True)
class Selection:
    """The columns to read.

    Attributes:
        picks: one per column.
        shapes: signal -> shape of one row.
        without_velocity: indices of the joints whose `qd` the log lacks.
    """

    picks: tuple[Pick, ...]
    shapes: dict[str, tuple[int, ...]]
    without_velocity: tuple[int, ...]

    @property
    def names(self) -> list[str]:
        """The columns' names."""
        return [pick.column.name for pick in self.picks]

    def assemble(self, read: Callable[[str], np.ndarray], rows: int) -> Block:
        """Fill a block from `read(name)`, which returns (rows,) float64; the rest is NaN."""
        block = {name: np.full((rows, *shape), np.nan) for name, shape in self.shapes.items()}
        for pick in self.picks:
            target = block[pick.signal][(slice(None), *pick.index)]
            np.multiply(read(pick.column.name), pick.column.factor, out=target)
        return block


def signal_shapes(description: RobotDescription) -> dict[str, tuple[int, ...]]:
    """Shape of one row of every signal."""
    n, k = len(description.joints), len(description.sensors)
    return {"time": (), "q": (n,), "qd": (n,), "tau": (n,), "wrench": (k, 6)}


def wanted_picks(description: RobotDescription, naming: Naming) -> list[Pick]:
    """Every column the robot can use; `tau` only where it is measured."""
    picks = [Pick(naming.time, "time", ())]
    for signal, columns in naming.joints.items():
        for j, (joint, column) in enumerate(zip(description.joints, columns, strict=True)):
            if signal != "tau" or joint.measured:
                picks.append(Pick(column, signal, (j,)))
    for k, sensor in enumerate(description.sensors):
        for axis, column in naming.sensors[sensor.name].items():
            picks.append(Pick(column, "wrench", (k, AXES.index(axis))))
    return picks


def select_columns(
    description: RobotDescription, naming: Naming, present: list[str], path: str
) -> Selection:
    """Find the robot's columns among those present.

    Raises:
        InputError: columns are missing (`qd` may be) or occur twice.
    """
    picks = wanted_picks(description, naming)
    missing = [pick for pick in picks if pick.column.name not in present]
    problems = _missing_problems([p for p in missing if p.signal != "qd"], picks, present, path)
    found = [pick for pick in picks if pick.column.name in present]
    for pick in found:
        if (count := present.count(pick.column.name)) > 1:
            problems.append(f"{path}: column {pick.column.name!r} occurs {count} times")
    if problems:
        raise InputError(problems)
    without_velocity = tuple(pick.index[0] for pick in missing if pick.signal == "qd")
    return Selection(tuple(found), signal_shapes(description), without_velocity)


def _missing_problems(
    missing: list[Pick], picks: list[Pick], present: list[str], path: str
) -> list[str]:
    if not missing:
        return []
    problems = []
    torques = [pick.column.name for pick in picks if pick.signal == "tau"]
    if torques and not set(torques) & set(present):
        problems.append(
            f"{path}: no joint torques: none of {listing(torques)} is there; name the columns "
            "under `log: tau`, or give joints without a torque signal `torque: none`"
        )
        missing = [pick for pick in missing if pick.signal != "tau"]
    if len(missing) > MOST_NAMED:  # another kind of file: its columns say more than ours
        return [
            f"{path}: {len(missing)} columns are missing, such as "
            f"{', '.join(repr(pick.column.name) for pick in missing[:MOST_NAMED])}; columns "
            f"present: {listing(present, 20)}; other names are given under `log`"
        ]
    taken = {pick.column.name for pick in picks}
    free = [name for name in present if name not in taken]  # no other signal's column is meant
    for pick in missing:
        problems.append(
            f"{path}: missing column {pick.column.name!r}{did_you_mean(pick.column.name, free)}"
        )
    told = "other names are given under `log`"
    if any(pick.signal == "tau" for pick in missing):
        told += "; joints without a torque signal have `torque: none`"
    problems.append(f"{path}: columns present: {listing(present)}; {told}")
    return problems
