# SPDX-License-Identifier: Apache-2.0
"""What a command says of itself: its docstring taken apart, for `--help` and the reference."""

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType, NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from tyro.conf import arg

INDENT = "    "


@dataclass(frozen=True)
class Explanation:
    """A command in words.

    Attributes:
        about: paragraphs without line breaks of their own; examples stand alone.
        meanings: of each argument, in one line.
    """

    about: tuple[str, ...]
    meanings: dict[str, str]


def explanation(command: Callable[..., int]) -> Explanation:
    """Take the docstring of a command apart."""
    text = inspect.cleandoc(command.__doc__ or "")
    about, _, arguments = text.partition("Args:\n")
    meanings: dict[str, str] = {}
    name = ""
    for line in arguments.splitlines():
        match = re.match(rf"^{INDENT}(\w+): (.*)$", line)
        if match:
            name = match[1]
            meanings[name] = match[2]
        elif line.strip() and name:
            meanings[name] += " " + line.strip()
    return Explanation(tuple(map(_joined, about.strip().split("\n\n"))), meanings)


def _joined(paragraph: str) -> str:
    return " ".join(line.strip() for line in paragraph.splitlines())


def for_help(command: Callable[..., int]) -> Callable[..., int]:
    """Return a copy of a command whose `--help` reads well.

    Lines are broken by the terminal's width alone, and a default is told where it says something:
    not where it is None, empty or "no", nor where the meaning tells it.
    """
    assert isinstance(command, FunctionType)
    told = explanation(command)
    copy = FunctionType(
        command.__code__,
        command.__globals__,
        command.__name__,
        command.__defaults__,
        command.__closure__,
    )
    copy.__kwdefaults__ = command.__kwdefaults__
    copy.__module__ = command.__module__
    hints = get_type_hints(command, include_extras=True)
    for name, parameter in inspect.signature(command).parameters.items():
        hint = arg(help_behavior_hint=default_hint(parameter.default, told.meanings.get(name, "")))
        hints[name] = Annotated[hints[name], hint]
    copy.__annotations__ = hints
    lines = [f"{INDENT}{name}: {meaning}" for name, meaning in told.meanings.items()]
    copy.__doc__ = "\n".join(["\n\n".join(told.about), "", "Args:", *lines])
    return copy


def default_hint(default: Any, meaning: str) -> str:
    """Return what `--help` says of a default."""
    if default is inspect.Parameter.empty:
        return "(required)"
    if default is None or default is False or default in ((), "") or "efault" in meaning:
        return ""
    return f"(default: {default_text(default)})"


def default_text(default: Any) -> str:
    """Return a default as it would be typed."""
    if default is None or default == ():
        return "-"
    if isinstance(default, bool):
        return "yes" if default else "no"
    if isinstance(default, tuple):
        return " ".join(map(str, default))
    return f"{default:g}" if isinstance(default, float) else str(default)


TYPES = {bool: "yes or no", int: "whole number", float: "number", str: "text", Path: "path"}


def types_of(command: Callable[..., int]) -> dict[str, str]:
    """Return the type of each argument in words."""
    return {name: type_text(hint) for name, hint in get_type_hints(command).items()}


def type_text(hint: Any) -> str:
    """Return a type in words; of something optional the type that it has if it is there."""
    if hint in TYPES:
        return TYPES[hint]
    parts = [part for part in get_args(hint) if part not in (NoneType, Ellipsis)]
    if get_origin(hint) is Literal:
        return ", ".join(map(str, parts[:-1])) + f" or {parts[-1]}"
    if get_origin(hint) is tuple:
        return f"several: {type_text(parts[0])}"
    return " or ".join(map(type_text, parts))
