# SPDX-License-Identifier: Apache-2.0
"""One sample of a running robot, with its times, its number and what of it can be used."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array, Mask
from touchline.model.robot import Robot

NANO = 1e-9


def stamp(nanoseconds: int) -> float:
    """A time [s] from whole nanoseconds, with the same bits as a stamp that is read from a log."""
    seconds, rest = divmod(nanoseconds, 10**9)
    return seconds + rest * NANO


def whole_nanoseconds(time: float) -> int:
    """A time [s] as whole nanoseconds."""
    seconds = int(np.floor(time))
    return seconds * 10**9 + round((time - seconds) * 1e9)


def on_nanoseconds(time: float) -> float:
    """A time [s] rounded to whole nanoseconds: what an MCAP file keeps of it."""
    return stamp(whole_nanoseconds(time))


@dataclass(frozen=True)
class Validity:
    """Which channels of a sample carry a number, in the robot's order.

    Attributes:
        q, qd, tau: (n,).
        wrench: (k, 6).
    """

    q: Mask
    qd: Mask
    tau: Mask
    wrench: Mask


@dataclass(frozen=True, slots=True)
class Sample:
    """What a robot reported at one instant; iterates as the arguments of `Pipeline.update`.

    Values are in SI units as the robot reports them: the signs, gains, biases and frames of the
    description are not applied yet. NaN: not measured, late or invalid.

    Attributes:
        time: of the sensors' own clock [s]; the observer integrates over it.
        q: joint positions (n,) [rad or m].
        qd: joint velocities (n,) [rad/s or m/s].
        tau: joint torques (n,) in reported units.
        wrench: of each sensor (k, 6) [N, Nm].
        arrival: when it came, on this machine's monotonic clock [s].
        sequence: its number at the source; a step of more than one tells how many were lost. A
            source that counts none has a number for each sample received.
        ages: (k,) how much older than `time` each wrench is [s].
        result: what a native pipeline has made of it already, if one has.
    """

    time: float
    q: Array
    qd: Array
    tau: Array
    wrench: Array
    arrival: float = 0.0
    sequence: int = 0
    ages: Array = field(default_factory=lambda: np.zeros(0))
    result: Any = None

    def __iter__(self) -> Iterator[Any]:
        yield self.time
        yield self.q
        yield self.qd
        yield self.tau
        yield self.wrench

    @property
    def valid(self) -> Validity:
        """Which channels carry a number."""
        return Validity(*(np.isfinite(x) for x in (self.q, self.qd, self.tau, self.wrench)))


def make_sample(
    robot: Robot,
    time: float,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike | None = None,
    wrench: ArrayLike | None = None,
    **about: Any,
) -> Sample:
    """A sample of numbers in any form; what is left out is NaN.

    Args:
        robot: whose joints and sensors these are, in its order.
        time: of the sensors' clock [s].
        q: (n,) [rad or m].
        qd: (n,) [rad/s or m/s].
        tau: (n,) in reported units; those of joints without a torque signal are left out.
        wrench: (k, 6) [N, Nm], or (6,) of a robot with one sensor.
        about: `arrival`, `sequence`, `ages` of the sample.

    Raises:
        ValueError: for a wrong number of values.
    """
    n, k = len(robot.joint_names), len(robot.sensor_names)
    torques = _shaped("tau", tau, (n,))
    torques[unmeasured(robot)] = np.nan
    arrays = (_shaped("q", q, (n,)), _shaped("qd", qd, (n,)), torques)
    about.setdefault("ages", np.zeros(k))
    return Sample(float(time), *arrays, _shaped("wrench", wrench, (k, 6)), **about)


def unmeasured(robot: Robot) -> list[int]:
    """The joints without a torque signal of their own."""
    return [j for j, joint in enumerate(robot.description.joints) if not joint.measured]


def _shaped(name: str, values: ArrayLike | None, shape: Sequence[int]) -> Array:
    if values is None:
        return np.full(shape, np.nan)
    array = np.array(values, dtype=float)
    if array.size != int(np.prod(shape)):
        raise ValueError(f"{name} has {array.size} values, expected {tuple(shape)}")
    return array.reshape(shape)
