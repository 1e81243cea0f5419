# SPDX-License-Identifier: Apache-2.0
"""Folders that results go into."""

from pathlib import Path

from touchline.errors import InputError


def make_folder(path: Path) -> Path:
    """Makes sure that a folder exists.

    Raises:
        InputError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be used as a directory: {error.strerror}") from error
    return path
