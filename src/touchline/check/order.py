# SPDX-License-Identifier: Apache-2.0
"""Joints whose columns stand in another order, told by what the model then leaves.

Two joints that are swapped, a rotation, the reverse and the alphabet are all permutations. Torques
may be permuted by themselves, or together with positions and velocities, or stay where they are.
Orders that leave nearly the same are not told from each other: what they differ in is not named.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from touchline.arrays import Array, Index
from touchline.check.joints import TELLING
from touchline.check.misfit import departures, mends, middle
from touchline.check.signals import OUTSIDE
from touchline.check.windows import Windows
from touchline.logs.naming import parse_naming
from touchline.model.description import RobotDescription
from touchline.model.robot import Robot

MOST = 64  # windows, spread over the recording, that orders are judged by: 16 s tell an order
KEPT = 8  # orders that are changed further in every round of the search
NEAR = 40  # orders, the best first, that may turn out to be as good as the best
BLOCKS, LEAST = 8, 3  # of time, each judged by itself; fewer tell nothing of how sure an order is
SURE = 3.0  # standard errors of eight blocks: by chance one order in a hundred is so much better
UNREAD = 0.5  # misfit of a row whose torque no column holds: as good as half wrong
SIGNALS = {
    "all": ("positions, velocities and torques", "q, qd and tau"),
    "motion": ("positions and velocities", "q and qd"),
    "torque": ("torques", "tau"),
}
Permutation = tuple[int, ...]
"""For each joint the number of the joint in whose column its values stand."""


@dataclass(frozen=True)
class JointOrder:
    """An order of columns that fits the model better than the described one.

    Attributes:
        signals: key of `SIGNALS`: what stands in that order.
        order: (n,) for each joint the number of the joint in whose column its values stand.
        left, now: misfit in that order and as described, summed over rows.
        sure: by how many standard errors it is better than any order that is told from it.
        untold: joints of which other orders that are as good say something else.
        known: what the order is called; "" of one without a name.
    """

    signals: str
    order: Permutation
    left: float
    now: float
    sure: float
    untold: tuple[int, ...]
    known: str

    @property
    def complete(self) -> bool:
        """Can the whole order be written down without guessing?"""
        return bool(self.known) or self._swap or all(self.order[j] == j for j in self.untold)

    @property
    def _swap(self) -> bool:
        """Are all other columns as described?"""
        return sum(column != j for j, column in enumerate(self.order)) == 2

    def words(self, names: tuple[str, ...]) -> str:
        """The finding, which ends in what `log_line` is put for."""
        what, keys = SIGNALS[self.signals]
        own = range(len(names))
        moved = [j for j in own if self.order[j] != j and (self.known or j not in self.untold)]
        if self.known:
            start = f"{what} of all joints seem to be in {self.known}"
        elif len(moved) == 2 and [self.order[j] for j in moved] == moved[::-1]:
            a, b = sorted(names[j] for j in moved)
            start = f"{what} of {a} and {b} seem swapped"
        else:
            pairs = ", ".join(f"{names[j]} in that of {names[self.order[j]]}" for j in moved)
            start = f"{what} seem to stand in another joint's column: {pairs}"
            if self._swap:
                start += "; that these two are swapped would explain it"
        told = f"{100 * self.left / self.now:.0f} % of what is off is left then"
        told += f", and any other order is worse by {self.sure:.0f} standard errors or more"
        if self.untold:
            doubt = " and ".join(names[j] for j in self.untold)
            told += f"; the data do not tell which columns are those of {doubt}"
        return f"{start} ({told}): {mend_words(self.signals)}"


def mend_words(signals: str) -> str:
    """What is to be done, where the log's own columns are not looked up."""
    return f"mend log: {SIGNALS[signals][1]}"


def log_keys(
    description: RobotDescription, joints: Index, torques: Index, bag: bool
) -> dict[str, Any]:
    """Keys of `log` that take each joint's signals from the columns they stand in.

    Args:
        description: says where they were looked for.
        joints: (n,) number of the joint in whose columns each position and velocity stands.
        torques: (n,) the same, of the torques.
        bag: is the log a rosbag2, whose messages name the joints?

    Returns:
        Empty where no key can say it: in a message torques have the order of its names.
    """
    naming = parse_naming(description)
    names = [joint.name for joint in description.joints]
    if bag:
        factors = {column.factor for columns in naming.joints.values() for column in columns}
        if not np.array_equal(joints, torques) or len(factors) > 1:
            return {}
        moved = {name: naming.joint_names[k] for name, k in zip(names, joints, strict=True)}
        return {"joint_names": moved}
    keys: dict[str, Any] = {}
    for signal, order in (("q", joints), ("qd", joints), ("tau", torques)):
        if np.array_equal(order, np.arange(len(names))):
            continue
        columns = [naming.joints[signal][k] for k in order]
        keys[signal] = [
            column.name
            if column.factor == 1.0
            else {"column": column.name, "factor": column.factor}
            for column in columns
        ]
    return keys


def joint_order(
    robot: Robot, windows: Windows, measured: list[int], signals: str
) -> JointOrder | None:
    """The order of columns that fits clearly better than the described one; None if none does."""
    judge = _Judge(robot, windows, measured, signals)
    if judge.blocks < LEAST or (signals != "motion" and len(measured) < 2):
        return None
    known = known_orders(robot.joint_names)
    found = judge.found(known)
    return _told(judge, found, known)


def known_orders(names: tuple[str, ...]) -> dict[Permutation, str]:
    """Orders of joints that have a name, the likelier ones first."""
    n = len(names)
    orders = {
        "alphabetical order of the joints' names": np.argsort(np.argsort(names)),
        "reversed order": np.arange(n)[::-1],
    }
    for by in range(1, n):
        orders[f"an order rotated by {by}"] = np.roll(np.arange(n), by)
    found: dict[Permutation, str] = {}
    for name, order in orders.items():
        found.setdefault(tuple(order.tolist()), name)
    found.pop(tuple(range(n)), None)
    return found


