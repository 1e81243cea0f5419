# SPDX-License-Identifier: Apache-2.0
"""Serialized messages of a rosbag2 (sqlite3 or MCAP), as far as its files can be read."""

import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from touchline.errors import InputError
from touchline.logs.mcap import MendedMcap
from touchline.logs.salvage import SalvagedSqlite

ENDINGS = (".db3", ".mcap")


class Bag:
    """An opened rosbag2: one file, or a folder of them.

    Attributes:
        topics: topic -> message type.
        counts: topic -> number of messages.
        duration: between the first and the last message received [s].
        warnings: grows while reading.
        done: number of messages handed out by the last call of `messages`.
    """

    def __init__(self, path: Path):
        """Open every file of the bag.

        Raises:
            InputError: nothing in it can be read, or it holds no messages.
        """
        self.path = path
        self.warnings: list[str] = []
        self.done = 0
        self._readers: list[Any] = []
        try:
            self._open()
            self.topics = {c.topic: c.msgtype for r in self._readers for c in r.connections}
            self.counts = dict.fromkeys(self.topics, 0)
            for connection in (c for r in self._readers for c in r.connections):
                self.counts[connection.topic] += connection.msgcount or 0
            if not sum(self.counts.values()):
                raise InputError(f"{path}: the recording holds no messages")
        except BaseException:
            self.close()
            raise
        ranges = [_time_range(reader) for reader in self._readers]
        spans = [span for span in ranges if span is not None]
        first, last = min(s[0] for s in spans), max(s[1] for s in spans)
        self.duration = max(last - first, 0) * 1e-9

    def _open(self) -> None:
        from rosbags.rosbag2 import Reader

        if self.path.is_dir() and (self.path / "metadata.yaml").exists():
            try:
                self._readers = [_opened(Reader(self.path))]
                self._warn_of_journal(sorted(self.path.glob("*.db3")))
                return
            except Exception as error:  # the package raises many kinds
                self.warnings.append(f"{self.path}: {_first_line(error)}; reading its files alone")
        files = self._files()
        self._readers = [reader for file in files if (reader := self._open_file(file))]
        if not self._readers:
            raise InputError(self.warnings)
        self._warn_of_journal(files)

    def _files(self) -> list[Path]:
        if self.path.is_file():
            return [self.path]
        files = [f for f in self.path.iterdir() if f.suffix in ENDINGS]
        if not files:
            raise InputError(f"{self.path}: the folder holds no rosbag2 ({', '.join(ENDINGS)})")
        return sorted(files, key=_natural)

    def _open_file(self, file: Path) -> Any:
        """A reader for one file; None, with a warning, where it cannot be read."""
        from rosbags.rosbag2 import Reader

        try:
            return _opened(Reader(file))
        except Exception as error:  # the package raises many kinds
            problem = _first_line(error)
        if (reader := _mend(file)) is not None:
            count = reader.metadata.message_count
            self.warnings.append(
                f"{file}: the file is cut off or damaged after {count} messages ({problem}); "
                "those before are used"
            )
            return reader
        self.warnings.append(f"{file}: not a readable recording, or damaged: {problem}")
        return None

    def _warn_of_journal(self, files: list[Path]) -> None:
        for file in files:
            journal = file.with_name(file.name + "-wal")
            if journal.exists() and journal.stat().st_size:
                self.warnings.append(
                    f"{file}: the recorder did not finish; its last messages are still in "
                    f"{journal.name} and are not read (opening the file once with sqlite3 "
                    "brings them in)"
                )

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        """Topic, receive time [ns] and bytes, in the order received.

        Where a file is damaged the messages before are handed out, with a warning.
        """
        self.done = 0
        for reader in self._readers:
            wanted = [c for c in reader.connections if c.topic in topics]
            if not wanted:
                continue
            read = getattr(reader, "messages_scan", reader.messages)
            try:
                for connection, received, data in read(wanted):
                    self.done += 1
                    yield connection.topic, received, data
            except Exception as error:  # damaged bytes can fail in any way
                text = (
                    f"{reader.path}: damaged after {self.done} messages ({_first_line(error)}); "
                    "those before are used"
                )
                if text not in self.warnings:
                    self.warnings.append(text)

    def close(self) -> None:
        """Release the files."""
        for reader in self._readers:
            reader.close()
        self._readers = []


def _opened(reader: Any) -> Any:
    reader.open()
    return reader


def _mend(file: Path) -> Any:
    """A reader of what can be read of a damaged file; None where nothing can."""
    from rosbags.rosbag2.storage_mcap import McapReader

    try:
        if file.suffix == ".mcap":
            mended: Any = MendedMcap(file)
            reader: Any = _opened(McapReader(mended))
        else:
            reader = SalvagedSqlite(file)
    except Exception:  # damaged bytes can fail in any way
        return None
    if reader.metadata.message_count:
        return reader
    reader.close()
    return None


def _time_range(reader: Any) -> tuple[int, int] | None:
    about = getattr(reader, "metadata", None) or reader.storage.metadata
    return (about.start_time, about.end_time - 1) if about.message_count else None


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]


def _natural(file: Path) -> list[Any]:
    """Sort key that puts `x_10` behind `x_9`."""
    return [int(p) if p.isdigit() else p for p in re.split(r"(\d+)", file.name)]
