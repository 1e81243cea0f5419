# SPDX-License-Identifier: Apache-2.0
"""What a recording of an unknown robot holds: columns of a table, or topics of a rosbag2."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from touchline.errors import InputError
from touchline.logs.bagfile import Bag
from touchline.logs.cdr import JOINT_STATE, WRENCH_STAMPED
from touchline.logs.log import BAGS, TABLES, unknown_kind

LOOKED_AT = 200  # rows or messages


@dataclass(frozen=True)
class JointStates:
    """A topic of joint states: its joints, and whether velocities and efforts are filled in."""

    joints: tuple[str, ...]
    velocity: bool
    effort: bool


@dataclass(frozen=True)
class Contents:
    """What a recording holds.

    Attributes:
        columns: of a table, with their first values.
        joint_states: by topic.
        wrenches: topic -> the frame that its headers name.
    """

    columns: dict[str, np.ndarray] = field(default_factory=dict)
    joint_states: dict[str, JointStates] = field(default_factory=dict)
    wrenches: dict[str, str] = field(default_factory=dict)


def read_contents(path: Path) -> Contents:
    """Look at the beginning of a recording.

    Raises:
        InputError: it is no recording of a known kind, or cannot be read.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir() or path.suffix in BAGS:
        return _bag(path)
    if path.name.endswith(".parquet"):
        return Contents(columns=_parquet(path))
    if path.name.endswith(TABLES):
        return Contents(columns=_csv(path))
    raise unknown_kind(path)


def _parquet(path: Path) -> dict[str, np.ndarray]:
    import pyarrow.parquet as parquet

    from touchline.logs.parquet import damages

    try:
        file = parquet.ParquetFile(path)
        names = file.schema_arrow.names
        batch = next(file.iter_batches(LOOKED_AT), None)
    except damages() as error:
        raise InputError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None
    if batch is None:
        return {name: np.empty(0) for name in names}
    return {name: _numbers(batch.column(name).to_pylist()) for name in names}


def _csv(path: Path) -> dict[str, np.ndarray]:
    from touchline.logs.csvfile import read_head

    names, rows = read_head(path, LOOKED_AT)
    cells = [[row[i] if i < len(row) else "" for row in rows] for i in range(len(names))]
    return {name: _numbers(column) for name, column in zip(names, cells, strict=True)}


def _numbers(cells: list) -> np.ndarray:
    def number(cell) -> float:
        try:
            return float(cell)
        except (TypeError, ValueError):
            return float("nan")

    return np.array([number(cell) for cell in cells])


def _bag(path: Path) -> Contents:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    bag = Bag(path)
    try:
        kinds = {t: kind for t, kind in bag.topics.items() if kind in (JOINT_STATE, WRENCH_STAMPED)}
        found = Contents()
        for topic, kind in kinds.items():
            for data in islice(_raw(bag, topic), LOOKED_AT):
                try:
                    message: Any = store.deserialize_cdr(data, kind)
                except Exception:  # a damaged message can fail in any way; the next may be whole
                    continue
                if kind == WRENCH_STAMPED:
                    found.wrenches[topic] = str(message.header.frame_id)
                else:
                    found.joint_states[topic] = _joint_states(message)
                break
    finally:
        bag.close()
    return found


def _raw(bag: Bag, topic: str) -> Iterator[bytes]:
    for part in bag.messages([topic]):
        for start, size in zip(part.start.tolist(), part.size.tolist(), strict=True):
            yield part.buffer[start : start + size]


def _joint_states(message) -> JointStates:
    def filled(values) -> bool:
        return len(values) > 0 and bool(np.isfinite(values).any())

    return JointStates(tuple(message.name), filled(message.velocity), filled(message.effort))
