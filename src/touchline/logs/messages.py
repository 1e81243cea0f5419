# SPDX-License-Identifier: Apache-2.0
"""Serialized messages, many at a time: where each stands in a buffer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True)
class Messages:
    """M messages, in the order in which they were received.

    Attributes:
        buffer: holds them all.
        topic: (M,) number of the topic of each.
        received: (M,) [ns].
        start: (M,) where each begins in the buffer.
        size: (M,) its length [bytes].
    """

    buffer: bytes
    topic: np.ndarray
    received: np.ndarray
    start: np.ndarray
    size: np.ndarray

    @classmethod
    def of(cls, data: Sequence[bytes], topic: Sequence[int], received: Sequence[int]) -> Self:
        """From messages one by one."""
        count = len(data)
        size = np.fromiter(map(len, data), np.int64, count)
        topics = np.fromiter(topic, np.int64, count)
        stamps = np.fromiter(received, np.int64, count)
        return cls(b"".join(data), topics, stamps, np.cumsum(size) - size, size)

    def __len__(self) -> int:
        return len(self.topic)

    def __getitem__(self, rows: np.ndarray | slice) -> "Messages":
        """Some of them, in the same buffer."""
        picked = (self.topic[rows], self.received[rows], self.start[rows], self.size[rows])
        return Messages(self.buffer, *picked)

    def compact(self) -> "Messages":
        """The same with a buffer that holds nothing else."""
        spans = zip(self.start.tolist(), (self.start + self.size).tolist(), strict=True)
        data = [self.buffer[start:end] for start, end in spans]
        return Messages.of(data, self.topic.tolist(), self.received.tolist())

    @staticmethod
    def joined(parts: "Sequence[Messages]") -> "Messages":
        """All messages of several, one after another."""
        if len(parts) == 1:
            return parts[0]
        ends = np.cumsum([len(part.buffer) for part in parts])
        starts = [p.start + end - len(p.buffer) for p, end in zip(parts, ends, strict=True)]
        return Messages(
            b"".join(part.buffer for part in parts),
            np.concatenate([part.topic for part in parts]),
            np.concatenate([part.received for part in parts]),
            np.concatenate(starts),
            np.concatenate([part.size for part in parts]),
        )
