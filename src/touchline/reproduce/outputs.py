# SPDX-License-Identifier: Apache-2.0
"""Writes what an experiment handed back: figures, series, tables, and its page."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from touchline.arrays import Array
from touchline.figure import save
from touchline.folder import make_folder
from touchline.reproduce.experiment import Experiment, Row
from touchline.reproduce.page import page_text


def write_experiment(experiment: Experiment, out: Path) -> None:
    """Writes OUT/NAME with NAME.pdf, .svg, .png, series.csv, table.csv, index.html and so on."""
    folder = make_folder(out / experiment.name)
    for name, drawing in experiment.drawings.items():
        save(drawing.figure, folder, name)
    for name, series in experiment.series.items():
        write_series(folder / f"{name}.csv", series)
    for name, table in experiment.tables.items():
        write_rows(folder / f"{name}.csv", table.rows)
    write_rows(
        folder / "checks.csv",
        [
            {"check": c.name, "value": c.value, "limit": c.limit, "holds": int(c.holds)}
            for c in experiment.checks
        ],
    )
    write_page([experiment], folder)


def write_page(experiments: Sequence[Experiment], folder: Path) -> None:
    """Writes FOLDER/index.html, one file that needs no other."""
    (folder / "index.html").write_text(page_text(experiments), encoding="utf-8")


def write_series(path: Path, series: Mapping[str, Array]) -> None:
    """Columns of equal length, one row per instant; a NaN leaves its field empty."""
    columns = np.column_stack([np.asarray(column, dtype=float) for column in series.values()])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(series)
        for row in columns.tolist():
            writer.writerow(["" if value != value else f"{value:.9g}" for value in row])


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Rows with the same keys; numbers keep all their digits, None leaves its field empty."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0] if rows else [])
        for row in rows:
            writer.writerow(["" if value is None else value for value in row.values()])
