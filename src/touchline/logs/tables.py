# SPDX-License-Identifier: Apache-2.0
"""Writes a recording as the contract's table."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from touchline.errors import InputError
from touchline.folder import replaced_file
from touchline.logs.csvtext import write_csv
from touchline.logs.parquet import METADATA_KEY
from touchline.model.description import AXES, RobotDescription


class SamplesLike(Protocol):
    """Arrays as in `Samples`; a NaN is written as an empty cell or null."""

    @property
    def time(self) -> np.ndarray:
        """(N,) [s]."""
        ...

    @property
    def q(self) -> np.ndarray:
        """(N, n) [rad] or [m]."""
        ...

    @property
    def qd(self) -> np.ndarray:
        """(N, n) [rad/s] or [m/s]."""
        ...

    @property
    def tau(self) -> np.ndarray:
        """(N, n) in logged units."""
        ...

    @property
    def wrench(self) -> np.ndarray:
        """(N, k, 6) [N, Nm]."""
        ...


def table_columns(samples: Any, description: RobotDescription) -> dict[str, np.ndarray]:
    """The contract's columns, each (N,); torques of joints without a signal are left out."""
    columns = {"time": np.asarray(samples.time, dtype=np.float64)}
    for signal in ("q", "qd", "tau"):
        values = np.asarray(getattr(samples, signal), dtype=np.float64)
        for j, joint in enumerate(description.joints):
            if signal != "tau" or joint.measured:
                columns[f"{signal}.{joint.name}"] = values[:, j]
    for k, sensor in enumerate(description.sensors):
        for axis in sensor.axes:
            columns[f"{sensor.name}.{axis}"] = samples.wrench[:, k, AXES.index(axis)]
    return columns


def write_table(
    path: Path | str,
    samples: SamplesLike,
    description: RobotDescription,
    metadata: Mapping[str, Any] | None = None,
    extra: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write a recording as Parquet, CSV or CSV.gz, by the name's ending.

    An older file stands until the new one is whole.

    Args:
        path: ends in `.parquet`, `.csv` or `.csv.gz`.
        samples: arrays in the robot's order.
        description: names the joints and sensors.
        metadata: JSON values kept in a Parquet file; other formats have no place for them.
        extra: further columns such as `truth.contact.0.x`, each (N,).

    Raises:
        InputError: another ending, or metadata for a CSV file.
    """
    path = Path(path)
    if not path.name.endswith((".parquet", ".csv", ".csv.gz")):
        raise InputError(f"{path}: a table's name ends in .parquet, .csv or .csv.gz")
    if metadata and not path.name.endswith(".parquet"):
        raise InputError(f"{path}: only Parquet keeps metadata")
    columns = table_columns(samples, description) | dict(extra or {})
    with replaced_file(path) as draft:
        if path.name.endswith(".parquet"):
            _write_parquet(draft, columns, metadata or {})
        else:
            write_csv(draft, columns)


def _write_parquet(
    path: Path, columns: Mapping[str, np.ndarray], metadata: Mapping[str, Any]
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({name: pa.array(v, from_pandas=True) for name, v in columns.items()})
    table = table.replace_schema_metadata({METADATA_KEY: json.dumps(dict(metadata))})
    options: dict[str, Any] = {"compression": "lz4", "use_dictionary": False}
    pq.write_table(table, path, row_group_size=1 << 17, write_page_checksum=True, **options)
