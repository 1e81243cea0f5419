# SPDX-License-Identifier: Apache-2.0
"""Serialized messages of a rosbag2 (sqlite3 or MCAP), as far as its files can be read."""

import re
import sqlite3
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Protocol

import yaml

from touchline.errors import InputError
from touchline.logs.mcap import McapFile
from touchline.logs.messages import Messages
from touchline.logs.sqlitebag import SqliteFile

ENDINGS = (".db3", ".mcap")
_BATCH = 8192


class _File(Protocol):
    """One file of a bag, whatever holds its messages."""

    path: Path
    topics: dict[str, str]
    counts: dict[str, int]
    first: int
    last: int
    damage: str | None
    done: float

    def messages(self, topics: Collection[str]) -> Iterator[Messages]: ...

    def close(self) -> None: ...


class Bag:
    """An opened rosbag2: one file, or a folder of them.

    Attributes:
        topics: topic -> message type.
        counts: topic -> number of messages.
        duration: between the first and the last message received [s].
        warnings: grows while reading.
        losses: those of them that tell of what could not be read.
        done: number of messages handed out by the last call of `messages`.
    """

    def __init__(self, path: Path):
        """Open every file of the bag.

        Raises:
            InputError: nothing in it can be read, or it holds no messages.
        """
        self.path = path
        self.warnings: list[str] = []
        self.losses: list[str] = []
        self.done = 0
        self._files: list[_File] = []
        self._place = 0
        try:
            self._open()
            self.topics = {t: kind for f in self._files for t, kind in f.topics.items()}
            self.counts = dict.fromkeys(self.topics, 0)
            for file in self._files:
                for topic, count in file.counts.items():
                    self.counts[topic] += count
            if not sum(self.counts.values()):
                raise InputError([*self.warnings, f"{path}: the recording holds no messages"])
        except BaseException:
            self.close()
            raise
        spans = [(f.first, f.last) for f in self._files if sum(f.counts.values())]
        first, last = min(span[0] for span in spans), max(span[1] for span in spans)
        self.duration = max(last - first, 0) * 1e-9

    @property
    def progress(self) -> float:
        """Fraction of the files that the last call of `messages` has gone through."""
        if self._place >= len(self._files):
            return 1.0
        return (self._place + self._files[self._place].done) / len(self._files)

    def _open(self) -> None:
        if self.path.is_file():
            files = [self.path]
        else:
            facts = self._facts()
            if facts.get("compression_mode", "").lower() in ("file", "message"):
                self._files = [_Packed(self.path)]
                return
            files = self._listed(facts)
        for file in files:
            self._open_file(file)
            self._warn_of_journal(file)
        if not self._files:
            raise InputError(self.warnings)

    def _facts(self) -> dict[str, Any]:
        """What `metadata.yaml` says of a folder; nothing where it cannot be understood."""
        path = self.path / "metadata.yaml"
        if not path.is_file():
            return {}
        try:
            found = yaml.safe_load(path.read_text(encoding="utf-8"))
            facts = dict(found["rosbag2_bagfile_information"])
            facts["compression_mode"] = str(facts.get("compression_mode") or "")
            facts["relative_file_paths"] = list(facts["relative_file_paths"])
            return facts
        except (OSError, ValueError, KeyError, TypeError, RecursionError, yaml.YAMLError) as error:
            self.warnings.append(f"{path}: {first_line(error)}; reading the folder's files alone")
            return {}

    def _listed(self, facts: dict[str, Any]) -> list[Path]:
        """The files of a folder, in their order."""
        named = [self.path / str(name) for name in facts.get("relative_file_paths", ())]
        if named and all(f.is_file() and f.suffix in ENDINGS for f in named):
            return named
        if named:
            self.warnings.append(
                f"{self.path}: not every file that metadata.yaml names is there; reading the "
                "folder's files alone"
            )
        found = [f for f in self.path.iterdir() if f.suffix in ENDINGS]
        if not found:
            raise InputError(f"{self.path}: the folder holds no rosbag2 ({', '.join(ENDINGS)})")
        return sorted(found, key=_natural)

    def _open_file(self, path: Path) -> None:
        """Open one file, or tell why that is not possible."""
        try:
            file: _File = McapFile(path) if path.suffix == ".mcap" else SqliteFile(path)
        except (ValueError, OSError, sqlite3.Error, RecursionError) as error:
            text = f"{path}: not a readable recording, or damaged: {first_line(error)}"
            self._warn(text)
            return
        count = sum(file.counts.values())
        if file.damage is not None and not count:
            text = f"{path}: not a readable recording, or damaged: {file.damage}"
            self._warn(text)
            file.close()
            return
        if file.damage is not None:
            self._warn(
                f"{path}: the file is cut off or damaged after {count} messages ({file.damage}); "
                "all that can be read is used"
            )
        self._files.append(file)

    def _warn_of_journal(self, file: Path) -> None:
        journal = file.with_name(file.name + "-wal")
        if journal.exists() and journal.stat().st_size:
            self._warn(
                f"{file}: the recorder did not finish; its last messages are still in "
                f"{journal.name} and are not read (opening the file once with sqlite3 "
                "brings them in)"
            )

    def messages(self, topics: Collection[str]) -> Iterator[Messages]:
        """Messages of some topics, in the order received; `topic` counts the topics.

        What is damaged is left out, with a warning.
        """
        self.done = 0
        for place, file in enumerate(self._files):
            self._place = place
            if not set(topics) & set(file.topics):
                continue
            try:
                for part in file.messages(topics):
                    self.done += len(part)
                    yield part
            except (sqlite3.Error, OSError, ValueError) as error:
                self._warn(
                    f"{file.path}: damaged after {self.done} messages ({first_line(error)}); "
                    "those before are used"
                )
            self._tell(file)
        self._place = len(self._files)

    def _tell(self, file: _File) -> None:
        """What was found wrong while a file was read."""
        if isinstance(file, McapFile):
            if file.lost and file.damage is None:
                self._warn(
                    f"{file.path}: damaged after {file.before_loss} messages: {file.lost} of its "
                    "chunks cannot be read whole; all else is used"
                )
            if file.doubtful:
                self._warn(
                    f"{file.path}: the checksums of {file.doubtful} chunks are wrong: some of the "
                    "values in them may be"
                )
        elif isinstance(file, SqliteFile) and file.odd:
            self._warn(f"{file.path}: {file.odd} rows are no messages and are left out")
        if isinstance(file, SqliteFile) and file.lost:
            self._warn(
                f"{file.path}: its index is damaged; {file.lost} messages that it does not lead to "
                "are left out"
            )

    def _warn(self, text: str) -> None:
        if text not in self.warnings:
            self.warnings.append(text)
            self.losses.append(text)

    def close(self) -> None:
        """Release the files."""
        for file in self._files:
            file.close()
        self._files = []


