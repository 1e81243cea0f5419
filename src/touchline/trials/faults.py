# SPDX-License-Identifier: Apache-2.0
"""Faults of sensors and clocks, put into recordings; nothing here knows how they are found."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.model.description import AXES
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

SIGNALS = ("q", "qd", "tau", "wrench")
SPIKE = {"q": 3.0, "qd": 2.0, "tau": 80.0, "fx": 300.0, "mx": 80.0}  # rad, rad/s, Nm, N, Nm
BIAS = {"q": 0.05, "qd": 0.2, "tau": 5.0, "fx": 15.0, "mx": 3.0}
DRIFT = {"q": 0.05, "qd": 0.2, "tau": 5.0, "fx": 15.0, "mx": 3.0}  # per second
SHORT, LONG, LONGEST = 0.3, 1.4, 2.2  # s that a fault lasts
DELAY = 0.02  # s
AT_ONCE, SOON, SLOW, SLOWEST = 0.0015, 0.05, 1.0, 2.0  # s within which a fault is to be told


@dataclass(frozen=True)
class Channel:
    """One channel, or a whole sensor.

    Attributes:
        signal: "q", "qd", "tau" or "wrench"; "time" for the stamps.
        index: of the joint or sensor.
        axis: 0 to 5 of a sensor; None: all of them.
        name: as in logs; of a whole sensor, its own.
    """

    signal: str
    index: int
    axis: int | None
    name: str

    @property
    def unit(self) -> str:
        """Key of the tables of sizes."""
        if self.signal != "wrench":
            return self.signal
        return "fx" if self.axis is None or self.axis < 3 else "mx"

    def of(self, samples: Samples) -> Array:
        """The numbers (N,) or (N, 6), to be changed in place."""
        values = getattr(samples, self.signal)
        if self.signal == "wrench" and self.axis is not None:
            return values[:, self.index, self.axis]
        return values[:, self.index]


@dataclass(frozen=True)
class FaultType:
    """A type of fault.

    Attributes:
        name: for tables.
        change: of the channel's values, in place: values from the fault's beginning to its end,
            the values before, the channel, a source of chance, the period [s].
        on: signals that may have it; "sensor" for whole sensors, "time" for the clock.
        within: the time within which it is to be told [s].
        group: line of the table of goals.
        seconds: that it lasts.
    """

    name: str
    change: Callable[[Array, Array, Channel, np.random.Generator, float], None]
    on: tuple[str, ...]
    within: float
    group: str
    seconds: float = SHORT


def _spike(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[0] += rng.choice([-1.0, 1.0]) * SPIKE[c.unit]


def _spikes(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    hit = rng.random(len(x)) < 0.02
    hit[0] = True
    x[hit] += SPIKE[c.unit] * rng.choice([-1.0, 1.0], x[hit].shape)


def _stuck(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:] = x[0]


def _zero(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:] = 0.0


def _garbage(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:] = SPIKE[c.unit] * rng.uniform(-1.0, 1.0, x.shape)


def _rail(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:] = 2.0 * SPIKE[c.unit]


def _clipped(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    np.minimum(x, np.quantile(past, 0.3), out=x)


def _sign(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x *= -1.0


def _double(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x *= 2.0


def _half(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x *= 0.5


def _delay(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    late = max(1, round(DELAY / period))
    x[:] = np.concatenate([past[-late:], x])[: len(x)]


def _bias(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x += rng.choice([-1.0, 1.0]) * BIAS[c.unit]


def _drift(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x += rng.choice([-1.0, 1.0]) * DRIFT[c.unit] * period * np.arange(len(x))


def _noisy(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x += 0.2 * SPIKE[c.unit] * rng.normal(size=x.shape)


def _coarse(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    grid = 0.05 * SPIKE[c.unit]
    x[:] = grid * np.round(x / grid)


def _nan(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:] = np.nan


def _infinite(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:] = np.inf


def _absurd(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:] = 1e12


def _swap(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:] = x[:, [1, 0, 2, 3, 4, 5]]


def _repeat(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[1] = x[0]


def _back(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[0] -= 2.5 * period


def _gap(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x += 0.03


def _no_stamp(x: Array, past: Array, c: Channel, rng: np.random.Generator, period: float) -> None:
    x[:5] = np.nan


LOADS, ALL = ("tau", "wrench"), SIGNALS
SPIKY, DEAD = "spike, saturation", "stuck, zero, garbage"
SIGN_TO_DELAY, WANDERS = "sign to delay", "bias"
SPEED, ABSENT = "velocity against position", "absent, clock"
FAULTS = (
    FaultType("spike", _spike, ALL, AT_ONCE, SPIKY, 0.01),
    FaultType("spikes", _spikes, ALL, AT_ONCE, SPIKY),
    FaultType("rail", _rail, LOADS, AT_ONCE, SPIKY),
    FaultType("clipped", _clipped, LOADS, SOON, SPIKY),
    FaultType("stuck", _stuck, LOADS, SOON, DEAD),
    FaultType("zero", _zero, LOADS, SOON, DEAD),
    FaultType("garbage", _garbage, LOADS, SOON, DEAD),
    FaultType("noisy", _noisy, LOADS, SOON, DEAD),
    FaultType("sensor stuck", _stuck, ("sensor",), SOON, DEAD),
    FaultType("sensor zero", _zero, ("sensor",), SOON, DEAD),
    FaultType("sensor garbage", _garbage, ("sensor",), SOON, DEAD),
    FaultType("speed stuck", _stuck, ("q", "qd"), SOON, SPEED),
    FaultType("speed zero", _zero, ("qd",), SOON, SPEED),
    FaultType("speed bias", _bias, ("qd",), SOON, SPEED),
    FaultType("speed sign", _sign, ("qd",), SOON, SPEED),
    FaultType("sign", _sign, LOADS, SLOW, SIGN_TO_DELAY, LONG),
    FaultType("double", _double, LOADS, SLOW, SIGN_TO_DELAY, LONG),
    FaultType("half", _half, LOADS, SLOW, SIGN_TO_DELAY, LONG),
    FaultType("delay", _delay, LOADS, SLOW, SIGN_TO_DELAY, LONG),
    FaultType("swapped axes", _swap, ("sensor",), SLOW, SIGN_TO_DELAY, LONG),
    FaultType("coarse", _coarse, LOADS, SLOW, SIGN_TO_DELAY, LONG),
    FaultType("bias", _bias, LOADS, SLOWEST, WANDERS, LONGEST),
    FaultType("drift", _drift, LOADS, SLOWEST, WANDERS, LONGEST),
    FaultType("NaN", _nan, ALL, AT_ONCE, ABSENT),
    FaultType("infinite", _infinite, ALL, AT_ONCE, ABSENT),
    FaultType("absurd", _absurd, ALL, AT_ONCE, ABSENT),
    FaultType("sensor silent", _nan, ("sensor",), AT_ONCE, ABSENT),
    FaultType("stamp repeats", _repeat, ("time",), 0.0025, ABSENT, 0.01),
    FaultType("stamp goes back", _back, ("time",), AT_ONCE, ABSENT, 0.01),
    FaultType("gap", _gap, ("time",), AT_ONCE, ABSENT, 10.0),
    FaultType("no stamp", _no_stamp, ("time",), AT_ONCE, ABSENT, 0.01),
)


def channels_of(robot: Robot) -> Iterator[Channel]:
    """All channels, whole sensors and the clock of a robot."""
    for index, (name, joint) in enumerate(
        zip(robot.joint_names, robot.description.joints, strict=True)
    ):
        for signal in ("q", "qd", *(("tau",) if joint.measured else ())):
            yield Channel(signal, index, None, f"{signal}.{name}")
    for index, sensor in enumerate(robot.description.sensors):
        for axis in sensor.axes:
            yield Channel("wrench", index, AXES.index(axis), f"{sensor.name}.{axis}")
        yield Channel("wrench", index, None, sensor.name)
    yield Channel("time", 0, None, "time")


def cases_of(robot: Robot) -> list[tuple[FaultType, Channel]]:
    """Each type of fault on each channel that can have it."""
    return [
        (fault, channel)
        for fault in FAULTS
        for channel in channels_of(robot)
        if _kind(channel) in fault.on
    ]


def _kind(channel: Channel) -> str:
    whole = channel.signal == "wrench" and channel.axis is None
    return "sensor" if whole else channel.signal


def injected(
    samples: Samples, fault: FaultType, channel: Channel, begin: float, rng: np.random.Generator
) -> tuple[Samples, float]:
    """A recording with a fault from `begin` [s] on, and when that ends [s]."""
    period = float(np.median(np.diff(samples.time)))
    first = int(np.searchsorted(samples.time, begin - 0.5 * period))
    last = min(first + max(1, round(fault.seconds / period)), len(samples))
    copy = replace(
        samples,
        time=samples.time.copy(),
        **{name: getattr(samples, name).copy() for name in SIGNALS},
    )
    values = copy.time if channel.signal == "time" else channel.of(copy)
    fault.change(values[first:last], values[:first].copy(), channel, rng, period)
    return copy, float(samples.time[last - 1])
