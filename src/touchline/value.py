# SPDX-License-Identifier: Apache-2.0
"""Values: dataclasses that are compared, copied and pickled by what they say.

The core gives contacts and events as rows of numbers; `lazily` makes a dataclass name them when
they are asked for. Which numbers a field has, and what they mean, is told by the core's table of
fields alone (`visit_fields` in core/include/touchline/result.hpp).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from html import escape
from typing import Any, Self

import numpy as np

from touchline.arrays import Array

PROBABILITIES = ("probability", "body_probability")
Decode = Callable[[Array, Any], Any]


@dataclass(frozen=True)
class Field:
    """A field of a native contact or event.

    Attributes:
        name: of the attribute.
        kind: what its numbers mean: "number", "count", "flag", "vector", "candidates", or of what
            they are the index: "segment", "joint", "link", "body", "level", "status", "zone".
        columns: in tables, one for each number; "-" for one that is left out.
        begin: where its numbers begin.
        size: how many they are.
    """

    name: str
    kind: str
    columns: tuple[str, ...]
    begin: int
    size: int

    @staticmethod
    def table(rows: Sequence[tuple[str, str, str, int, int]]) -> "tuple[Field, ...]":
        """From a table of the core."""
        return tuple(
            Field(name, kind, tuple(columns.split()), begin, size)
            for name, kind, columns, begin, size in rows
        )


class Lazy:
    """An attribute that is worked out from an instance's `_source` when it is first asked for."""

    __slots__ = ("_name", "_decode")

    def __init__(self, name: str, decode: Decode) -> None:
        self._name, self._decode = name, decode

    def __get__(self, instance: Any, owner: type) -> Any:
        """The value, from then on an ordinary attribute."""
        if instance is None:
            return self
        known = instance.__dict__
        value = known[self._name] = self._decode(*known["_source"])
        return value


class Value:
    """Base of dataclasses that are values; arrays in them are compared element by element."""

    __slots__ = ()

    @classmethod
    def of(cls, *source: Any) -> Self:
        """An instance whose fields are worked out from `source` when they are asked for."""
        value = object.__new__(cls)
        value.__dict__["_source"] = source
        return value

    def replace(self, **changes: Any) -> Self:
        """The same with other values of some fields."""
        return replace(self, **changes)  # type: ignore[type-var]

    def _known(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other) or not isinstance(other, Value):
            return NotImplemented
        theirs = other._known()
        return all(_same(mine, theirs[name]) for name, mine in self._known().items())

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self._known())

    def _told(self) -> dict[str, Any]:
        """The fields that people read, of those that say something."""
        return {name: x for name, x in self._known().items() if _says(x)}

    def __repr__(self) -> str:
        told = [f"{name}={told_shortly(x)}" for name, x in self._told().items()]
        return f"{type(self).__name__}({', '.join(told)})"

    def _repr_html_(self) -> str:
        """The value as a notebook shows it: a row for each field that says something."""
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{_cell(name, x)}</td></tr>"
            for name, x in self._told().items()
        )
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"


def lazily(cls: type, decoders: dict[str, Decode]) -> None:
    """Lets fields of a dataclass be worked out when they are asked for.

    Raises:
        TypeError: a field of the class has no decoder.
    """
    missing = [field.name for field in fields(cls) if field.name not in decoders]
    if missing:
        raise TypeError(f"{cls.__name__}: the core does not tell {', '.join(missing)}")
    for field in fields(cls):
        setattr(cls, field.name, Lazy(field.name, decoders[field.name]))


def _restored(cls: type, known: dict[str, Any]) -> Any:
    return cls(**known)


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        if a is None or b is None:
            return False
        return np.array_equal(a, b, equal_nan=True)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b) or (a != a and b != b)


def _says(value: Any) -> bool:
    return not (value is None or (isinstance(value, list | tuple) and not value))


def _cell(name: str, value: Any) -> str:
    """What stands in a cell of a notebook: a table of values, a probability with a bar, or text."""
    if isinstance(value, list | tuple) and value and all(isinstance(x, Value) for x in value):
        told = [part._told() for part in value]
        names = [field.name for field in fields(value[0]) if any(field.name in x for x in told)]
        head = "".join(f"<th>{escape(key)}</th>" for key in names)
        rows = "".join(
            "<tr>"
            + "".join(f"<td>{_cell(key, row[key]) if key in row else '-'}</td>" for key in names)
            + "</tr>"
            for row in told
        )
        return f"<table><tr>{head}</tr>{rows}</table>"
    if name in PROBABILITIES:
        return f'<meter min="0" max="1" value="{value:.4f}">{value:.4f}</meter> {value:.3g}'
    return escape(told_shortly(value))


def told_shortly(value: Any) -> str:
    """A value in a few words, arrays to four digits."""
    if isinstance(value, np.ndarray):
        return np.array2string(value, precision=4, suppress_small=True, separator=", ").replace(
            "\n", ""
        )
    if isinstance(value, str):
        return repr(str(value))
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(told_shortly(x) for x in value)}]"
    return repr(value)
