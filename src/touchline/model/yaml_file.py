# SPDX-License-Identifier: Apache-2.0
"""YAML 1.2 as people expect it: `1e-3` is a number, `off` is text, a key stands once.

PyYAML reads YAML 1.1, where `1e-3` is text, `010` is eight and `1:30` is ninety.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from touchline.errors import InputError

MAP_TAG = "tag:yaml.org,2002:map"
DEEPEST = 50  # mappings and lists within each other; a description has five


class TooDeepError(ValueError):
    """More than `DEEPEST` mappings and lists stand within each other; begins with line, column."""

    def __init__(self, mark: yaml.Mark) -> None:
        super().__init__(
            f"{mark.line + 1}:{mark.column + 1}: more than {DEEPEST} mappings and lists "
            "stand within each other"
        )


class Yaml12Loader(yaml.SafeLoader):
    """A safe loader with the scalar rules of YAML 1.2's core schema (and merge keys)."""

    yaml_implicit_resolvers: dict[str, list[Any]] = {}
    depth = 0  # mappings and lists around what is read

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Refuse what the readers, which call themselves for each level, could not get through."""
        if not self.check_event(yaml.CollectionStartEvent):
            return super().compose_node(parent, index)
        self.depth += 1
        if self.depth > DEEPEST:
            raise TooDeepError(self.peek_event().start_mark)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def _construct_int(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int | float:
    text = loader.construct_scalar(node).lower()
    if text.lstrip("+-").startswith(("0o", "0x")):
        return int(text, 0)
    return int(text) if len(text) < 400 else float(text)  # Python refuses very long integers


def _construct_float(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> float:
    return float(
        loader.construct_scalar(node).lower().replace(".inf", "inf").replace(".nan", "nan")
    )


def _add_rules() -> None:
    rules = {
        "bool": (r"true|True|TRUE|false|False|FALSE", "tTfF"),
        "int": (r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
        "float": (
            r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
            r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
            "-+0123456789.",
        ),
        "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
        "merge": (r"<<", "<"),
    }
    for name, (pattern, first) in rules.items():
        tag = f"tag:yaml.org,2002:{name}"
        Yaml12Loader.add_implicit_resolver(tag, re.compile(f"^(?:{pattern})$"), list(first))
    Yaml12Loader.add_constructor("tag:yaml.org,2002:int", _construct_int)
    Yaml12Loader.add_constructor("tag:yaml.org,2002:float", _construct_float)


_add_rules()


def read_yaml(path: Path) -> dict[Any, Any]:
    """Read a YAML file whose top level is a mapping.

    Raises:
        InputError: the file is missing, is no YAML (with line and column), repeats a key, holds
            no mapping, or is nested too deeply.
    """
    text = read_text(path)
    try:
        loader = Yaml12Loader(text)
        node = loader.get_single_node()
        if node is None:
            raise InputError(f"{path}: the file is empty")
        repeated = [f"{path}:{line}" for line in _repeated_keys(node)]
        if repeated:
            raise InputError(repeated)
        data = loader.construct_document(node)
    except TooDeepError as error:
        raise InputError(f"{path}:{error}") from None
    except yaml.YAMLError as error:
        raise InputError(_syntax_problem(path, error)) from None
    if not isinstance(data, dict):
        raise InputError(f"{path}: the file holds {kind_of(data)}, not a mapping of keys")
    return data


def read_text(path: Path) -> str:
    """Read a UTF-8 text file; every failure is an InputError that names the file."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file (byte {error.start} is not UTF-8)") from None


def read_bytes(path: Path) -> bytes:
    """Read a file; every failure is an InputError that names it."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def kind_of(value: Any) -> str:
    """Name the YAML kind of a value, with its article."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, bool):
        return "a truth value"
    if value is None:
        return "nothing"
    return "a number" if isinstance(value, int | float) else "text"


def _repeated_keys(root: yaml.Node) -> Iterator[str]:
    """Yield `LINE: key ... stands twice` for each repeated key of any mapping below `root`."""
    pending, seen = [root], set()
    while pending:
        node = pending.pop()
        if id(node) in seen or isinstance(node, yaml.ScalarNode):
            continue
        seen.add(id(node))
        if isinstance(node, yaml.MappingNode):
            yield from _repeats_in(node)
            pending += [part for pair in reversed(node.value) for part in reversed(pair)]
        else:
            pending += reversed(node.value)


def _repeats_in(node: yaml.MappingNode) -> Iterator[str]:
    first: dict[str, int] = {}
    for key, _ in node.value:
        if not isinstance(key, yaml.ScalarNode):
            continue
        line = key.start_mark.line + 1
        if key.value in first:
            yield f"{line}: the key '{key.value}' stands twice (first in line {first[key.value]})"
        first.setdefault(key.value, line)


def _syntax_problem(path: Path, error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    what = getattr(error, "problem", None) or str(error).splitlines()[0]
    context = getattr(error, "context", None)
    where = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else str(path)
    return f"{where}: not valid YAML: {what}" + (f" ({context})" if context else "")
