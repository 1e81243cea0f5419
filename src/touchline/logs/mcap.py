# SPDX-License-Identifier: Apache-2.0
"""Reads the messages of an MCAP file, also of one that was cut off or is damaged.

The format: mcap.dev/spec, version 0. A record is a code, a length and so many bytes. Messages stand
in chunks, compressed or not, or alone; the summary at the end tells where the chunks are. Without
a summary the records are walked from the beginning, which needs no chunk to be opened.
"""

import mmap
import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from touchline import _logs
from touchline.logs.cdr import JOINT_STATE
from touchline.logs.messages import Messages

MAGIC = b"\x89MCAP0\r\n"
# A footer record that points at no summary: readers then walk the records.
FOOTER = b"\x02" + (20).to_bytes(8, "little") + bytes(20) + MAGIC
SCENE = "foxglove.SceneUpdate"
METADATA, NAME = 0x0C, "touchline"  # the record that `McapWriter` puts in front of all messages
_LONGEST_METADATA = 1 << 20  # bytes
_HEAD = struct.Struct("<BQ")
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX = 3, 4, 5, 6, 7
_CHUNK_INDEX, _STATISTICS, _DATA_END, _FOOTER = 8, 11, 15, 2
# A chunk that claims to be larger is a damaged or a hostile one [bytes].
_LARGEST, _RATIO = 100 << 20, 3
_LONE_BYTES = 1 << 20  # messages outside of chunks are handed out so many at a time
_PIECE = 1 << 17  # bytes that are decompressed at a time: a block of zstd
_HELD = 1 << 20  # messages that wait for earlier ones of another chunk, at most


_ALL = np.ones(1 << 16, np.uint8)  # channels
_NO_INDEX = np.empty(0, np.int64)


class DamagedFile(ValueError):
    """A file of which nothing can be read, or a record that cannot be understood."""


@dataclass(frozen=True)
class _Span:
    """Records in the file that hold messages.

    Attributes:
        start: where their bytes begin, and `end` where they end.
        first: least time received [ns].
        compression: "" where they stand as they are, else "zstd" or "lz4".
        size: of the records, uncompressed [bytes].
        check: CRC-32 of the records, uncompressed; 0 where the writer left it out.
        indexes: where the message indexes of a chunk begin; `index_end` where they end.
    """

    start: int
    end: int
    first: int
    compression: str = ""
    size: int = 0
    check: int = 0
    indexes: int = 0
    index_end: int = 0


@dataclass
class _Contents:
    """What a file holds."""

    kinds: dict[int, str] = field(default_factory=dict)  # schema -> message type
    channels: dict[int, tuple[str, int]] = field(default_factory=dict)  # -> topic, schema
    counts: dict[int, int] = field(default_factory=dict)  # messages by channel
    spans: list[_Span] = field(default_factory=list)
    first: int = 0
    last: int = 0