class _Packed:
    """A folder whose files or messages are compressed one by one, read by the rosbags package."""

    def __init__(self, path: Path) -> None:
        from rosbags.rosbag2 import Reader

        self.path, self.done = path, 0.0
        self.damage: str | None = None
        self._reader = Reader(path)
        try:
            self._reader.open()
        except Exception as error:  # the package raises many kinds
            raise InputError(
                f"{path}: not a readable recording, or damaged: {first_line(error)}"
            ) from error
        connections = self._reader.connections
        self.topics = {c.topic: c.msgtype for c in connections}
        self.counts = dict.fromkeys(self.topics, 0)
        for connection in connections:
            self.counts[connection.topic] += connection.msgcount or 0
        self.first, self.last = self._reader.start_time, self._reader.end_time - 1

    def messages(self, topics: Collection[str]) -> Iterator[Messages]:
        order = {topic: number for number, topic in enumerate(topics)}
        wanted = [c for c in self._reader.connections if c.topic in order]
        data: list[bytes] = []
        topic: list[int] = []
        received: list[int] = []
        total, taken = sum(self.counts[t] for t in order if t in self.counts), 0
        try:
            for connection, stamp, raw in self._reader.messages(wanted):
                data.append(raw)
                topic.append(order[connection.topic])
                received.append(stamp)
                if len(data) == _BATCH:
                    taken += len(data)
                    self.done = min(taken / max(total, 1), 1.0)
                    yield Messages.of(data, topic, received)
                    data, topic, received = [], [], []
        except Exception as error:  # damaged bytes can fail in any way
            if data:
                yield Messages.of(data, topic, received)
            raise ValueError(first_line(error)) from error
        if data:
            yield Messages.of(data, topic, received)

    def close(self) -> None:
        self._reader.close()


def first_line(error: Exception) -> str:
    """What an error says, in a line."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def _natural(file: Path) -> list[Any]:
    """Sort key that puts `x_10` behind `x_9`."""
    return [int(p) if p.isdigit() else p for p in re.split(r"(\d+)", file.name)]
