# SPDX-License-Identifier: Apache-2.0
"""Reads a rosbag2: one row per joint state, every sensor's wrench interpolated to it."""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from touchline.logs.align import REACH_PERIODS, find_bracket
from touchline.logs.bagfile import Bag
from touchline.logs.blocks import Block, Window, take, windows
from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED, Decoder
from touchline.logs.mcap import read_metadata
from touchline.logs.messages import Messages
from touchline.logs.naming import Naming
from touchline.logs.source import HEAD_ROWS
from touchline.logs.survey import Channel, Survey
from touchline.logs.topics import choose_topics
from touchline.model.description import AXES, RobotDescription

_BATCH = 8192  # rows
_TOGETHER = 4096  # messages that are decoded at a time, at least
# A wrench and the joint state it belongs to are received within this time of each other [s].
_SKEW = 2.0
_SIGNALS = {"q": "position", "qd": "velocity", "tau": "effort"}


class RosbagSource:
    """A rosbag2 as a log."""

    def __init__(self, path: Path, description: RobotDescription, naming: Naming):
        """Open the recording, choose its topics and look at its first messages.

        Raises:
            InputError: it cannot be read, or topics, joints, positions or efforts are missing.
        """
        self._bag = Bag(path)
        try:
            self._prepare(path, description, naming)
        except BaseException:
            self._bag.close()
            raise

    def _prepare(self, path: Path, description: RobotDescription, naming: Naming) -> None:
        bag = self._bag
        joint_topic, wrench_topics = choose_topics(bag.topics, description, naming, str(path))
        self.path, self.topics, self.duration = path, bag.topics, bag.duration
        self.columns: tuple[str, ...] = ()
        self.metadata: dict[str, Any] = _metadata(path)
        self.rows, self.delayed_wrenches = None, False
        self._joints = Channel(joint_topic, Decoder(JOINT_STATE, naming.joint_names))
        self._wrenches = [
            Channel(wrench_topics[s.name], Decoder(WRENCH_STAMPED)) for s in description.sensors
        ]
        self._delays = [sensor.delay for sensor in description.sensors]
        self._factors = {
            signal: np.array([column.factor for column in naming.joints[signal]])
            for signal in _SIGNALS
        }
        self._axis_factors = _axis_factors(description, naming)
        self._unused = [j for j, x in enumerate(description.joints) if not x.measured]
        survey = Survey(bag, self._joints, self._wrenches)
        survey.check(path, description)
        self.without_velocity = survey.without_velocity
        self._head = take(self._rows_of(survey.joint_states), 0, HEAD_ROWS)
        self._halo = _halo(self._joints.period, self._delays)

    @property
    def warnings(self) -> list[str]:
        """What the user should know; grows while reading."""
        found = [w for channel in (self._joints, *self._wrenches) for w in channel.warnings()]
        return self._bag.warnings + [f"{self.path}: {warning}" for warning in found]

    @property
    def losses(self) -> list[str]:
        """What could not be read."""
        bad = [w for channel in (self._joints, *self._wrenches) for w in channel.losses()]
        return self._bag.losses + [f"{self.path}: {loss}" for loss in bad]

    def head(self) -> Block:
        """The first rows, without wrenches."""
        return self._head

    def _rows_of(self, decoded: dict[str, np.ndarray]) -> Block:
        """Joint signals in SI units."""
        rows = {"time": decoded["time"]}
        for signal, field in _SIGNALS.items():
            rows[signal] = decoded[field] * self._factors[signal]
        rows["tau"][:, self._unused] = np.nan
        return rows

    def blocks(self) -> Iterator[Block]:
        """All rows, in the order in which their messages were received."""
        stores = [_Store() for _ in self._wrenches]
        for window in windows(self._joint_blocks(stores), _BATCH, self._halo):
            rows = slice(window.start, window.stop)
            block = {name: window.padded[name][rows] for name in ("time", "q", "qd", "tau")}
            wrench = np.full((window.stop - window.start, len(stores), 6), np.nan)
            for k in range(len(stores)):
                wrench[:, k] = self._wrench(k, stores[k], window) * self._axis_factors[k]
            yield block | {"wrench": wrench}

    def _joint_blocks(self, stores: list["_Store"]) -> Iterator[Block]:
        """Joint states with `seen`, the number of wrenches of each sensor received before.

        The wrenches themselves go into `stores`.
        """
        counts = np.zeros(len(stores), np.intp)
        held: list[Messages] = []
        waiting = 0
        topics = [channel.topic for channel in (self._joints, *self._wrenches)]
        for part in self._bag.messages(topics):
            held.append(part)
            waiting += len(part)
            if waiting >= _TOGETHER:
                yield self._decoded(Messages.joined(held), counts, stores)
                held, waiting = [], 0
        if held:
            yield self._decoded(Messages.joined(held), counts, stores)

    def _decoded(self, messages: Messages, counts: np.ndarray, stores: list["_Store"]) -> Block:
        """Rows of some messages; `counts` of wrenches received go on from the messages before."""
        is_state = messages.topic == 0
        seen = np.empty((int(is_state.sum()), len(stores)), np.intp)
        for k, (channel, store) in enumerate(zip(self._wrenches, stores, strict=True)):
            own = messages.topic == k + 1
            seen[:, k] = counts[k] + np.cumsum(own)[is_state]
            counts[k] += own.sum()
            decoded = channel.decode(messages[own])
            store.append(decoded["time"], decoded["wrench"])
        decoded = self._joints.decode(messages[is_state])
        rows = self._rows_of(decoded) | {"seen": seen}
        complete = decoded["complete"]
        return {name: values[complete] for name, values in rows.items()}

    def _wrench(self, k: int, store: "_Store", window: Window) -> np.ndarray:
        """(rows, 6) of sensor k at the rows' instants, from the messages received around them."""
        seen = window.padded["seen"][:, k]
        own = np.arange(window.start, window.stop)
        early, late = own - self._halo, own + self._halo
        low = np.where(early >= 0, seen[np.maximum(early, 0)], 0)
        high = np.where(late < len(seen), seen[np.minimum(late, len(seen) - 1)], store.end)
        instants = window.padded["time"][own] + self._delays[k]
        first, stamps, values = store.view()
        bracket = find_bracket(
            stamps,
            instants,
            seen[own] - first,
            low - first,
            high - first,
            REACH_PERIODS * self._wrenches[k].period,
        )
        if window.stop >= self._halo:
            store.drop(int(seen[window.stop - self._halo]))
        return bracket.interpolate(values) if len(values) else np.full((len(own), 6), np.nan)

    def progress(self) -> float:
        """Fraction of the files read."""
        return self._bag.progress

    def close(self) -> None:
        """Release the files."""
        self._bag.close()


