# SPDX-License-Identifier: Apache-2.0
"""Makes an MCAP file readable that was cut off before its index and footer."""

import io
import struct
from pathlib import Path
from typing import Any

MAGIC = b"\x89MCAP0\r\n"
# A footer record that points at no summary: readers then scan the records.
FOOTER = b"\x02" + (20).to_bytes(8, "little") + bytes(20) + MAGIC
_DATA_END, _FOOTER_CODE = 0x0F, 0x02
METADATA, NAME = 0x0C, "touchline"  # the record that `McapWriter` puts in front of all messages
_LONGEST_METADATA = 1 << 20  # bytes


def whole_records(path: Path) -> int:
    """Length of the part of the file that consists of whole records [bytes]."""
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return 0
        at = len(MAGIC)
        while len(head := file.read(9)) == 9:
            end = at + 9 + int.from_bytes(head[1:], "little")
            if end > size or head[0] in (0, _DATA_END, _FOOTER_CODE):
                break
            at = end
            file.seek(at)
    return at


def read_metadata(path: Path) -> dict[str, str]:
    """What `McapWriter` was told to keep; empty for a file of another writer."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return {}
        for _ in range(2):  # the header, and what stands behind it
            head = file.read(9)
            if len(head) < 9 or (size := int.from_bytes(head[1:], "little")) > _LONGEST_METADATA:
                return {}
            content = file.read(size)
            if head[0] == METADATA:
                return _entries(content)
    return {}


def _entries(content: bytes) -> dict[str, str]:
    texts, at = [], 0
    try:
        while at < len(content):
            (size,) = struct.unpack_from("<I", content, at)
            at += 4
            if len(texts) == 1:  # behind the name: the size of all entries
                texts.append("")
                continue
            texts.append(content[at : at + size].decode())
            at += size
    except (struct.error, UnicodeDecodeError):
        return {}
    if not texts or texts[0] != NAME:
        return {}
    return dict(zip(texts[2::2], texts[3::2], strict=False))


class MendedMcap:
    """Stands in for the path of a cut-off file: its whole records and a footer."""

    def __init__(self, path: Path):
        self.path = path
        self.length = whole_records(path)

    def open(self, mode: str = "rb") -> io.BufferedReader:
        """A readable file; the one on disk is not touched."""
        return io.BufferedReader(_Mended(self.path, self.length))

    def __str__(self) -> str:
        return str(self.path)


class _Mended(io.RawIOBase):
    """The first `length` bytes of a file, followed by a footer."""

    def __init__(self, path: Path, length: int):
        super().__init__()
        self._file = path.open("rb")
        self._length = length
        self._at = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        base = (0, self._at, self._length + len(FOOTER))[whence]
        self._at = max(base + offset, 0)
        return self._at

    def readinto(self, buffer: Any, /) -> int:
        if self._at < self._length:
            self._file.seek(self._at)
            piece = self._file.read(min(len(buffer), self._length - self._at))
        else:
            start = self._at - self._length
            piece = FOOTER[start : start + len(buffer)]
        buffer[: len(piece)] = piece
        self._at += len(piece)
        return len(piece)

    def close(self) -> None:
        self._file.close()
        super().close()
