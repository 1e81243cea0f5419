# SPDX-License-Identifier: Apache-2.0
"""What stands beside recordings and is none: Touchline's own results, and what viewers show."""

import os
from collections.abc import Callable
from pathlib import Path, PurePath

from touchline.fleet.figures import FIGURES
from touchline.fleet.manifest import JOURNAL, MANIFEST
from touchline.fleet.page import PAGE_FILE
from touchline.fleet.tables import COMMON
from touchline.logs.mcap import is_for_viewers
from touchline.report.outputs import NAMES

ROBOT_FILE = "robot.yaml"
OWN = "named as Touchline's own results are"
RESULTS = {*NAMES, FIGURES, MANIFEST, JOURNAL, PAGE_FILE}
# Folders of results that are not whole yet.
UNFINISHED = {f"{Path(name).stem}.parts" for name in NAMES}


def is_result(path: PurePath, exists: Callable[[str], bool]) -> bool:
    """Whether an earlier analysis wrote a file or folder, which may stand beside recordings.

    Args:
        path: of the file or folder.
        exists: whether there is a file.
    """
    if path.name in RESULTS:
        return True
    return any(
        folder.name in UNFINISHED
        or (folder.name == COMMON and exists(str(folder.parent / MANIFEST)))
        for folder in (path, *path.parents)
    )


def why_none(path: Path) -> str:
    """Why a file or folder on this machine is no recording, though it may stand beside some.

    Returns:
        The reason, or nothing.
    """
    if is_result(path, os.path.exists):
        return OWN
    if path.name == ROBOT_FILE:
        return "the description of a robot"
    if path.suffix == ".rrd" or (path.suffix == ".mcap" and is_for_viewers(path)):
        return "made for a viewer, with scenes and without joint states"
    return ""
