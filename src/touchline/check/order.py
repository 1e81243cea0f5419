# SPDX-License-Identifier: Apache-2.0
"""Joints whose columns stand in another order, told by what the model then leaves.

Two joints that are swapped, a rotation, the reverse and the alphabet are all permutations. Torques
may be permuted by themselves, or together with positions and velocities, or stay where they are.
Orders that leave nearly the same are not told from each other: what they differ in is not named.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
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
KEPT = 5  # orders that are changed further in every round of the search
NEAR = 40  # orders, the best first, that may turn out to be as good as the best
LEAST = 12  # windows, 3 s; fewer tell nothing of how sure an order is
SURE = 4.0  # standard errors by which an order is better: more than any of a thousand by chance
WORST = 2.0  # of a row's size; what is touched or lost is farther off, and counts as much
UNREAD = 0.5  # misfit of a row whose torque no column holds: as good as half wrong
SIGNALS = {
    "all": ("positions, velocities and torques", "q, qd and tau"),
    "motion": ("positions and velocities", "q and qd"),
    "torque": ("torques", "tau"),
}
ALPHABET, REVERSED = "alphabetical order of the joints' names", "reversed order"
LIKELY = ALPHABET, REVERSED  # so usual that they are believed where other orders fit as well
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
        other: keys of `SIGNALS` that may stand in some other order instead, as far as is told.
    """

    signals: str
    order: Permutation
    left: float
    now: float
    sure: float
    untold: tuple[int, ...]
    known: str
    other: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Can the order be written down, with joints that are not told left as described?"""
        left = all(self.order[j] == j for j in self.untold)
        return not self.other and (bool(self.known) or left)

    @property
    def swap(self) -> bool:
        """Are all other columns as described?"""
        return sum(column != j for j, column in enumerate(self.order)) == 2

    def words(self, names: tuple[str, ...]) -> str:
        """The finding, which ends in `mend_words`."""
        what = SIGNALS[self.signals][0]
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
            if self.swap:
                start += "; that these two are swapped would explain all"
        told = f"{100 * self.left / self.now:.0f} % of what is off is left then"
        told += f", and any order that says otherwise is worse by {self.sure:.0f} standard errors"
        if self.untold:
            doubt = " and ".join(names[j] for j in self.untold)
            told += f"; the data do not tell which columns are those of {doubt}"
        if self.other:
            told += f"; as well it may be {' or '.join(SIGNALS[x][0] for x in self.other)}"
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


def joint_orders(robot: Robot, windows: Windows, measured: list[int]) -> dict[str, JointOrder]:
    """By key of `SIGNALS`: the order of columns that fits clearly better than the described one.

    Where the data do not tell what is in another order, only the likelier is there, which says so.
    Torques may be motors' currents that nobody has described: friction hides their order then. So
    they are judged as described and as currents, and what leaves fewer joints untold counts.
    """
    moved: dict[Permutation, Windows] = {}
    ways = [_orders_told(robot, windows, measured, moved, currents) for currents in (False, True)]
    return min(
        ways, key=lambda way: min((len(order.untold) for order in way.values()), default=np.inf)
    )


def _orders_told(
    robot: Robot,
    windows: Windows,
    measured: list[int],
    moved: dict[Permutation, Windows],
    currents: bool,
) -> dict[str, JointOrder]:
    """The same, judged one way; `moved` keeps what is expected in each order."""
    found: dict[str, JointOrder] = {}
    least: dict[str, float] = {}
    for signals in SIGNALS:
        judge = _Judge(robot, windows, measured, signals, moved, currents)
        if not judge.enough or (signals != "motion" and len(measured) < 2):
            continue
        known = known_orders(robot.joint_names)
        orders = judge.found(known)
        least[signals] = min(orders.values())
        order = _told(judge, orders, known)
        if order is not None:
            found[signals] = order
    for signals, order in list(found.items()):
        others = [x for x in least if x != signals and not mends(least[signals], least[x])]
        if any(mends(least[x], least[signals]) for x in others):
            del found[signals]
        else:
            found[signals] = replace(order, other=tuple(others))
    return found


def known_orders(names: tuple[str, ...]) -> dict[Permutation, str]:
    """Orders of joints that have a name, the likelier ones first."""
    n = len(names)
    orders = {
        ALPHABET: np.argsort(np.argsort(names)),
        REVERSED: np.arange(n)[::-1],
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
    untold = [j for j in own if len({x[j] for x in alike}) > 1]
    moved = {order: sum(a != b for a, b in enumerate(order)) for order in alike}
    # Of drivers the alphabet and the reverse are known: they are likelier than what else fits.
    named = [x for x in known if x in alike and (not untold or known[x] in LIKELY)]
    order = named[0] if named else min(alike, key=lambda x: (moved[x], found[x]))
    if all(order[j] == j or j in untold for j in own):
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

    def __init__(
        self,
        robot: Robot,
        windows: Windows,
        measured: list[int],
        signals: str,
        moved: dict[Permutation, Windows],
        currents: bool,
    ) -> None:
        self.signals, self.count = signals, len(robot.joint_names)
        self._robot, self._measured = robot, measured
        self._windows = windows.part(slice(None, None, max(1, -(-len(windows) // MOST))))
        self._currents = currents
        self._off: dict[Permutation, Array] = {}
        self._moved = moved  # by order, with all signals in it: what is expected takes time
        self.enough = len(self._windows) >= LEAST
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
        """By how many standard errors one order leaves less than another.

        Noise is what differs between windows that follow each other: how much an order matters
        depends on the motion.
        """
        off = [np.minimum(self._off[order], WORST) for order in (one, other)]
        more = np.nansum(off[1] - off[0], axis=1)
        error = float(np.sqrt(np.mean(np.diff(more) ** 2) / 2.0 / len(more)))
        total = float(np.mean(more)) + self._outside(other) - self._outside(one)
        return total / max(error, 1e-9)

    def _try(self, orders: set[Permutation], found: dict[Permutation, float]) -> None:
        for order in sorted(orders - found.keys()):
            self._off[order] = departures(
                self._robot, self._ordered(order), self._measured, TELLING, self._currents
            )
            found[order] = self._left(self._off[order]) + self._outside(order)

    def _ordered(self, order: Permutation) -> Windows:
        own = np.arange(self.count)
        if self.signals == "torque":
            return self._windows.ordered(self._robot, own, np.array(order))
        if order not in self._moved:
            both = np.array(order)
            self._moved[order] = self._windows.ordered(self._robot, both, both)
        moved = self._moved[order]
        return (
            moved if self.signals == "all" else moved.ordered(self._robot, own, np.argsort(order))
        )

    def _left(self, off: Array) -> float:
        rows = middle(off)
        torques, sensors = np.split(rows, [len(self._measured)])
        return float(np.where(np.isnan(torques), UNREAD, torques).sum() + np.nansum(sensors))

    def _outside(self, order: Permutation) -> float:
        """Joints beyond their limits; each counts as a torque that fits nothing."""
        own = range(self.count) if self.signals == "torque" else order
        q = self._windows.q[:, list(own)]
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
