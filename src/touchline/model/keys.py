# SPDX-License-Identifier: Apache-2.0
"""What each key of `robot.yaml` may hold, class by class."""

from typing import Any

from touchline.model import values
from touchline.model.description import (
    WIDGETS,
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
    PushDescription,
    RetractDescription,
    RowCalibration,
    TailDescription,
    TaughtTouch,
    WidgetDescription,
)
from touchline.model.entries import JointEntry, ObserverEntry, PoseEntry, RobotFile, SensorEntry
from touchline.model.values import Hook


def _bandwidth(value: Any, _: Any = None) -> Any:
    if not isinstance(value, dict):
        return values.positive(value)
    return {values.text(key): item for key, item in value.items()}


def _by_sensor(value: Any, _: Any = None) -> Any:
    if not isinstance(value, dict):
        return values.positive(value)
    return {values.text(key): values.positive(item) for key, item in value.items()}


def _zones(value: Any, _: Any = None) -> Any:
    values.require_mapping(value, f"; it gives links or segments a zone: {', '.join(ZONES)}")
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
        "stribeck": values.non_negative,
        "stribeck_speed": values.non_negative,
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
    PushDescription: {"friction": values.positive, "reach": values.positive},
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
    TaughtTouch: {"q": values.list_of(values.number), "step": values.list_of(values.number)},
    WidgetDescription: {
        "kind": values.one_of(*WIDGETS),
        "link": values.text,
        "at": _VECTOR3,
        "radius": values.positive,
        "path": values.list_of(_VECTOR3),
        "width": values.positive,
        "normal": _VECTOR3,
        "up": _VECTOR3,
        "size": values.list_of(values.positive, 2),
        "force": values.positive,
        "most": values.positive,
        "range": values.list_of(values.number, 2),
    },
    RetractDescription: {"way": values.positive, "speed": values.positive},
    PolicyDescription: {"zones": _zones, "transient_time": values.positive},
    RobotFile: {
        "name": values.text,
        "model": values.text,
        "gravity": _VECTOR3,
        "learned_rest": values.text,
    },
}
