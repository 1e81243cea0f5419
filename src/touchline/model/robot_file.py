# SPDX-License-Identifier: Apache-2.0
"""Writes new values into a robot description and leaves all else in it as it stands."""

import os
import re
from pathlib import Path
from typing import Any

import yaml

from touchline.errors import InputError
from touchline.folder import check_file, replaced_file
from touchline.model.packages import shipped_descriptions
from touchline.model.yaml_file import read_yaml

KEY = re.compile(r"^(?:([A-Za-z_][\w-]*)|\"([^\"]+)\"|'([^']+)')\s*:")


NAMED = "joints", "force_torque_sensors"  # lists whose entries have names


def write_description(source: Path, out: Path, changes: dict[str, Any]) -> None:
    """Writes a description with new values, and checks that it says what was meant.

    Comments and order of all other keys stay. Paths relative to the file are made to hold from
    where `out` is.

    Args:
        source: the description.
        out: where the new one will stand; may be the same.
        changes: top-level key -> keys within it -> new value; of `joints` and
            `force_torque_sensors` name -> keys of that entry -> new value; a list or a text
            replaces what stands there.

    Raises:
        InputError: the file cannot be written.
    """
    data = read_yaml(source)
    moved = _moved_paths(source, out, data)
    expected = data | moved
    lines = source.read_text(encoding="utf-8").splitlines()
    for key, value in moved.items():
        lines = _replaced(lines, key, _dumped(key, value))
    for key, values in changes.items():
        if isinstance(values, str):
            lines = _replaced(lines, key, _dumped(key, values))
            expected[key] = values
            continue
        if key in NAMED:
            values = _named(data.get(key) or [], values)
        if key == "loads":
            values = [*(data.get(key) or []), *values[len(data.get(key) or []) :]]
        if isinstance(values, list):
            lines = _listed(lines, key, data.get(key) or [], values)
            expected[key] = values
            continue
        expected[key] = (data.get(key) or {}) | values
        lines = _merged(lines, key, values, expected[key])
    check_file(out)
    with replaced_file(out) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")
        if not _says(part, expected):  # an unusual layout: written anew, without comments
            part.write_text(_dumped_all(expected), encoding="utf-8")


def _named(entries: list[dict[str, Any]], changes: dict[str, Any]) -> list[dict[str, Any]]:
    """Entries with new values in those that are named; new entries where there are none."""
    if not entries:
        return [{"name": name} | values for name, values in changes.items()]
    return [entry | changes.get(str(entry.get("name")), {}) for entry in entries]


def _listed(lines: list[str], key: str, old: list[Any], new: list[Any]) -> list[str]:
    """The lines with a list's entries replaced where they changed, comments beside them kept."""
    found = _block(lines, key)
    whole = [f"{key}:", *(f"  - {flow(entry)}" for entry in new)]
    if found is None:
        return [*lines, *whole]
    start, end = found
    inner = lines[start + 1 : end]
    places = [i for i, line in enumerate(inner) if re.match(r"^\s*- ", line)]
    one_line = all(
        not line.strip() or line.lstrip().startswith(("#", "- {")) and "}" in line + "#}"
        for line in inner
    )
    if not one_line or len(places) != len(old) or len(new) < len(old):
        return [*lines[:start], *whole, *lines[end:]]
    indent = inner[places[0]][: len(inner[places[0]]) - len(inner[places[0]].lstrip())]
    for place, before, after in zip(places, old, new, strict=False):
        if before != after:
            _, mark, comment = inner[place].rpartition("}")[2].partition("#")
            tail = f"  #{comment}" if mark else ""
            inner[place] = f"{indent}- {flow(after)}{tail}"
    inner += [f"{indent}- {flow(entry)}" for entry in new[len(old) :]]
    return [*lines[: start + 1], *inner, *lines[end:]]


def flow(entry: Any) -> str:
    """A value as YAML in one line."""
    text = yaml.dump(
        entry,
        Dumper=_Dumper,
        default_flow_style=True,
        sort_keys=False,
        allow_unicode=True,
        width=10**6,
    )
    return text.strip()


def _says(path: Path, expected: dict[str, Any]) -> bool:
    try:
        return read_yaml(path) == expected
    except InputError:
        return False


