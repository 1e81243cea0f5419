# SPDX-License-Identifier: Apache-2.0
"""From what YAML holds to dataclasses, by cattrs.

`structure` never stops at the first error: what is wrong is noted and taken out, and the rest is
read again, so that names and shapes can still be checked against the model.
"""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_origin

import cattrs
from cattrs.cols import mapping_structure_factory
from cattrs.errors import (
    AttributeValidationNote,
    ForbiddenExtraKeysError,
    IterableValidationError,
    IterableValidationNote,
)
from cattrs.gen import make_dict_structure_fn, override

from touchline.model import values
from touchline.model.entries import RobotFile
from touchline.model.keys import HOOKS
from touchline.model.values import Hook, kind_of, show
from touchline.suggest import did_you_mean

Where = tuple[str | int, ...]
MISSING = "is missing"
TAKEN_OUT = object()  # stands where an unreadable item of a list or a required value was


def _class_hook(cls: type, converter: cattrs.Converter) -> Hook:
    # Options of make_dict_structure_fn start with an underscore, which no key does.
    overrides = {
        name: override(struct_hook=_present(HOOKS[cls].get(name, converter.structure)))
        for name in _keys(cls)
    }
    read = make_dict_structure_fn(cls, converter, _cattrs_forbid_extra_keys=True, **overrides)  # type: ignore[arg-type]

    def check(value: Any, _: Any) -> Any:
        values.require_mapping(value, f"; its keys: {', '.join(_keys(cls))}")
        return read(value, cls)

    return check


def _present(hook: Hook) -> Hook:
    return lambda value, cls: None if value is TAKEN_OUT else hook(value, cls)


def _mapping_hook(cls: Any, converter: cattrs.Converter) -> Hook:
    read = mapping_structure_factory(cls, converter)

    def check(value: Any, _: Any) -> Any:
        values.require_mapping(value)
        for key in value:
            if not isinstance(key, str):
                raise ValueError(f"the key {show(key)} is {kind_of(key)}, not text")
        return read(value, cls)

    return check


def _list_hook(cls: Any, converter: cattrs.Converter) -> Hook:
    (item_type,) = get_args(cls)

    def check(value: Any, _: Any) -> list[Any]:
        if not isinstance(value, list):
            raise ValueError(f"{show(value)} is {kind_of(value)}, not a list")
        items, errors = [], []
        for index, item in enumerate(value):
            try:
                read = item is not TAKEN_OUT
                items.append(converter.structure(item, item_type) if read else None)
            except Exception as error:
                error.add_note(IterableValidationNote(f"item {index}", index, item_type))
                errors.append(error)
        if errors:
            raise IterableValidationError("list", errors, cls)  # type: ignore[call-arg]
        return items

    return check


def _make_converter() -> cattrs.Converter:
    converter = cattrs.Converter(detailed_validation=True)
    converter.register_structure_hook(float, values.number)
    converter.register_structure_hook(str, values.text)
    converter.register_structure_hook_factory(
        lambda cls: is_dataclass(cls) and cls in HOOKS, _class_hook
    )
    converter.register_structure_hook_factory(lambda cls: get_origin(cls) is list, _list_hook)
    converter.register_structure_hook_factory(lambda cls: get_origin(cls) is dict, _mapping_hook)
    return converter


_CONVERTER = _make_converter()


def structure(data: dict[Any, Any]) -> tuple[RobotFile, list[str]]:
    """Return the readable part of the data, and a line `KEY: what is wrong` for each error."""
    data = {key: deepcopy(value) for key, value in data.items() if value is not None}
    problems: list[str] = []
    taken: set[tuple[Where, bool]] = set()
    while True:
        try:
            return _CONVERTER.structure(data, RobotFile), problems
        except cattrs.ClassValidationError as error:
            faults = [(*fault, fault[1] == MISSING) for fault in _faults(error, ())]
            if taken.issuperset((where, missing) for where, _, missing in faults):
                raise  # what was taken out is still at fault
            for where, what, missing in faults:
                # A required value that was taken out is missing then: not another problem.
                if not taken & {(where, True), (where, False)}:
                    problems.append(f"{spell(where)}: {what}")
                taken.add((where, missing))
                _take_out(data, where, missing)


def spell(where: Where) -> str:
    """Return a place in the file as `joints[2].torque`."""
    inner = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in where[1:])
    return f"{where[0]}{''.join(inner)}"


def _faults(error: BaseException, where: Where) -> Iterator[tuple[Where, str]]:
    """Yield (place, what is wrong) for each leaf of a cattrs error."""
    if isinstance(error, cattrs.BaseValidationError):
        for inner in error.exceptions:
            yield from _faults(inner, (*where, *_steps(inner)))
    elif isinstance(error, ForbiddenExtraKeysError):
        allowed = _keys(error.cl)
        for key in sorted(error.extra_fields, key=str):
            what = f"unknown key; allowed: {', '.join(allowed)}{did_you_mean(key, allowed)}"
            yield (*where, key), what
    else:
        yield where, MISSING if isinstance(error, KeyError) else str(error)


def _steps(error: BaseException) -> Where:
    """Return the key or index that cattrs noted on an error."""
    for note in getattr(error, "__notes__", ()):
        if isinstance(note, AttributeValidationNote):
            return (note.name,)
        if isinstance(note, IterableValidationNote):
            return (note.index,)
    return ()


def _take_out(data: Any, where: Where, missing: bool) -> None:
    """Remove a place from nested mappings and lists, or mark it as taken out there."""
    last: Any = where[-1]
    for part in where[:-1]:
        data = data[part]
    if missing or isinstance(data, list):
        data[last] = TAKEN_OUT
    else:
        data.pop(last, None)  # an alias may share the mapping


def _keys(cls: type) -> list[str]:
    return [entry.name for entry in fields(cls)]