def _told(
    judge: "_Judge", found: dict[Permutation, float], known: dict[Permutation, str]
) -> JointOrder | None:
    own = tuple(range(judge.count))
    best = min(found, key=found.__getitem__)
    if not mends(found[best], found[own]):
        return None
    ranked = sorted(found, key=found.__getitem__)[1:NEAR]
    alike, sure = [best], np.inf
    for other in dict.fromkeys([*ranked, own]):
        by = judge.better(best, other)
        if other != own and (not mends(found[best], found[other]) or by < SURE):
            alike.append(other)
        else:
            sure = min(sure, by)
    if sure < SURE:  # than the described order
        return None
    named = [order for order in known if order in alike]
    moved = {order: sum(a != b for a, b in enumerate(order)) for order in alike}
    order = named[0] if named else min(alike, key=lambda x: (moved[x], found[x]))
    untold = [j for j in own if len({x[j] for x in alike}) > 1]
    if not named and all(order[j] == j or j in untold for j in own):
        return None
    return JointOrder(
        judge.signals,
        order,
        found[order],
        found[own],
        sure,
        tuple(untold),
        known.get(order, ""),
    )


class _Judge:
    """What the model leaves of a recording whose columns are taken in some order."""

    def __init__(self, robot: Robot, windows: Windows, measured: list[int], signals: str) -> None:
        self.signals, self.count = signals, len(robot.joint_names)
        self._robot, self._measured = robot, measured
        self._windows = windows.part(slice(None, None, max(1, -(-len(windows) // MOST))))
        self._off: dict[Permutation, Array] = {}
        self.blocks = min(BLOCKS, len(self._windows) // 4)
        joints = [robot.mechanism.joints[name] for name in robot.joint_names]
        self._lower = np.array([joint.lower for joint in joints]) - OUTSIDE
        self._upper = np.array([joint.upper for joint in joints]) + OUTSIDE

    def found(self, known: dict[Permutation, str]) -> dict[Permutation, float]:
        """Misfit of the orders that are worth a look, the described and the best among them."""
        own = tuple(range(self.count))
        allowed = self._measured if self.signals == "torque" else own
        found: dict[Permutation, float] = {}
        start = {own, *known}
        if self.signals == "torque":
            start = {order for order in start if self._stays(order)} | {self._assigned()}
        self._try(start, found)
        while True:
            kept = sorted(found, key=found.__getitem__)[:KEPT]
            self._try({new for order in kept for new in _swapped(order, allowed)}, found)
            if sorted(found, key=found.__getitem__)[:KEPT] == kept:
                return found

    def better(self, one: Permutation, other: Permutation) -> float:
        """By how many standard errors over blocks of time one order leaves less than another."""
        blocks = [np.array_split(self._off[order], self.blocks) for order in (one, other)]
        more = np.array([self._left(b) - self._left(a) for a, b in zip(*blocks, strict=True)])
        more += self._outside(other) - self._outside(one)
        error = float(np.std(more, ddof=1)) / np.sqrt(len(more))
        return float(np.mean(more)) / max(error, 1e-9)

    def _try(self, orders: set[Permutation], found: dict[Permutation, float]) -> None:
        for order in sorted(orders - found.keys()):
            self._off[order] = departures(
                self._robot, self._ordered(order), self._measured, TELLING
            )
            found[order] = self._left(self._off[order]) + self._outside(order)

    def _ordered(self, order: Permutation) -> Windows:
        own, other = np.arange(self.count), np.array(order)
        joints = own if self.signals == "torque" else other
        torques = own if self.signals == "motion" else other
        return self._windows.ordered(self._robot, joints, torques)

    def _left(self, off: Array) -> float:
        rows = middle(off)
        torques, sensors = np.split(rows, [len(self._measured)])
        return float(np.where(np.isnan(torques), UNREAD, torques).sum() + np.nansum(sensors))

    def _outside(self, order: Permutation) -> float:
        """Joints beyond their limits; each counts as a torque that fits nothing."""
        if self.signals == "torque":
            return 0.0
        q = self._windows.q[:, list(order)]
        out = (q.min(axis=0) < self._lower) | (q.max(axis=0) > self._upper)
        return float(out.sum())

    def _stays(self, order: Permutation) -> bool:
        """Do the torques stay within the columns that are measured?"""
        return all((j in self._measured) == (order[j] in self._measured) for j in range(self.count))

    def _assigned(self) -> Permutation:
        """Every joint takes the torque that fits it best, and none is taken twice."""
        size = len(self._measured)
        cost = np.full((size, size), UNREAD)
        for shift in range(size):
            order = list(range(self.count))
            columns = np.roll(np.arange(size), shift)
            for i, column in enumerate(columns):
                order[self._measured[i]] = self._measured[column]
            windows = self._ordered(tuple(order))
            off = middle(departures(self._robot, windows, self._measured, TELLING))[:size]
            cost[np.arange(size), columns] = np.where(np.isnan(off), UNREAD, off)
        order = list(range(self.count))
        for i, column in enumerate(linear_sum_assignment(cost)[1]):
            order[self._measured[i]] = self._measured[column]
        return tuple(order)


def _swapped(order: Permutation, allowed: Iterable[int]) -> Iterator[Permutation]:
    """All orders that differ by a swap of two joints."""
    for a, b in combinations(allowed, 2):
        new = list(order)
        new[a], new[b] = new[b], new[a]
        yield tuple(new)
