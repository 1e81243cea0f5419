# SPDX-License-Identifier: Apache-2.0
"""Running robots: sources of samples, what is checked of them, and what is made of them."""

from touchline.live.adapters import from_franka, from_ur_rtde
from touchline.live.connection import Connection, Notice
from touchline.live.sample import Sample, Validity, make_sample
from touchline.live.source import EndOfSource, LinkLost, Source
from touchline.live.sources import connect
from touchline.live.streams import Stream, StreamState

__all__ = [
    "Connection",
    "EndOfSource",
    "LinkLost",
    "Notice",
    "Sample",
    "Source",
    "Stream",
    "StreamState",
    "Validity",
    "connect",
    "from_franka",
    "from_ur_rtde",
    "make_sample",
]
