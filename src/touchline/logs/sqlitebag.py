# SPDX-License-Identifier: Apache-2.0
"""Reads the messages of a rosbag2 sqlite3 file, also of one that was cut off or is damaged."""

import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from touchline.logs.messages import Messages

_BATCH = 8192  # rows that are handed out at a time
_MOST_SKIPS = 64  # places behind damage at which reading is tried again
_WHOLE = (  # of a row
    "typeof(topic_id) = 'integer' AND typeof(timestamp) = 'integer' AND typeof(data) = 'blob'"
)
_Row = tuple[Any, Any, Any]


class SqliteFile:
    """An opened sqlite3 recording.

    Attributes:
        path: of the file.
        topics: topic -> message type.
        counts: topic -> number of messages that can be read.
        first: time of the first message received [ns], and `last` of the last.
        damage: what was wrong when it was opened, or None.
        odd: rows that are no messages, in the last call of `messages`.
        lost: messages that its index does not lead to, likewise.
        done: fraction of the messages that the last call of `messages` has handed out.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, find its topics and where damage begins.

        Raises:
            sqlite3.Error: not even its topics can be read.
        """
        self.path = path
        self.damage: str | None = None
        self.odd, self.lost, self.done = 0, 0, 0.0
        self._file = sqlite3.connect(
            f"{path.absolute().as_uri()}?immutable=1", uri=True, check_same_thread=False
        )
        self._file.text_factory = lambda text: text.decode("utf-8", errors="replace")
        # Without this a file that is shorter than its header says is refused as a whole.
        self._file.execute("PRAGMA writable_schema=ON")
        self._file.execute("PRAGMA cell_size_check=ON")
        self._file.execute(f"PRAGMA mmap_size={1 << 40}")
        try:
            rows = self._file.execute("SELECT id, name, type FROM topics").fetchall()
            self._topics = {
                number: topic
                for number, topic, kind in rows
                if isinstance(number, int) and isinstance(topic, str) and isinstance(kind, str)
            }
            self.topics = {t: k for _, t, k in rows if isinstance(t, str) and isinstance(k, str)}
            self._look()
        except sqlite3.Error:
            self._file.close()
            raise

    def messages(self, topics: Collection[str]) -> Iterator[Messages]:
        """The messages of some topics, in the order received; `topic` counts them.

        Of a damaged file: in the order written, those before and behind the damage.
        """
        self.odd, self.lost, self.done, taken, given = 0, 0, 0.0, 0, 0
        order = {topic: number for number, topic in enumerate(topics)}
        wanted = {n: order[topic] for n, topic in self._topics.items() if topic in order}
        for rows in self._batches(wanted) if self.damage is None else self._salvaged():
            taken += len(rows)
            self.done = min(taken / max(self._total, 1), 1.0)
            whole = [row for row in rows if _is_message(row)]  # a damaged index names others
            self.odd += 0 if self._whole else len(rows) - len(whole)
            rows = whole
            if self.damage is not None:
                rows = [row for row in rows if row[0] in wanted]
            given += len(rows)
            if rows:
                numbers, received, data = zip(*rows, strict=True)
                yield Messages.of(data, list(map(wanted.__getitem__, numbers)), received)
        self.done = 1.0
        self.lost = max(0, sum(self.counts[t] for t in order if t in self.counts) - given)

    def _batches(self, wanted: Collection[int]) -> Iterator[list[_Row]]:
        numbers = ",".join(map(str, wanted))
        rows = self._file.execute(
            "SELECT topic_id, timestamp, data FROM messages "
            f"WHERE topic_id IN ({numbers}) ORDER BY timestamp"
        )
        while part := rows.fetchmany(_BATCH):
            yield part

    def _salvaged(self) -> Iterator[list[_Row]]:
        """The rows that can be read, from front to back; behind damage it goes on where it can."""
        last, skips, step, together = -(2**63), 0, 1, _BATCH
        while skips < _MOST_SKIPS:
            try:
                rows = self._file.execute(
                    "SELECT id, topic_id, timestamp, data FROM messages NOT INDEXED "
                    f"WHERE id > {last} ORDER BY id"
                )
                while part := rows.fetchmany(together):
                    # Of a page that is not whole the cells that are lost come out as numbers 0.
                    ids = np.maximum.accumulate([last, *(row[0] for row in part)])
                    rises = ids[1:] > ids[:-1]
                    yield [row[1:] for row, good in zip(part, rises, strict=True) if good]
                    last, step = int(ids[-1]), 1
                return
            except (sqlite3.Error, OverflowError):
                if together > 1:  # up to the damage row by row
                    together = 1
                else:
                    last, step, skips = max(last, 0) + step, 2 * step, skips + 1

    def _look(self) -> None:
        """Count the messages, by walking through the whole table."""
        self.counts = dict.fromkeys(self.topics, 0)
        of_each = "".join(f", sum(topic_id = {number})" for number in self._topics)
        query = f"SELECT count(*), sum({_WHOLE}), min(timestamp), max(timestamp){of_each}"
        try:
            row = self._file.execute(f"{query}, sum(length(data)) FROM messages NOT INDEXED")
            rows, whole, first, last, *counts = [cell or 0 for cell in row.fetchone()]
            self._whole = rows == whole
        except sqlite3.Error as error:
            self.damage = str(error)
        if self.damage is not None or not self._whole:  # row by row
            self._whole = False
            read = [(n, t) for part in self._salvaged() for n, t, _ in filter(_is_message, part)]
            found = Counter(number for number, _ in read)
            counts = [found[number] for number in self._topics]
            first = min((time for _, time in read), default=0)
            last = max((time for _, time in read), default=0)
        for topic, count in zip(self._topics.values(), counts, strict=False):
            self.counts[topic] += count
        self._total = sum(self.counts.values())
        self.first, self.last = first, last

    def close(self) -> None:
        """Release the file."""
        self._file.close()


def _is_message(row: _Row) -> bool:
    """Whether it is a whole one: before a cut there may be half a row."""
    return isinstance(row[0], int) and isinstance(row[1], int) and isinstance(row[2], bytes)
