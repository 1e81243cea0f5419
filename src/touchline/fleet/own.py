# SPDX-License-Identifier: Apache-2.0
"""What stands beside recordings and is none: Touchline's own results, and what viewers show."""

import os
from pathlib import Path, PurePath
from typing import Protocol

from touchline.fleet.figures import FIGURES
from touchline.fleet.manifest import JOURNAL, MANIFEST
from touchline.fleet.page import PAGE_FILE
from touchline.fleet.tables import COMMON
from touchline.logs.dataset import lerobot_of
from touchline.logs.mcap import is_for_viewers
from touchline.logs.parquet import column_names
from touchline.report.outputs import NAMES, TABLES, is_result_table

ROBOT_FILE = "robot.yaml"
OWN = "among Touchline's own results"
PAPERS = {*NAMES, FIGURES, MANIFEST, JOURNAL, PAGE_FILE} - {*TABLES}  # no recording ends so
# Folders of results that are not whole yet.
UNFINISHED = {f"{Path(name).stem}.parts" for name in NAMES}


class Files(Protocol):
    """Where files are: this machine, or elsewhere."""

    def exists(self, path: str) -> bool:
        """Whether there is a file or folder."""
        ...

    def columns(self, path: str) -> list[str]:
        """Columns of a Parquet file; none of one that cannot be read."""
        ...


class Here:
    """Files of this machine."""

    def exists(self, path: str) -> bool:
        """Whether there is a file or folder."""
        return os.path.exists(path)

    def columns(self, path: str) -> list[str]:
        """Columns of a Parquet file; none of one that cannot be read."""
        return column_names(path) if os.path.isfile(path) else []


HERE = Here()


def is_result(path: PurePath, files: Files = HERE) -> bool:
    """Whether an earlier analysis wrote a file or folder, which may stand beside recordings.

    Args:
        path: of the file or folder.
        files: where it is.
    """
    if path.name in PAPERS:
        return True
    if any(
        folder.name in UNFINISHED
        or (folder.name == COMMON and files.exists(str(folder.parent / MANIFEST)))
        for folder in (path, *path.parents)
    ):
        return True
    # A look into each table would cost as much as the plan; a result that was renamed lacks the
    # columns of a recording, and that is told when it is opened.
    return path.name in TABLES and is_result_table(files.columns(str(path)))


def why_none(path: Path) -> str:
    """Why a file or folder on this machine is no recording, though it may stand beside some.

    Returns:
        The reason, or nothing.
    """
    if is_result(path):
        return OWN
    if dataset := lerobot_of(path):
        how = f"`touchline label {dataset} --out COPY` adds what the arm feels"
        return f"of a LeRobot data set, no folder of recordings; {how}"
    if path.name == ROBOT_FILE:
        return "the description of a robot"
    if path.suffix == ".rrd" or (path.suffix == ".mcap" and is_for_viewers(path)):
        return "made for a viewer, with scenes and without joint states"
    return ""
