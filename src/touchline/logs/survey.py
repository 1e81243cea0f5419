# SPDX-License-Identifier: Apache-2.0
"""A look at the first messages of a rosbag2: periods, clocks, and what is missing."""

from pathlib import Path

import numpy as np

from touchline.errors import InputError
from touchline.logs.align import typical_period
from touchline.logs.bagfile import Bag
from touchline.logs.cdr import Decoder
from touchline.logs.messages import Messages
from touchline.model.description import RobotDescription
from touchline.suggest import did_you_mean, listing

_ENOUGH = 1000
_PATIENCE = 50_000
# Clocks that differ by more than this are not one clock with a slow network [s].
_CLOCK = 1.0


class Channel:
    """A topic, how to decode it and what its clock is like.

    Attributes:
        period: typical time between messages [s].
        unstamped: most headers carry no stamp, so the receive time stands in for it.
    """

    def __init__(self, topic: str, decoder: Decoder):
        self.topic = topic
        self.decoder = decoder
        self.period = float("nan")
        self.unstamped = False
        self.notes: list[str] = []

    def decode(self, messages: Messages) -> dict[str, np.ndarray]:
        """Fields of the messages, their `time` [s] and which are `complete`."""
        decoded = self.decoder.decode(messages)
        time = decoded.stamps
        if self.unstamped:
            time = np.where(time == 0.0, messages.received * 1e-9, time)
        return decoded.fields | {"time": time, "complete": decoded.complete}

    def warnings(self) -> list[str]:
        """What there is to say of this topic."""
        return self.notes + self.losses()

    def losses(self) -> list[str]:
        """What of it could not be read."""
        count = self.decoder.undecodable
        return [f"{self.topic}: {count} messages cannot be decoded"] if count else []

    def look(self, messages: Messages) -> dict[str, np.ndarray]:
        """Decode the first messages and learn clock and period from them."""
        stamps = self.decoder.decode(messages).stamps
        self.unstamped = bool(np.mean(stamps == 0.0) > 0.5) and bool(messages.received.any())
        if self.unstamped:
            self.notes.append(f"{self.topic}: headers without a stamp; the receive time is used")
        found = self.decode(messages)
        self.decoder.undecodable = 0
        self.period = typical_period(found["time"][found["complete"]])
        return found


class Survey:
    """The first messages of every topic that is read.

    Attributes:
        joint_states: fields of the first joint states that name every joint.
        without_velocity: indices of the joints without velocities there.
    """

    def __init__(self, bag: Bag, joints: Channel, wrenches: list[Channel]):
        channels = {channel.topic: channel for channel in (joints, *wrenches)}
        parts: list[Messages] = []
        counts, number = np.zeros(len(channels), int), 0
        for part in bag.messages(list(channels)):
            ranks = _ranks(part.topic, counts)
            parts.append(part[ranks < _ENOUGH].compact())
            counts += np.bincount(part.topic, minlength=len(counts))
            number += len(part)
            if (counts >= _ENOUGH).all() or number > _PATIENCE:
                break
        head = Messages.joined(parts) if parts else Messages.of([], [], [])
        first = {topic: head[head.topic == n] for n, topic in enumerate(channels)}
        self._joints, self._bag = joints, bag
        looks = {t: c.look(first[t]) for t, c in channels.items() if len(first[t])}
        empty = {"time": np.empty(0), "complete": np.empty(0, dtype=bool)}
        found = looks.get(joints.topic, empty)
        complete = found["complete"]
        self.joint_states = {name: values[complete] for name, values in found.items()}
        self.without_velocity: tuple[int, ...] = ()
        if len(self.joint_states["time"]):
            lacking = np.all(np.isnan(self.joint_states["velocity"]), axis=0)
            self.without_velocity = tuple(np.flatnonzero(lacking).tolist())
        self._compare_clocks(wrenches, looks, first)
        for channel in wrenches:
            if not bag.counts[channel.topic]:
                channel.notes.append(f"{channel.topic}: no messages; its wrench is not measured")
            if not np.isfinite(channel.period):
                channel.period = bag.duration / max(bag.counts[channel.topic], 1)

    def _compare_clocks(
        self,
        wrenches: list[Channel],
        looks: dict[str, dict[str, np.ndarray]],
        first: dict[str, Messages],
    ) -> None:
        """Stamps of two topics should be equally far from their receive times."""

        def lag(topic: str) -> float:
            with np.errstate(invalid="ignore"):
                lags = looks[topic]["time"] - first[topic].received * 1e-9
            return float(np.median(lags[np.isfinite(lags)])) if len(lags) else 0.0

        if self._joints.topic not in looks:
            return
        for channel in (c for c in wrenches if c.topic in looks):
            offset = lag(channel.topic) - lag(self._joints.topic)
            if abs(offset) > _CLOCK:
                channel.notes.append(
                    f"{channel.topic}: its clock is {offset:+.3f} s from that of "
                    f"{self._joints.topic}; wrenches that match no joint state are left out"
                )

    def check(self, path: Path, description: RobotDescription) -> None:
        """Make sure the joint states can be used.

        Raises:
            InputError: joints, positions, efforts, or all messages of a topic are missing.
        """
        topic, decoder = self._joints.topic, self._joints.decoder
        states = self.joint_states
        if not len(states["time"]) and not decoder.seen and self._bag.warnings:
            problems = [*self._bag.warnings, f"{path}: no message of {topic} can be read"]
        elif not self._bag.counts[topic]:
            problems = [f"{path}: topic {topic} holds no messages"]
        elif not len(states["time"]):
            problems = _missing_joints(path, topic, decoder)
        else:
            problems = _missing_values(path, topic, description, states)
        if problems:
            raise InputError(problems)


def _ranks(topic: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(M,) how many messages of its own topic came before each."""
    ranks = np.zeros(len(topic), int)
    for number, count in enumerate(before):
        own = topic == number
        ranks[own] = count + np.arange(own.sum())
    return ranks


def _missing_joints(path: Path, topic: str, decoder: Decoder) -> list[str]:
    seen = list(decoder.seen)
    missing = [name for name in decoder.joints if name not in seen]
    problems = [
        f"{path}: {topic} has no joint {name!r}{did_you_mean(name, seen)}" for name in missing
    ]
    if not missing:
        problems.append(f"{path}: no message of {topic} holds all of {listing(decoder.joints)}")
    names = f"{path}: joints of {topic}: {listing(seen)}; other names go under `log: joint_names`"
    return [*problems, names]


def _missing_values(
    path: Path, topic: str, description: RobotDescription, states: dict[str, np.ndarray]
) -> list[str]:
    problems = []
    measured = [j for j, joint in enumerate(description.joints) if joint.measured]
    if np.all(np.isnan(states["position"])):
        problems.append(f"{path}: the messages of {topic} carry no positions")
    if measured and np.all(np.isnan(states["effort"][:, measured])):
        problems.append(
            f"{path}: no joint torques: the messages of {topic} carry no efforts; give joints "
            "without a torque signal `torque: none`"
        )
    return problems
