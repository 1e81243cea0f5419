# SPDX-License-Identifier: Apache-2.0
"""Writes an MCAP file of ROS 2 messages record by record: what has been flushed can be read.

The file has no chunks and no index, so that memory stays bounded and a file that is cut off ends
with its last whole record. Readers scan it.
"""

import struct
from collections.abc import Mapping
from pathlib import Path

from touchline.errors import InputError
from touchline.logs.mcap import FOOTER, MAGIC, METADATA, NAME

_HEADER, _SCHEMA, _CHANNEL, _MESSAGE, _DATA_END = 0x01, 0x03, 0x04, 0x05, 0x0F
_ENCODING, _SCHEMA_ENCODING = "cdr", "ros2msg"
# The publishers' quality of service, as rosbag2 keeps it: none is told.
_NO_QOS = {"offered_qos_profiles": ""}


class McapWriter:
    """A file that grows by messages.

    Args:
        path: of the file; an old one is replaced.
        metadata: kept in the file, see `touchline.logs.mcap.read_metadata`.

    Raises:
        InputError: nothing can be written there.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str]) -> None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("wb")
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from error
        self._schemas: dict[str, int] = {}
        self._channels = 0
        self._file.write(MAGIC)
        self._record(_HEADER, _text("ros2") + _text("touchline"))
        self._record(METADATA, _text(NAME) + _map(metadata))

    def _record(self, code: int, content: bytes) -> None:
        self._file.write(struct.pack("<BQ", code, len(content)) + content)

    def add_channel(self, topic: str, kind: str, definition: str) -> int:
        """Announces a topic.

        Args:
            topic: its name.
            kind: type of its messages.
            definition: of that type and of all that it consists of.

        Returns:
            Number of the channel.
        """
        if kind not in self._schemas:
            number = self._schemas[kind] = len(self._schemas) + 1
            body = _text(kind) + _text(_SCHEMA_ENCODING) + _text(definition)
            self._record(_SCHEMA, struct.pack("<H", number) + body)
        self._channels += 1
        head = struct.pack("<HH", self._channels, self._schemas[kind])
        self._record(_CHANNEL, head + _text(topic) + _text(_ENCODING) + _map(_NO_QOS))
        return self._channels

    def write(self, channel: int, sequence: int, received: int, data: bytes) -> None:
        """Adds a message: its number at the source, when it came [ns], and its bytes."""
        at = max(received, 0)
        head = struct.pack("<HIQQ", channel, sequence & 0xFFFFFFFF, at, at)
        self._file.write(struct.pack("<BQ", _MESSAGE, len(head) + len(data)) + head + data)

    def flush(self) -> None:
        """Hands all that was written to the operating system: it survives this program."""
        self._file.flush()

    def close(self) -> None:
        """Ends the file."""
        self._record(_DATA_END, bytes(4))
        self._file.write(FOOTER)
        self._file.close()


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _map(entries: Mapping[str, str]) -> bytes:
    body = b"".join(_text(key) + _text(value) for key, value in entries.items())
    return struct.pack("<I", len(body)) + body
