# SPDX-License-Identifier: Apache-2.0
"""What `robot.yaml` says: the contract's keys as frozen dataclasses."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.model.learned_rest import LearnedRest
from touchline.native import core

Vector = tuple[float, ...]
AXES = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass(frozen=True)
class Friction:
    """Joint friction [Nm]: `dry(qd) + viscous * qd`.

    Dry friction is `(coulomb + stribeck * exp(-(qd / stribeck_speed)^2)) * tanh(qd / width)` with
    `coulomb_width`: it falls with speed where `stribeck` is not 0.
    """

    coulomb: float = 0.0
    viscous: float = 0.0
    coulomb_width: float = 0.05
    stribeck: float = 0.0
    stribeck_speed: float = 0.0

    def dry(self, speed: Array) -> Array:
        """Dry friction [Nm] at speeds [rad/s]."""
        turn = np.tanh(speed / self.coulomb_width)
        if not self.stribeck:
            return self.coulomb * turn
        return (self.coulomb + self.stribeck * np.exp(-((speed / self.stribeck_speed) ** 2))) * turn


@dataclass(frozen=True)
class JointDescription:
    """One observed joint.

    `torque` is "sensor", "motor", "none" or "from"; then `sources` names sensors. `rest` is what
    was learned of the torque beside all that is described.
    """

    name: str
    torque: str = "sensor"
    sources: tuple[str, ...] = ()
    sign: float = 1.0
    gain: float = 1.0
    bias: float = 0.0
    delay: float = 0.0
    range: float = float("inf")
    compensated: str = "none"
    rotor_inertia: float = 0.0
    friction: Friction = field(default_factory=Friction)
    rest: LearnedRest | None = None

    @property
    def measured(self) -> bool:
        """Whether it has a torque signal of its own."""
        return self.torque in ("sensor", "motor")


@dataclass(frozen=True)
class SensorDescription:
    """One force-torque sensor with 1 to 6 axes."""

    name: str
    link: str
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)
    axes: tuple[str, ...] = AXES
    polarity: str = "outboard"
    frame: str = "sensor"
    compensated: str = "none"
    bias: Vector = (0.0,) * 6
    delay: float = 0.0
    range: Vector = (float("inf"),) * 6


@dataclass(frozen=True)
class Load:
    """A body fixed to `link` that the model lacks; `com` and `inertia` (about com) in link axes."""

    link: str
    mass: float
    com: Vector = (0.0, 0.0, 0.0)
    inertia: Vector = (0.0,) * 6


@dataclass(frozen=True)
class LinkCorrection:
    """Replaces what the model says of one link; None keeps the model's value."""

    mass: float | None = None
    com: Vector | None = None
    inertia: Vector | None = None


@dataclass(frozen=True)
class Noise:
    """One sigma per sample. `q`, `qd`, `tau` have one value per joint, `sensors[name]` six."""

    q: Vector
    qd: Vector
    tau: Vector
    sensors: dict[str, Vector]


@dataclass(frozen=True)
class LevelDescription:
    """Thresholds of one level; None follows from the noise.

    `torque` [Nm]: a number or one per joint; `force` [N] and `moment` [Nm]: a number or by sensor.
    """

    torque: float | Vector | None = None
    force: float | dict[str, float] | None = None
    moment: float | dict[str, float] | None = None


@dataclass(frozen=True)
class BaselineDescription:
    """The slow baseline: its time constant [s], and its limit in multiples of the thresholds."""

    time: float = 5.0
    limit: float = 2.0


@dataclass(frozen=True)
class RowCalibration:
    """What contact-free motion left in one row [N or Nm], written by `calibrate`.

    `typical` is its root mean square. `slow` and `quick` are the sigmas of the model's errors,
    against the slow baseline and against the last 0.2 s: a constant, per rad2/s2 of squared speed,
    per rad/s2 of acceleration.
    """

    typical: float
    slow: Vector = (0.0, 0.0, 0.0)
    quick: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class TailDescription:
    """How often a test exceeded what: a generalized Pareto tail, written by `calibrate`.

    `level` was exceeded `per_hour` times an hour, by excesses of `scale` and `shape`.
    """

    level: float
    per_hour: float
    scale: float
    shape: float = 0.0


@dataclass(frozen=True)
class CalibrationDescription:
    """What `calibrate` found in `hours` of contact-free motion, sampled every `period` [s].

    `rows` are named after joints and `SENSOR.fx` to `SENSOR.mz`; `tails` by segment and method.
    """

    hours: float
    period: float
    rows: dict[str, RowCalibration] = field(default_factory=dict)
    tails: dict[str, dict[str, TailDescription]] = field(default_factory=dict)


