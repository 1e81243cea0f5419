# SPDX-License-Identifier: Apache-2.0
"""Numbers that a user asks for, checked before the work, and those that are told."""

from touchline.errors import InputError


def counted(number: int, word: str, plural: str = "s") -> str:
    """So many of something, in words: "1 event", "2 events"."""
    return f"{number} {word}{plural * (number != 1)}"


def lasting(seconds: float) -> str:
    """A duration in the unit that suits it."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"


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
