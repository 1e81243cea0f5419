# SPDX-License-Identifier: Apache-2.0
"""A data set for robot learning, which is told from a folder of recordings."""

import os
from pathlib import Path

INFO = "meta/info.json"


def is_lerobot(path: Path) -> bool:
    """Whether a folder is a LeRobot data set: it describes itself."""
    return (path / INFO).is_file()


def lerobot_of(path: Path) -> Path | None:
    """The LeRobot data set that a file or folder is, or is a part of."""
    path = Path(os.path.abspath(path))
    return next((folder for folder in (path, *path.parents) if is_lerobot(folder)), None)
