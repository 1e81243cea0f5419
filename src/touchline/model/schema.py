# SPDX-License-Identifier: Apache-2.0
"""The keys of `robot.yaml`, and how cattrs turns them into dataclasses.

`structure` never stops at the first error: what is wrong is noted and taken out, and the rest is
read again, so that names and shapes can still be checked against the model.
"""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, field, fields, is_dataclass
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
from touchline.model.description import (
    ZONES,
    BaselineDescription,
    CalibrationDescription,
    DetectionDescription,
    ForceLimit,
    Friction,
    LevelDescription,
    LinkCorrection,
    Load,
    Onset,
    PolicyDescription,
    PolicyRule,
    RetractDescription,
    RowCalibration,
    TailDescription,
    Vector,
)
from touchline.model.values import Hook, Torque, kind_of, show
from touchline.suggest import did_you_mean

Where = tuple[str | int, ...]
MISSING = "is missing"
TAKEN_OUT = object()  # stands where an unreadable item of a list or a required value was


@dataclass(frozen=True)
class JointEntry:
    """An item of `joints`."""

    name: str
    torque: Torque = Torque()
    sign: float = 1.0
    gain: float = 1.0
    bias: float = 0.0
    delay: float = 0.0
    range: float = float("inf")
    compensated: str = "none"
    rotor_inertia: float = 0.0
    friction: Friction = field(default_factory=Friction)


@dataclass(frozen=True)
class PoseEntry:
    """The `pose` of a sensor."""

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SensorEntry:
    """An item of `force_torque_sensors`; `bias` and `range` as they stand, None for the default."""

    name: str
    link: str
    pose: PoseEntry = PoseEntry()
    axes: tuple[str, ...] = values.AXES
    polarity: str = "outboard"
    frame: str = "sensor"
    compensated: str = "none"
    bias: Vector | None = None
    delay: float = 0.0
    range: Vector | None = None


@dataclass(frozen=True)
class ObserverEntry:
    """The key `observer`."""

    bandwidth: Any = 100.0


@dataclass(frozen=True)
class RobotFile:
    """A whole `robot.yaml` as it stands.

    An item of a list that could not be read is None, and so is a required value (`name`, `link`).
    """

    name: str | None = None
    model: str | None = None
    package_dirs: list[str] = field(default_factory=list)
    gravity: Vector | None = None
    joints: list[JointEntry] | None = None
    locked: dict[str, float] = field(default_factory=dict)
    force_torque_sensors: list[SensorEntry] = field(default_factory=list)
    loads: list[Load] = field(default_factory=list)
    links: dict[str, LinkCorrection] = field(default_factory=dict)
    graspable: list[str] = field(default_factory=list)
    noise: dict[str, Any] = field(default_factory=dict)
    observer: ObserverEntry = ObserverEntry()
    detection: DetectionDescription = field(default_factory=DetectionDescription)
    policy: PolicyDescription = field(default_factory=PolicyDescription)
    log: dict[str, Any] = field(default_factory=dict)


def _bandwidth(value: Any, _: Any = None) -> Any:
    if not isinstance(value, dict):
        return values.positive(value)
    return {values.text(key): item for key, item in value.items()}


def _by_sensor(value: Any, _: Any = None) -> Any:
    if not isinstance(value, dict):
        return values.positive(value)
    return {values.text(key): values.positive(item) for key, item in value.items()}


def _zones(value: Any, _: Any = None) -> Any:
    _require_mapping(value, f"; it gives links or segments a zone: {', '.join(ZONES)}")
    return {values.text(key): values.one_of(*ZONES)(item) for key, item in value.items()}


