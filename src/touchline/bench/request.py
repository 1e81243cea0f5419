# SPDX-License-Identifier: Apache-2.0
"""What a benchmark is asked for, checked before the work."""

from importlib import import_module
from pathlib import Path

from touchline.folder import make_folder


def prepare_results(out: Path | None) -> None:
    """Makes the folder for results, if there are to be any, and sees that figures can be drawn.

    Raises:
        InputError: the folder cannot be made.
        ModuleNotFoundError: matplotlib is missing.
    """
    if out is not None:
        import_module("matplotlib")
        make_folder(out)