class _Store:
    """The wrenches of one sensor that rows may still need, numbered from the log's first."""

    def __init__(self) -> None:
        self._first = 0
        self._stamps = [np.empty(0)]
        self._values = [np.empty((0, 6))]
        self.end = 0

    def append(self, stamps: np.ndarray, values: np.ndarray) -> None:
        self._stamps.append(stamps)
        self._values.append(values)
        self.end += len(stamps)

    def view(self) -> tuple[int, np.ndarray, np.ndarray]:
        """Number of the first wrench, stamps and values."""
        self._stamps = [np.concatenate(self._stamps)]
        self._values = [np.concatenate(self._values)]
        return self._first, self._stamps[0], self._values[0]

    def drop(self, before: int) -> None:
        """Forget the wrenches before that number."""
        _, stamps, values = self.view()
        cut = max(before - self._first, 0)
        self._stamps, self._values = [stamps[cut:]], [values[cut:]]
        self._first += cut


def _metadata(path: Path) -> dict[str, Any]:
    """What a recorder of running robots has left in an MCAP file."""
    if not path.is_file() or path.suffix != ".mcap":
        return {}
    found: dict[str, Any] = {}
    for key, value in read_metadata(path).items():
        with suppress(ValueError):  # damaged
            found[key] = json.loads(value)
    return found


def _axis_factors(description: RobotDescription, naming: Naming) -> np.ndarray:
    """(k, 6) unit factors, NaN for the axes a sensor lacks."""
    factors = np.full((len(description.sensors), 6), np.nan)
    for k, sensor in enumerate(description.sensors):
        for axis, column in naming.sensors[sensor.name].items():
            factors[k, AXES.index(axis)] = column.factor
    return factors


def _halo(period: float, delays: list[float]) -> int:
    """Joint states on either side between which a row's wrenches are received."""
    if not np.isfinite(period):
        return 16
    longest = max((abs(delay) for delay in delays), default=0.0)
    return int(np.clip((_SKEW + longest) / period, 16, 50_000))