class _Fields:
    """Steps through the body of a record."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def number(self, size: int) -> int:
        if self.at + size > len(self.data):
            raise DamagedFile("a record is too short")
        self.at += size
        return int.from_bytes(self.data[self.at - size : self.at], "little")

    def bytes(self) -> bytes:
        size = self.number(4)
        if self.at + size > len(self.data):
            raise DamagedFile("a record is too short")
        self.at += size
        return self.data[self.at - size : self.at]

    def text(self) -> str:
        return self.bytes().decode("utf-8", errors="replace")


class McapFile:
    """An opened MCAP file.

    Attributes:
        path: of the file.
        topics: topic -> message type.
        counts: topic -> number of messages, as the file tells.
        first: time of the first message received [ns], and `last` of the last.
        damage: what was wrong when it was opened, or None.
        lost: number of chunks of which nothing or not all could be read, by the last `messages`,
            and `doubtful`, of which the checksum is wrong.
        before_loss: messages handed out before the first of them.
        done: fraction of the file that the last call of `messages` has gone through.
    """

    def __init__(self, path: Path) -> None:
        """Open the file and find out what it holds.

        Raises:
            DamagedFile: it is no MCAP file, or not even its beginning can be read.
            OSError: it cannot be opened.
        """
        self.path = path
        self.damage: str | None = None
        self.lost, self.doubtful, self.before_loss, self.done = 0, 0, 0, 0.0
        with path.open("rb") as file:
            self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        try:
            if self._data[: len(MAGIC)] != MAGIC:
                raise DamagedFile("it does not begin as an MCAP file")
            found = self._summary()
            self._found = found if found is not None else self._scan()
        except BaseException:
            self._data.close()
            raise
        self._largest = max(_LARGEST, _RATIO * len(self._data))
        found = self._found
        names = {c: topic for c, (topic, _) in found.channels.items()}
        self.topics = {t: found.kinds.get(kind, "") for t, kind in found.channels.values()}
        self.counts = dict.fromkeys(self.topics, 0)
        for channel, count in found.counts.items():
            if channel in names:
                self.counts[names[channel]] += count
        self.first, self.last = found.first, found.last

    def messages(self, topics: Collection[str]) -> Iterator[Messages]:
        """The messages of some topics; `topic` counts them.

        Chunks follow each other by time; where they overlap their messages are merged.
        """
        self.lost, self.doubtful, self.before_loss, self.done = 0, 0, 0, 0.0
        numbers = np.full(1 << 16, -1)
        order = {topic: number for number, topic in enumerate(topics)}
        for channel, (topic, _) in self._found.channels.items():
            numbers[channel] = order.get(topic, -1)
        spans = sorted(self._found.spans, key=lambda span: span.first)
        nexts = [span.first for span in spans[1:]] + [None]
        held: list[Messages] = []
        given = 0
        for count, (span, end) in enumerate(zip(spans, nexts, strict=True), 1):
            if len(part := self._read(span, numbers)):
                held.append(part)
            if held:
                ready, held = _earlier(Messages.joined(held), end)
                if len(ready):
                    given += len(ready)
                    yield ready
            if not self.lost:
                self.before_loss = given
            self.done = count / len(spans)

    def close(self) -> None:
        """Release the file."""
        self._data.close()

    def _records(self, start: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Code, start and end of the body of each whole record between two places."""
        while start + _HEAD.size <= end:
            code, length = _HEAD.unpack_from(self._data, start)
            start += _HEAD.size
            if length > end - start:
                return
            yield code, start, start + length
            start += length

    def _summary(self) -> _Contents | None:
        """What the summary tells; None where there is none that makes sense."""
        size = len(self._data)
        tail = size - len(MAGIC) - _HEAD.size - 20
        if tail < len(MAGIC) or self._data[-len(MAGIC) :] != MAGIC:
            self.damage = "it ends before its footer"
            return None
        code, length = _HEAD.unpack_from(self._data, tail)
        start = int.from_bytes(self._data[tail + _HEAD.size : tail + _HEAD.size + 8], "little")
        if code != _FOOTER or length != 20 or not 0 < start < tail:
            return None  # a writer may leave the summary out
        found, told = _Contents(), False
        try:
            for code, begin, end in self._records(start, tail):
                if code in (_SCHEMA, _CHANNEL):
                    self._note(found, code, self._data[begin:end])
                elif code == _CHUNK_INDEX:
                    self._note_chunk(found, _Fields(self._data[begin:end]))
                elif code == _STATISTICS:
                    told = self._note_statistics(found, _Fields(self._data[begin:end]))
        except DamagedFile:
            return None
        return found if told and found.spans and found.channels else None

    def _note_chunk(self, found: _Contents, fields: _Fields) -> None:
        try:
            found.spans.append(self._indexed(fields))
        except DamagedFile as error:  # the others may be whole
            self.damage = str(error)

    def _indexed(self, fields: _Fields) -> _Span:
        first, _, start, length = (fields.number(8) for _ in range(4))
        if not len(MAGIC) <= start <= start + length <= len(self._data):
            raise DamagedFile("the summary points out of the file")
        span = self._chunk(start + _HEAD.size, start + length)
        if self._data[start] != _CHUNK or span.first != first:
            raise DamagedFile("the summary does not fit the file")
        fields.bytes()  # where the message indexes of single channels are
        index = fields.number(8)
        index_end = min(start + length + index, len(self._data))
        return replace(span, indexes=start + length, index_end=index_end)

    def _note(self, found: _Contents, code: int, body: bytes) -> None:
        fields = _Fields(body)
        number = fields.number(2)
        if code == _SCHEMA:
            found.kinds[number] = fields.text()
        else:
            schema = fields.number(2)
            found.channels[number] = (fields.text(), schema)

    def _note_statistics(self, found: _Contents, fields: _Fields) -> bool:
        fields.number(8 + 2 + 4 + 4 + 4 + 4)
        found.first, found.last = fields.number(8), fields.number(8)
        counts = _Fields(fields.bytes())
        while counts.at < len(counts.data):
            channel = counts.number(2)
            found.counts[channel] = counts.number(8)
        return True

    def _chunk(self, begin: int, end: int) -> _Span:
        """A chunk record's head."""
        fields = _Fields(self._data[begin : min(begin + 64, end)])
        first, _, size = (fields.number(8) for _ in range(3))
        check = fields.number(4)
        compression = fields.text()
        if compression not in ("", "zstd", "lz4"):
            raise DamagedFile(f"a chunk has the compression {compression!r}")
        length = fields.number(8)
        start = begin + fields.at
        return _Span(start, min(start + length, end), first, compression, size, check)

    def _scan(self) -> _Contents:
        """Walk the records from the beginning, as far as they are whole."""
        found, at, ended = _Contents(), len(MAGIC), False
        while (record := next(self._records(at, len(self._data)), None)) is not None:
            code, begin, end = record
            if code in (0, _DATA_END, _FOOTER):
                ended = code != 0
                break
            if code == _MESSAGE:
                at = self._note_messages(found, at, end)
                continue
            with suppress(DamagedFile):
                if code in (_SCHEMA, _CHANNEL):
                    self._note(found, code, self._data[begin:end])
                elif code == _CHUNK:
                    found.spans.append(self._opened(found, self._chunk(begin, end), end))
                elif code == _INDEX and found.spans:
                    self._note_index(found, begin, end)
            at = end
        if not ended:
            self.damage = self.damage or "its records make no sense from some place on"
            self._note_rest(found, at)
        return found

    def _note_messages(self, found: _Contents, start: int, end: int) -> int:
        """Messages outside of chunks that follow each other; returns where they end."""
        piece = self._data[start : max(start + _LONE_BYTES, end)]
        _, received, begin, size, _ = _logs.chunk_messages(piece, _ALL, _NO_INDEX)
        end = start + int(begin[-1] + size[-1]) if len(begin) else end
        self._count(found, piece[: end - start])
        first = int(received.min()) if len(begin) else 0
        found.spans.append(_Span(start, end, first))
        return end

    def _note_rest(self, found: _Contents, at: int) -> None:
        """A chunk that was being written when the file was cut off."""
        if self._data[at : at + 1] == bytes([_CHUNK]):
            with suppress(DamagedFile):
                span = self._chunk(at + _HEAD.size, len(self._data))
                found.spans.append(self._opened(found, span, len(self._data)))

    def _opened(self, found: _Contents, span: _Span, end: int) -> _Span:
        """A chunk met while walking; the channels in it are those of the file."""
        span = replace(span, indexes=end, index_end=end)
        with_index = self._data[end : end + 1] == bytes([_INDEX])
        largest = max(_LARGEST, _RATIO * len(self._data))
        if with_index and found.channels or span.size > largest:
            return span
        with suppress(DamagedFile):
            self._count(found, self._bytes(span, largest), not with_index)
        return span

    def _count(self, found: _Contents, records: bytes, counted: bool = True) -> None:
        """Note the channels that some records bring, and how many messages each has."""
        channel, received, *_ = _logs.chunk_messages(records, _ALL, _NO_INDEX)
        numbers, counts = np.unique(channel, return_counts=True)
        if not set(numbers.tolist()) <= found.channels.keys() or not len(numbers):
            for code, begin, end in _records_of(records):
                if code in (_SCHEMA, _CHANNEL):
                    self._note(found, code, records[begin:end])
        if not counted or not len(numbers):
            return
        for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
            found.counts[number] = found.counts.get(number, 0) + count
        self._stretch(found, int(received.min()), int(received.max()))

    def _note_index(self, found: _Contents, begin: int, end: int) -> None:
        """Count what the message index of a channel tells."""
        found.spans[-1] = replace(found.spans[-1], index_end=end)
        fields = _Fields(self._data[begin:end])
        channel, entries = fields.number(2), fields.bytes()
        times = np.frombuffer(entries[: len(entries) // 16 * 16], "<u8")[::2]
        if len(times):
            found.counts[channel] = found.counts.get(channel, 0) + len(times)
            self._stretch(found, int(times.min()), int(times.max()))

    def _stretch(self, found: _Contents, first: int, last: int) -> None:
        found.first = min(found.first, first) if found.last else first
        found.last = max(found.last, last)

    def _bytes(self, span: _Span, largest: int) -> bytes:
        """The records of a span, uncompressed.

        Raises:
            DamagedFile: they cannot be had.
        """
        data = self._data[span.start : span.end]
        if not span.compression:
            return data
        if span.size > largest:
            raise DamagedFile(f"a chunk claims to hold {span.size} bytes")
        return decompressed(data, span.compression, span.size)

    def _read(self, span: _Span, numbers: np.ndarray) -> Messages:
        """The wanted messages of a span, by time; what is damaged is left out."""
        try:
            records = self._bytes(span, self._largest)
            damaged = bool(span.size) and len(records) != span.size
        except DamagedFile:
            records, damaged = b"", True
        wanted = (numbers >= 0).astype(np.uint8)
        index = self._offsets(span)
        channel, received, start, size, strange = _logs.chunk_messages(records, wanted, index)
        if damaged or strange:
            self.lost += 1
        elif span.check and zlib.crc32(records) != span.check:
            self.doubtful += 1
        found = Messages(records, numbers[channel], received, start, size)
        if len(received) > 1 and (np.diff(received) < 0).any():
            found = found[np.argsort(received, kind="stable")]
        return found

    def _offsets(self, span: _Span) -> np.ndarray:
        """Where messages stand in a chunk, as its indexes tell."""
        parts = [np.empty(0, np.int64)]
        for code, begin, end in self._records(span.indexes, span.index_end):
            if code == _INDEX and end - begin >= 6:
                entries = self._data[begin + 6 : begin + 6 + (end - begin - 6) // 16 * 16]
                parts.append(np.frombuffer(entries, "<u8")[1::2].astype(np.int64))
        found = np.concatenate(parts)
        return np.sort(found[(found >= 0) & (found < max(span.size, span.end - span.start))])


def _records_of(records: bytes) -> Iterator[tuple[int, int, int]]:
    at = 0
    while at + _HEAD.size <= len(records):
        code, length = _HEAD.unpack_from(records, at)
        at += _HEAD.size
        if length > len(records) - at:
            return
        yield code, at, at + length
        at += length


def _earlier(messages: Messages, end: int | None) -> tuple[Messages, list[Messages]]:
    """Messages before a time [ns], sorted, and those that wait for what the next chunk brings."""
    order = np.argsort(messages.received, kind="stable")
    if (np.diff(order) < 0).any():
        messages = messages[order]
    if end is None or len(messages) > _HELD:
        return messages, []
    cut = int(np.searchsorted(messages.received, min(end, 2**63 - 1), side="left"))
    if cut == len(messages):
        return messages, []
    return messages[:cut], [messages[cut:].compact()]


def decompressed(data: bytes, compression: str, size: int) -> bytes:
    """What was compressed, up to where it is damaged; never more than `size` bytes."""
    pieces: list[bytes] = []
    held = 0
    with suppress(RuntimeError, ValueError, EOFError, OSError, _zstd().ZstdError):
        stream = (
            _zstd().ZstdDecompressor() if compression == "zstd" else _lz4().LZ4FrameDecompressor()
        )
        while held < size and not stream.eof:
            piece = stream.decompress(b"" if pieces else data, min(size - held, _PIECE))
            if not piece:
                break
            pieces.append(piece)
            held += len(piece)
    return b"".join(pieces)


def _zstd() -> Any:
    try:
        from compression import zstd  # pyright: ignore[reportMissingImports]  Python 3.14
    except ImportError:
        from backports import zstd
    return zstd


def _lz4() -> Any:
    import lz4.frame

    return lz4.frame


def is_for_viewers(path: Path) -> bool:
    """Whether a file has scenes to show and no joint states: it was made for a viewer."""
    try:
        file = McapFile(path)
    except (DamagedFile, OSError, ValueError):
        return False  # who opens it as a recording is told what is wrong
    kinds = set(file.topics.values())
    file.close()
    return SCENE in kinds and JOINT_STATE not in kinds


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