_VECTOR3 = values.list_of(values.number, 3)
_AXIS_COUNTS = range(1, 7)
_NAME = {"name": values.text}
_LINK = {"link": values.text}
_MASS = {"mass": values.non_negative, "com": _VECTOR3, "inertia": values.inertia}
HOOKS: dict[type, dict[str, Hook]] = {
    Friction: {
        "coulomb": values.non_negative,
        "viscous": values.non_negative,
        "coulomb_width": values.positive,
    },
    Load: _LINK | _MASS,
    LinkCorrection: _MASS,
    PoseEntry: {"xyz": _VECTOR3, "rpy": _VECTOR3},
    JointEntry: _NAME
    | {
        "torque": values.torque,
        "sign": values.sign,
        "gain": values.positive,
        "delay": values.non_negative,
        "range": values.positive_or_inf,
        "compensated": values.one_of("none", "gravity", "model"),
        "rotor_inertia": values.non_negative,
    },
    SensorEntry: _NAME
    | _LINK
    | {
        "axes": values.axes,
        "polarity": values.one_of("outboard", "inboard"),
        "compensated": values.one_of("none", "gravity"),
        "bias": values.list_of(values.number, *_AXIS_COUNTS),
        "delay": values.non_negative,
        "range": values.list_of(values.positive_or_inf, *_AXIS_COUNTS),
    },
    ObserverEntry: {"bandwidth": _bandwidth},
    LevelDescription: {
        "torque": values.number_or_list(values.positive),
        "force": _by_sensor,
        "moment": _by_sensor,
    },
    BaselineDescription: {"time": values.positive, "limit": values.non_negative},
    RowCalibration: {
        "typical": values.positive,
        "slow": values.list_of(values.non_negative, 3),
        "quick": values.list_of(values.non_negative, 3),
    },
    TailDescription: {
        "level": values.positive,
        "per_hour": values.positive,
        "scale": values.positive,
        "shape": values.number,
    },
    CalibrationDescription: {"hours": values.positive, "period": values.positive},
    DetectionDescription: {
        "method": values.methods,
        "false_alarms": values.positive,
        "windows": values.windows,
        "min_duration": values.non_negative,
        "hold": values.non_negative,
        "release": values.fraction,
    },
    Onset: dict.fromkeys(ZONES, values.positive),
    PolicyRule: {
        "reaction": values.reaction,
        "level": values.one_of("contact", "collision"),
        "clamped": values.truth,
        "zone": values.one_of(*ZONES),
        "segment": values.text,
        "link": values.text,
        "force": values.positive,
    },
    ForceLimit: {
        "transient": values.positive,
        "quasi_static": values.positive,
        "reaction": values.reaction,
    },
    RetractDescription: {"way": values.positive, "speed": values.positive},
    PolicyDescription: {"zones": _zones, "transient_time": values.positive},
    RobotFile: {"name": values.text, "model": values.text, "gravity": _VECTOR3},
}


def _class_hook(cls: type, converter: cattrs.Converter) -> Hook:
    # Options of make_dict_structure_fn start with an underscore, which no key does.
    overrides = {name: override(struct_hook=_present(hook)) for name, hook in HOOKS[cls].items()}
    read = make_dict_structure_fn(cls, converter, _cattrs_forbid_extra_keys=True, **overrides)  # type: ignore[arg-type]

    def check(value: Any, _: Any) -> Any:
        _require_mapping(value, f"; its keys: {', '.join(_keys(cls))}")
        return read(value, cls)

    return check


def _present(hook: Hook) -> Hook:
    return lambda value, cls: None if value is TAKEN_OUT else hook(value, cls)


def _mapping_hook(cls: Any, converter: cattrs.Converter) -> Hook:
    read = mapping_structure_factory(cls, converter)

    def check(value: Any, _: Any) -> Any:
        _require_mapping(value)
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
    seen: set[Where] = set()
    while True:
        try:
            return _CONVERTER.structure(data, RobotFile), problems
        except cattrs.ClassValidationError as error:
            for where, what in list(_faults(error, ())):
                if where not in seen:  # a required value taken out is missing then
                    problems.append(f"{spell(where)}: {what}")
                seen.add(where)
                _take_out(data, where, what == MISSING)


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


def _require_mapping(value: Any, more: str = "") -> None:
    if not isinstance(value, dict):
        raise ValueError(f"{show(value)} is {kind_of(value)}, not a mapping{more}")
