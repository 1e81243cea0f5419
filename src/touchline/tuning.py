# SPDX-License-Identifier: Apache-2.0
"""The numbers that the estimation was tuned with: those that are neither physics nor a robot's own.

Their meaning, what half and double of each would do, and what they did on a benchmark stand in
docs/reference/tuning.md. The native `tuning.hpp` has them, and nothing repeats them here.
"""

from collections.abc import Iterator, Mapping
from math import isfinite
from numbers import Real

from touchline.native import core
from touchline.suggest import near_misses


class Tuning(Mapping[str, float]):
    """All tuning numbers by module and name; `print` lists them with their units.

        tuning = tl.Tuning({"detector.hand": 4.0})
        pipeline = tl.Pipeline("sara", tuning=tuning)

    Args:
        changes: those that shall not be the default.

    Raises:
        ValueError: a name does not exist, or a number is not finite, or not whole where it counts.
    """

    def __init__(self, changes: Mapping[str, float] | None = None) -> None:
        numbers = core.Tuning().numbers()
        self._units = {name: unit for name, unit, _ in numbers}
        self._values: dict[str, float] = {name: value for name, _, value in numbers}
        for name, value in (changes or {}).items():
            if name not in self._values:
                raise ValueError(
                    f"unknown tuning number '{name}'.{near_misses(name, self._values)} "
                    f"print(touchline.Tuning()) lists all {len(self)}"
                )
            whole = isinstance(self._values[name], int)
            if not isinstance(value, Real):
                raise ValueError(f"{name} is {value!r}, but must be a number")
            if not isfinite(value) or (whole and value != int(value)):
                what = "a whole number" if whole else "finite"
                raise ValueError(f"{name} is {value}, but must be {what}")
            self._values[name] = int(value) if whole else float(value)

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        changed = {name: x for name, x in self.items() if x != DEFAULTS[name]}
        return f"Tuning({changed})"

    def __str__(self) -> str:
        return "\n".join(f"{name} = {self._told(name)}" for name in self)

    def unit(self, name: str) -> str:
        """The unit of a number; "1" where it has none."""
        return self._units[name]

    def _told(self, name: str) -> str:
        unit = self._units[name]
        return f"{self._values[name]:g}" + ("" if unit == "1" else f" {unit}")


DEFAULTS = Tuning()


def native_tuning(tuning: Mapping[str, float], rule: str = "likelihood") -> core.Tuning:
    """In the words of the native core.

    Args:
        tuning: all numbers, or those that shall not be the default.
        rule: for places, "likelihood" or "paper".
    """
    native = core.Tuning()
    for name, value in Tuning(tuning).items():
        if value != DEFAULTS[name]:  # which it has already
            native.set_number(name, value)
    native.first_entry = rule == "paper"
    return native