def _merged(lines: list[str], key: str, values: dict[str, Any], whole: dict[str, Any]) -> list[str]:
    """The lines with some keys replaced within the block of a top-level key."""
    found = _block(lines, key)
    if found is None:
        return [*lines, *_dumped(key, values)]
    start, end = found
    head, inner = lines[start], lines[start + 1 : end]
    bare = not head.split(":", 1)[1].split("#")[0].strip()
    indents = [len(line) - len(line.lstrip()) for line in inner if line.strip()]
    if not bare or not indents or not min(indents):
        return [*lines[:start], *_dumped(key, whole), *lines[end:]]
    step = min(indents)
    inner = [line[step:] for line in inner]
    for name, value in values.items():
        inner = _replaced(inner, name, _dumped(name, value))
    return [*lines[:start], head, *(" " * step + line for line in inner), *lines[end:]]


def _moved_paths(source: Path, out: Path, data: dict[Any, Any]) -> dict[str, Any]:
    here, there = source.resolve().parent, out.resolve().parent
    if here == there:
        return {}
    changes: dict[str, Any] = {}
    model = data.get("model")
    if isinstance(model, str) and not re.match(r"^\w+:", model) and not Path(model).is_absolute():
        shipped = [name for name, path in shipped_descriptions().items() if path == source]
        changes["model"] = f"robot:{shipped[0]}" if shipped else _relative(here / model, there)
    rest = data.get("learned_rest")
    if isinstance(rest, str) and not Path(rest).is_absolute():
        changes["learned_rest"] = _relative(here / rest, there)
    folders = data.get("package_dirs")
    if isinstance(folders, list):
        changes["package_dirs"] = [
            folder if Path(folder).is_absolute() else _relative(here / folder, there)
            for folder in folders
        ]
    return changes


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _replaced(lines: list[str], key: str, block: list[str]) -> list[str]:
    """The lines with the block of a key replaced, or added at the end."""
    found = _block(lines, key)
    if found is None:
        return [*lines, *block]
    return [*lines[: found[0]], *block, *lines[found[1] :]]


def _block(lines: list[str], key: str) -> tuple[int, int] | None:
    """From where to where a key and its value stand; comments after it do not belong to it."""
    start = next((i for i, line in enumerate(lines) if _key_of(line) == key), None)
    if start is None:
        return None
    end = start + 1
    for i in range(start + 1, len(lines)):
        line = lines[i]
        if line[:1] not in ("", " ", "\t", "#", "-", "}", "]"):
            break
        if line.strip() and not line.startswith("#"):
            end = i + 1
    return start, end


def _key_of(line: str) -> str | None:
    match = KEY.match(line)
    return next(group for group in match.groups() if group) if match else None


class _Dumper(yaml.SafeDumper):
    """Mappings by lines, short lists in one line, numbers as YAML 1.2 and 1.1 both read them."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _float(dumper: yaml.SafeDumper, value: float) -> yaml.ScalarNode:
    text = repr(float(value)).replace("inf", ".inf").replace("nan", ".nan")
    mantissa, _, exponent = text.partition("e")
    if exponent and "." not in mantissa:
        text = f"{mantissa}.0e{exponent}"
    return dumper.represent_scalar("tag:yaml.org,2002:float", text)


def _list(dumper: yaml.SafeDumper, value: list[Any]) -> yaml.SequenceNode:
    flat = all(not isinstance(item, dict | list) for item in value)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", value, flow_style=flat)


def _dict(dumper: yaml.SafeDumper, value: dict[Any, Any]) -> yaml.MappingNode:
    flat = (
        dumper.default_flow_style is True
        or bool(value)
        and all(
            not isinstance(item, dict) and not (isinstance(item, list) and len(item) > 3)
            for item in value.values()
        )
    )
    return dumper.represent_mapping("tag:yaml.org,2002:map", value, flow_style=flat)


_Dumper.add_representer(float, _float)
_Dumper.add_representer(list, _list)
_Dumper.add_representer(dict, _dict)


def _dumped(key: str, value: Any) -> list[str]:
    if not isinstance(value, dict):
        return _text({key: value}).splitlines()
    lines = [f"{key}:"]
    for inner, item in value.items():
        lines += ["  " + line for line in _text({inner: item}).splitlines()]
    return lines


def _text(value: dict[str, Any]) -> str:
    (item,) = value.values()
    if isinstance(item, dict | list):
        (key,) = value
        body = yaml.dump(item, Dumper=_Dumper, sort_keys=False, width=96, allow_unicode=True)
        flow = body.lstrip().startswith(("{", "["))
        if flow:
            return f"{key}: {body}"
        return f"{key}:\n" + "".join(f"  {line}\n" for line in body.splitlines())
    flow = yaml.dump(
        value, Dumper=_Dumper, default_flow_style=True, allow_unicode=True, width=10**6
    )
    return flow.strip()[1:-1] + "\n"  # without the braces


def _dumped_all(data: dict[str, Any]) -> str:
    return "".join("\n".join(_dumped(key, value)) + "\n" for key, value in data.items())
