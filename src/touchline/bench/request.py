# SPDX-License-Identifier: Apache-2.0
"""What a benchmark is asked for, checked before the work."""

from importlib import import_module
from pathlib import Path

from touchline.errors import InputError
from touchline.folder import make_folder


def check_least(least: float, **options: float) -> None:
    """Checks numbers.

    Raises:
        InputError: one is below `least`, infinite or NaN.
    """
    for name, value in options.items():
        if not least <= value < float("inf"):
            raise InputError(f"--{name} {value:g}: must be at least {least:g}")


def check_positive(**options: float) -> None:
    """Checks numbers.

    Raises:
        InputError: one is not positive, or infinite.
    """
    for name, value in options.items():
        if not 0.0 < value < float("inf"):
            raise InputError(f"--{name} {value:g}: must be a positive number")


def prepare_results(out: Path | None) -> None:
    """Makes the folder for results, if there are to be any, and sees that figures can be drawn.

    Raises:
        InputError: the folder cannot be made.
        ModuleNotFoundError: matplotlib is missing.
    """
    if out is not None:
        import_module("matplotlib")
        make_folder(out)
