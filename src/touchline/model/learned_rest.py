# SPDX-License-Identifier: Apache-2.0
"""What a joint's torque has beside the model: tables over its own position and velocity, as CSV.

`calibrate --learn` writes the file into the folder of `robot.yaml`, which names it under
`learned_rest`. One row is one node: `joint`, `q` [rad or m], `qd` [per s], `torque` and its `doubt`
(1 sigma) [Nm or N]. Between nodes the torque is bilinear. It is 0 on the edges and beyond them.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.folder import replaced_file
from touchline.suggest import unknown

COLUMNS = ("joint", "q", "qd", "torque", "doubt")
LARGEST = 10_000  # nodes of a joint; a table is small, or it is something else
DIGITS = 6  # of a written figure


@dataclass(frozen=True)
class LearnedRest:
    """The table of one joint.

    Attributes:
        q: positions of the nodes [rad or m], rising.
        qd: velocities of the nodes [per s], rising.
        torque: at (q, qd), row by row [Nm or N]; 0 on the edges.
        doubt: 1 sigma of it.
    """

    q: tuple[float, ...]
    qd: tuple[float, ...]
    torque: tuple[float, ...]
    doubt: tuple[float, ...]

    def at(self, q: Array, qd: Array) -> Array:
        """The torque (N,) at positions and velocities (N,), as the native core has it."""
        nodes, speeds = np.array(self.q), np.array(self.qd)
        inside = (q > nodes[0]) & (q < nodes[-1]) & (qd > speeds[0]) & (qd < speeds[-1])
        i = np.clip(np.searchsorted(nodes, q, "right") - 1, 0, len(nodes) - 2)
        k = np.clip(np.searchsorted(speeds, qd, "right") - 1, 0, len(speeds) - 2)
        table = np.array(self.torque).reshape(len(nodes), len(speeds))
        x = (q - nodes[i]) / (nodes[i + 1] - nodes[i])
        y = (qd - speeds[k]) / (speeds[k + 1] - speeds[k])
        near = (1.0 - y) * table[i, k] + y * table[i, k + 1]
        far = (1.0 - y) * table[i + 1, k] + y * table[i + 1, k + 1]
        return np.where(inside, (1.0 - x) * near + x * far, 0.0)

    @property
    def largest(self) -> float:
        """No value is larger [Nm or N]."""
        return max(abs(x) for x in self.torque)


def read_rest(path: Path, joints: list[str]) -> dict[str, LearnedRest]:
    """The tables of a file, by joint.

    Args:
        path: of the CSV.
        joints: that the robot has.

    Raises:
        InputError: the file is not there, or a row that is not as it should be.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    if not rows or tuple(rows[0]) != COLUMNS:
        raise InputError(f"{path}: the first line must be {','.join(COLUMNS)}")
    found: dict[str, list[tuple[float, ...]]] = {}
    for number, row in enumerate(rows[1:], 2):
        found.setdefault(*_entry(path, number, row, joints)).append(_numbers(path, number, row))
    return {name: _table(path, name, entries) for name, entries in found.items()}


def write_rest(path: Path, tables: dict[str, LearnedRest]) -> None:
    """Writes the tables of some joints.

    Raises:
        InputError: the file cannot be written.
    """
    lines = [",".join(COLUMNS)]
    for name, table in tables.items():
        nodes = [(q, qd) for q in table.q for qd in table.qd]
        for (q, qd), torque, doubt in zip(nodes, table.torque, table.doubt, strict=True):
            figures = (f"{x:.{DIGITS}g}" for x in (q, qd, torque, doubt))
            lines.append(",".join([name, *figures]))
    with replaced_file(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _entry(path: Path, number: int, row: list[str], joints: list[str]) -> tuple[str, list]:
    if len(row) != len(COLUMNS):
        raise InputError(f"{path}: line {number} has {len(row)} values, not {len(COLUMNS)}")
    if row[0] not in joints:
        raise InputError(f"{path}: line {number}: {unknown(row[0], 'joint', joints)}")
    return row[0], []


def _numbers(path: Path, number: int, row: list[str]) -> tuple[float, ...]:
    try:
        values = tuple(float(x) for x in row[1:])
    except ValueError:
        raise InputError(f"{path}: line {number}: {','.join(row[1:])} are no numbers") from None
    if not np.isfinite(values).all():
        raise InputError(f"{path}: line {number}: {','.join(row[1:])} are not finite")
    return values


def _table(path: Path, name: str, entries: list[tuple[float, ...]]) -> LearnedRest:
    values = np.array(entries)
    q, qd = (tuple(np.unique(values[:, i]).tolist()) for i in (0, 1))
    if len(values) > LARGEST:
        raise InputError(f"{path}: {name} has {len(values)} nodes; allowed: up to {LARGEST}")
    grid = np.array([(a, b) for a in q for b in qd])
    if len(q) < 2 or len(qd) < 2 or grid.shape != values[:, :2].shape:
        raise InputError(f"{path}: {name}: the nodes are no grid of positions and velocities")
    values = values[np.lexsort((values[:, 1], values[:, 0]))]
    if (values[:, :2] != grid).any():
        raise InputError(f"{path}: {name}: the nodes are no grid of positions and velocities")
    torque = values[:, 2].reshape(len(q), len(qd))
    if torque[[0, -1]].any() or torque[:, [0, -1]].any():
        raise InputError(f"{path}: {name}: the torque on the edges of the grid must be 0")
    return LearnedRest(q, qd, tuple(values[:, 2].tolist()), tuple(values[:, 3].tolist()))
