# SPDX-License-Identifier: Apache-2.0
"""Reads a damaged sqlite3 recording message by message, without its index, up to the damage.

A table whose upper pages are damaged cannot be read in this way.
"""

import sqlite3
from collections.abc import Collection, Iterator
from pathlib import Path
from types import SimpleNamespace

from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED


class SalvagedSqlite:
    """Offers of a damaged file what a reader of rosbags offers of a whole one.

    Attributes:
        path: of the file.
        connections: topics of the kinds that are read, with `topic`, `msgtype` and `msgcount`.
        metadata: `start_time`, `end_time` [ns] and `message_count` of what can be read.
    """

    def __init__(self, path: Path):
        """Open the file and find where the damage begins.

        Raises:
            sqlite3.Error: not even its topics can be read.
        """
        self.path = path
        self._file = sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)
        # Without this a file that is shorter than its header says is refused as a whole.
        self._file.execute("PRAGMA writable_schema=ON")
        try:
            topics = self._file.execute("SELECT id, name, type FROM topics").fetchall()
            self._find_end()
        except sqlite3.Error:
            self._file.close()
            raise
        self.connections = [
            SimpleNamespace(id=i, topic=name, msgtype=kind, msgcount=self._counts.get(i, 0))
            for i, name, kind in topics
            if kind in (JOINT_STATE, WRENCH_STAMPED)
        ]

    def _find_end(self) -> None:
        self._counts: dict[int, int] = {}
        first, last = 2**63 - 1, 0
        try:
            for topic, received, _ in self._rows():
                self._counts[topic] = self._counts.get(topic, 0) + 1
                first, last = min(first, received), max(last, received)
        except sqlite3.Error:
            pass
        self.metadata = SimpleNamespace(
            start_time=first, end_time=last + 1, message_count=sum(self._counts.values())
        )

    def _rows(self) -> Iterator[tuple[int, int, bytes]]:
        # In the order of the row ids the table is read from front to back.
        for row in self._file.execute(
            "SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id"
        ):
            if [type(cell) for cell in row] != [int, int, bytes]:  # half a row before the cut
                return
            yield row

    def messages(
        self, connections: Collection[SimpleNamespace]
    ) -> Iterator[tuple[SimpleNamespace, int, bytes]]:
        """Connection, receive time [ns] and bytes, in the order in which they were written."""
        wanted = {connection.id: connection for connection in connections}
        left = self.metadata.message_count
        for topic, received, data in self._rows():
            if topic in wanted:
                yield wanted[topic], received, data
            left -= 1
            if not left:  # the next one is damaged, which has been told
                return

    def close(self) -> None:
        """Release the file."""
        self._file.close()
