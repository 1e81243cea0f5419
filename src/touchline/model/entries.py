# SPDX-License-Identifier: Apache-2.0
"""`robot.yaml` as it stands, where that differs from the checked description."""

from dataclasses import dataclass, field
from typing import Any

from touchline.model import values
from touchline.model.description import (
    DetectionDescription,
    Friction,
    LinkCorrection,
    Load,
    PolicyDescription,
    PushDescription,
    Vector,
    WidgetDescription,
)
from touchline.model.values import Torque


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
    learned_rest: str | None = None
    graspable: list[str] = field(default_factory=list)
    noise: dict[str, Any] = field(default_factory=dict)
    observer: ObserverEntry = ObserverEntry()
    detection: DetectionDescription = field(default_factory=DetectionDescription)
    pushes: PushDescription = field(default_factory=PushDescription)
    policy: PolicyDescription = field(default_factory=PolicyDescription)
    interface: dict[str, WidgetDescription] = field(default_factory=dict)
    log: dict[str, Any] = field(default_factory=dict)
