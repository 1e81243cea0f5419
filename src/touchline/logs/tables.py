# SPDX-License-Identifier: Apache-2.0
"""Writes a recording as the contract's table."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from touchline.errors import InputError
from touchline.logs.parquet import METADATA_KEY
from touchline.model.description import AXES, RobotDescription


class SamplesLike(Protocol):
    """Arrays as in `Samples`; a NaN is written as an empty cell or null."""

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    wrench: np.ndarray


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

    Args:
        path: ends in `.parquet`, `.csv` or `.csv.gz`.
        samples: arrays in the robot's order.
        description: names the joints and sensors.
        metadata: JSON values kept in a Parquet file; other formats have no place for them.
        extra: further columns such as `truth.contact.0.x`, each (N,).

    Raises:
        InputError: another ending, or metadata for a CSV file.
    """
    import pyarrow as pa

    path = Path(path)
    columns = table_columns(samples, description) | dict(extra or {})
    table = pa.table({name: pa.array(v, from_pandas=True) for name, v in columns.items()})
    if path.name.endswith(".parquet"):
        _write_parquet(path, table, metadata or {})
    elif path.name.endswith((".csv", ".csv.gz")):
        if metadata:
            raise InputError(f"{path}: only Parquet keeps metadata")
        _write_csv(path, table)
    else:
        raise InputError(f"{path}: a table's name ends in .parquet, .csv or .csv.gz")


def _write_parquet(path: Path, table: Any, metadata: Mapping[str, Any]) -> None:
    import pyarrow.parquet as pq

    table = table.replace_schema_metadata({METADATA_KEY: json.dumps(dict(metadata))})
    options: dict[str, Any] = {"compression": "lz4", "use_dictionary": False}
    pq.write_table(table, path, row_group_size=1 << 17, write_page_checksum=True, **options)


def _write_csv(path: Path, table: Any) -> None:
    import pyarrow as pa
    import pyarrow.csv as arrow_csv

    # The ending decides: pyarrow compresses what ends in .gz.
    with pa.output_stream(str(path), compression="detect") as stream:
        arrow_csv.write_csv(table, stream)