@dataclass(frozen=True)
class DetectionDescription:
    """When residuals count as contacts.

    The tests of `method` fire, with thresholds for `false_alarms` per hour of the whole robot as
    far as it is calibrated, after `min_duration` [s]. An event ends when all have been below
    `release` times their thresholds for `hold` [s]. `windows` [s] are those of `glrt`.
    """

    method: tuple[str, ...] = ("rows",)
    false_alarms: float = 1.0
    windows: Vector = (0.002, 0.005, 0.01, 0.02, 0.05)
    calibration: CalibrationDescription | None = None

    contact: LevelDescription = field(default_factory=LevelDescription)
    collision: LevelDescription = field(default_factory=LevelDescription)
    min_duration: float = 0.005
    hold: float = 0.1
    release: float = 0.6
    baseline: BaselineDescription = field(default_factory=BaselineDescription)


@dataclass(frozen=True)
class PushDescription:
    """What touches the arm.

    Pushes come within the cone of the coefficient `friction`, and need `reach` [m] of free space in
    front of the surface: the free length of a finger or a tool. `links` may be touched; default:
    all.
    """

    friction: float = core.Pushes().friction
    reach: float = core.Pushes().reach
    links: list[str] = field(default_factory=list)


ZONES = ("structure", "end_effector", "handle")


@dataclass(frozen=True)
class PolicyRule:
    """A reaction and when it is due: all that is given must hold; None holds always.

    `level` is "contact" or "collision", `zone` one of ZONES, `force` the least force [N].
    """

    reaction: str
    level: str | None = None
    clamped: bool | None = None
    zone: str | None = None
    segment: str | None = None
    link: str | None = None
    force: float | None = None


@dataclass(frozen=True)
class ForceLimit:
    """The largest forces [N] somewhere, for a short while and for longer, and what then is due."""

    transient: float | None = None
    quasi_static: float | None = None
    reaction: str = "retract"


@dataclass(frozen=True)
class Onset:
    """Rates of force [N/s] above which a touch begins like a collision, by zone."""

    structure: float = 800.0
    end_effector: float = 800.0
    handle: float = 1700.0


@dataclass(frozen=True)
class RetractDescription:
    """How far [m] and how fast [m/s] the touched point moves away."""

    way: float = 0.05
    speed: float = 0.25


@dataclass(frozen=True)
class PolicyDescription:
    """What to do about which touch.

    `zones` gives links or segments a zone; of `rules` the first that holds decides; `limits`, by
    link or segment, come before all rules. A force counts as transient for `transient_time` [s].
    """

    zones: dict[str, str] = field(default_factory=dict)
    onset: Onset = Onset()
    rules: list[PolicyRule] = field(default_factory=lambda: [PolicyRule("stop", level="collision")])
    limits: dict[str, ForceLimit] = field(default_factory=dict)
    transient_time: float = 0.5
    retract: RetractDescription = RetractDescription()


WIDGETS = ("button", "toggle", "slider", "dial", "pad")


@dataclass(frozen=True)
class TaughtTouch:
    """A touch that taught a widget, as joint torques feel it.

    `q` [rad or m] and `step` [Nm], one per joint: the posture, and the change of the external
    torque that the touch brought.
    """

    q: Vector
    step: Vector


@dataclass(frozen=True)
class WidgetDescription:
    """A named place on a link that people touch on purpose; lengths in m, in the link's frame.

    A button or toggle has `at` and `radius`, or neither (the whole link), or `taught` touches
    where joint torques alone tell. A slider has a `path` and a `width`; a dial `at`, `normal` and
    `radius`; a pad `at`, `up` and `size`. `force` [N] is the least that counts; from `most` [N]
    on a touch is a contact for the reaction policy, not a command. A slider reports values from
    the first to the second number of `range`.
    """

    kind: str
    link: str | None = None
    at: Vector | None = None
    radius: float | None = None
    path: tuple[Vector, ...] = ()
    width: float = 0.03
    normal: Vector | None = None
    up: Vector | None = None
    size: Vector | None = None
    force: float = 3.0
    most: float = 40.0
    range: Vector = (0.0, 1.0)
    taught: list[TaughtTouch] = field(default_factory=list)


@dataclass(frozen=True)
class RobotDescription:
    """A whole `robot.yaml`, checked; per-joint values are expanded to the order of `joints`.

    `graspable` names the links that a hand may close around: they can be pulled and twisted, not
    only pushed.
    """

    name: str
    model: Path
    joints: tuple[JointDescription, ...]
    sensors: tuple[SensorDescription, ...]
    noise: Noise
    bandwidth_joints: Vector
    bandwidth_sensors: dict[str, float]
    package_dirs: tuple[Path, ...] = ()
    gravity: Vector | None = None
    locked: dict[str, float] = field(default_factory=dict)
    loads: tuple[Load, ...] = ()
    links: dict[str, LinkCorrection] = field(default_factory=dict)
    graspable: tuple[str, ...] = ()
    pushes: PushDescription = field(default_factory=PushDescription)
    detection: DetectionDescription = field(default_factory=DetectionDescription)
    policy: PolicyDescription = field(default_factory=PolicyDescription)
    interface: dict[str, WidgetDescription] = field(default_factory=dict)
    log: dict[str, Any] = field(default_factory=dict)
    path: Path | None = None
