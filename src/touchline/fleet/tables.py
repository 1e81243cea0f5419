# SPDX-License-Identifier: Apache-2.0
"""What a fleet has felt, as Parquet tables partitioned by robot and date."""

import shutil
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from touchline.errors import InputError
from touchline.fleet.figures import HOUR, Figures, hour_of, percentile
from touchline.fleet.manifest import MANIFEST

COMMON = "tables"
UNDATED = "undated"  # the date of recordings whose stamps do not begin in 1970
SHARES = {"p50": 0.5, "p95": 0.95, "p99": 0.99}
Rows = dict[str, list[dict[str, Any]]]


def table_rows(figures: dict[str, Figures]) -> Rows:
    """The rows of each table.

    Args:
        figures: of each recording, by its name.
    """
    rows: Rows = {"contacts": [], "health": [], "joints": [], "segments": []}
    for name, told in figures.items():
        key = {"robot": told["robot"], "recording": name}
        rows["contacts"] += [key | row for row in _contacts(told)]
        for text, entry in told["hours"].items():
            when = key | _when(int(text), told)
            counts = {"samples": entry["samples"], "healthy": entry["healthy"]}
            rows["health"].append(when | counts | entry["health"])
            rows["joints"] += [when | row for row in _joints(entry)]
            rows["segments"] += [when | row for row in _segments(entry)]
    return rows


def check_tables(out: Path) -> None:
    """Make sure, before the work begins, that no folder of the user's would be replaced.

    Raises:
        InputError: it would.
    """
    folder = out / COMMON
    if folder.is_dir() and not (out / MANIFEST).is_file() and any(folder.iterdir()):
        raise InputError(f"{folder}: would be replaced by the results; choose another --out")


def write_tables(out: Path, rows: Rows) -> None:
    """Write `tables/NAME/robot=.../date=.../` anew; the older ones stand until that is done."""
    import pyarrow as pa
    import pyarrow.dataset as ds

    folder, draft, old = out / COMMON, out / f".{COMMON}.part", out / f".{COMMON}.old"
    for left in (draft, old):
        shutil.rmtree(left, ignore_errors=True)
    draft.mkdir(parents=True)
    for name, entries in rows.items():
        if entries:
            table = pa.Table.from_pylist(entries)
            keys = pa.schema([("robot", pa.string()), ("date", pa.string())])
            ds.write_dataset(
                table,
                draft / name,
                format="parquet",
                partitioning=ds.partitioning(keys, flavor="hive"),
                max_partitions=1 << 16,
            )
    if folder.exists():
        folder.rename(old)
    draft.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def _when(hour: int, told: Figures) -> dict[str, Any]:
    if not told["dated"]:
        return {"date": UNDATED, "hour": hour}
    moment = datetime.fromtimestamp(hour * HOUR, UTC)
    return {"date": moment.date().isoformat(), "hour": moment.hour}


def _contacts(told: Figures) -> Iterator[dict[str, Any]]:
    for event in told["events"]:
        cleared = event["cleared"]
        lasted = None if cleared is None else cleared - event["detected"]
        hour = hour_of(event["detected"], told["first"] or 0.0)
        yield _when(hour, told) | event | {"lasted": lasted}


def _joints(entry: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for joint, told in entry["joints"].items():
        count = told["quiet"]
        mean = told["sum"] / count if count else None
        rms = float(np.sqrt(told["squares"] / count)) if count else None
        largest = told["largest"] if count else None
        row = {"joint": joint, "quiet": count, "nan": told["nan"]}
        yield row | {"torque_mean": mean, "torque_rms": rms, "torque_largest": largest}


def _segments(entry: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for segment, told in entry["segments"].items():
        counts = np.array(told["counts"])
        row = {"segment": segment, "quiet": int(counts.sum()), "nan": told["nan"]}
        forces = {f"force_{name}": percentile(counts, share) for name, share in SHARES.items()}
        yield row | {name: None if np.isnan(x) else x for name, x in forces.items()}
