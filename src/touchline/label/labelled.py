# SPDX-License-Identifier: Apache-2.0
"""What a data set was labelled with, counted."""

from dataclasses import dataclass

import numpy as np

from touchline.label.channel import Channel


@dataclass
class Labelled:
    """Counts of a labelled data set.

    Attributes:
        rate: samples per second.
        episodes: how many.
        samples: how many.
        seconds: of all episodes.
        touched: samples in contact.
        touches: how often a contact begins.
    """

    rate: float
    episodes: int = 0
    samples: int = 0
    seconds: float = 0.0
    touched: int = 0
    touches: int = 0

    def add(self, channel: Channel, seconds: float) -> None:
        """Take an episode."""
        self.episodes += 1
        self.samples += len(channel.contact)
        self.seconds += seconds
        self.touched += int(channel.contact.sum())
        self.touches += int((np.diff(channel.contact.astype(int), prepend=0) > 0).sum())

    def __iadd__(self, other: "Labelled") -> "Labelled":
        self.episodes += other.episodes
        self.samples += other.samples
        self.seconds += other.seconds
        self.touched += other.touched
        self.touches += other.touches
        return self
