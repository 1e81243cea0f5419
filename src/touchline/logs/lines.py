# SPDX-License-Identifier: Apache-2.0
"""A byte stream that ends at the last whole line, also where a compressed file was cut off."""

import gzip
import io
import zlib
from pathlib import Path
from typing import Any, BinaryIO

_PIECE = 1 << 20


class WholeLines(io.RawIOBase):
    """The bytes of a text file, decompressed, without a line that was cut off.

    Attributes:
        damage: why the file ended early, or None.
        partial: True when a cut-off last line was dropped.
        fraction: of the file's bytes that have been taken in, 0 to 1.
    """

    def __init__(self, path: Path, delimiter: bytes = b",", fields: int = 0):
        """Open the file; `fields` is the number of fields of a whole line, 0 if unknown."""
        super().__init__()
        self._raw: BinaryIO = path.open("rb")
        self.size = path.stat().st_size
        zipped = self._raw.read(2) == b"\x1f\x8b"
        self._raw.seek(0)
        self._text = gzip.GzipFile(fileobj=self._raw) if zipped else self._raw
        self._delimiter, self._fields = delimiter, fields
        self._pending, self._ended = b"", False
        self.damage: str | None = None
        self.partial = False
        self.fraction = 0.0

    def readable(self) -> bool:
        """Always."""
        return True

    def read(self, size: int = -1, /) -> bytes:
        """At most `size` bytes that end at the end of a line, unless a line is longer."""
        wanted = _PIECE if size is None or size < 0 else size
        self._fill(wanted)
        head = self._pending[:wanted]
        cut = head.rfind(b"\n") + 1 or len(head)
        result, self._pending = head[:cut], self._pending[cut:]
        return result

    def readinto(self, buffer: Any, /) -> int:
        """As `read`, into a buffer."""
        piece = self.read(len(buffer))
        buffer[: len(piece)] = piece
        return len(piece)

    def _fill(self, wanted: int) -> None:
        """Bring the pending bytes to the wanted number, or to the end of the file."""
        pieces, held = [self._pending], len(self._pending)
        while held < wanted and not self._ended:
            try:
                piece = self._text.read1(_PIECE)  # pyright: ignore[reportAttributeAccessIssue]
            except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                self.damage, piece = str(error), b""
            self._ended = not piece
            self.fraction = self._raw.tell() / self.size if self.size else 1.0
            pieces.append(piece)
            held += len(piece)
        if len(pieces) > 1:
            self._pending = b"".join(pieces)
            if self._ended:
                self._judge_last_line()

    def _judge_last_line(self) -> None:
        """Keep an unterminated last line only where it may be whole."""
        start = self._pending.rfind(b"\n") + 1
        last = self._pending[start:]
        whole = self.damage is None and last.count(self._delimiter) + 1 >= self._fields
        if last.strip() and not whole:
            self._pending = self._pending[:start]
            self.partial = True

    def close(self) -> None:
        """Close the file."""
        self._text.close()
        self._raw.close()
        super().close()
