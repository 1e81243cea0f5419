# SPDX-License-Identifier: Apache-2.0
"""The extended momentum observer: external torques and wrenches from one sample or a recording."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array, Mask
from touchline.model.robot import Robot
from touchline.native import core
from touchline.value import Value, told_shortly

view, whole = core.view, core.whole

METHODS = ("segment", "paper")
DISCRETIZATIONS = ("automatic", "tustin", "exponential")

LONGEST = 1.0  # s between integer stamps: no arm is sampled more slowly
LATEST = 1e11  # s: 3000 years; nanoseconds get there in two minutes
NEEDED = {  # signals that nothing can stand in for
    "q": "an estimate needs joint positions (n,)",
    "qd": "an estimate needs joint velocities (n,); `touchline analyze` derives them for a log",
}


class Estimate(core.Rows, Value):
    """What the observer knows after one sample, or after each of N samples of a recording.

    Shapes are those of one sample; a recording's have N in front. n joints, k sensors, m segments.
    What cannot be computed is NaN.
    """

    __slots__ = ()

    def __init__(self, rows: Array, slices: dict[str, slice]) -> None:
        self.rows = rows
        self._slices = slices

    def _known(self) -> dict[str, Any]:
        return {"rows": self.rows, "slices": self._slices}

    def __repr__(self) -> str:
        if self.rows.ndim > 1:
            return f"Estimate of {len(self.rows)} samples"
        told = {name: told_shortly(getattr(self, name)) for name in ("tau_ext", "segment_wrench")}
        words = ", ".join(f"{name}={text}" for name, text in told.items())
        return f"Estimate({words}, health={self.health})"

    def like(self, rows: Array) -> "Estimate":
        """Other rows of the same observer."""
        return Estimate(rows, self._slices)

    def _part(self, name: str, columns: int = 0) -> Array:
        return view(self.rows, self._slices[name], columns)

    def _wrenches(self, name: str) -> Array:
        return self._part(name, 6)

    @property
    def tau_ext(self) -> Array:
        """External joint torques (n,) [Nm], low-passed with the observer's bandwidth (eq. 17)."""
        return self._part("tau_ext")

    @property
    def sensor_wrench(self) -> Array:
        """External wrench (k, 6) [N, Nm] on everything outboard of each sensor, sensor frame."""
        return self._wrenches("sensor_wrench")

    @property
    def segment_wrench(self) -> Array:
        """External wrench (m, 6) [N, Nm] on each segment alone, world axes, about the origin."""
        return self._wrenches("segment_wrench")

    @property
    def segment_torque(self) -> Array:
        """The part of `tau_ext` (n,) [Nm] that contacts on the joint's own segment cause."""
        return self._part("segment_torque")

    @property
    def parity(self) -> Array:
        """Joint torque minus what the sensor inboard says of it (n,) [Nm].

        Zero unless something touches between that sensor and the joint, or a sensor errs. Touches
        on a branch with a sensor of its own, which the joint does not carry, are left out.
        """
        return self._part("parity")

    @property
    def joint_innovation(self) -> Array:
        """External joint torque (n,) [Nm], mean over the last interval, not filtered."""
        return self._part("joint_innovation")

    @property
    def segment_innovation(self) -> Array:
        """Segment wrench (m, 6) [N, Nm], mean over the last interval, not filtered, world."""
        return self._wrenches("segment_innovation")

    @property
    def joint_settled(self) -> Mask:
        """Has the filter of each joint (n,) run for 5 / bandwidth since its last restart?"""
        return self._part("joint_settled") > 0.0

    @property
    def segment_settled(self) -> Mask:
        """Has the filter of each segment (m,) run for 5 / bandwidth since its last restart?"""
        return self._part("segment_settled") > 0.0

    @property
    def joint_gap_std(self) -> Array:
        """One sigma (n,) [Nm] of what lost samples may have left in each joint's torques; else 0.

        Over a gap the input is known at both ends only. The larger counts of half its change and
        of what the gap has changed in the estimate; both fade as the filter forgets.
        """
        return self._part("joint_gap_std")

    @property
    def segment_gap_std(self) -> Array:
        """The same (m, 2) [N, Nm] of each segment's force, and moment about its own sensor."""
        return self._part("segment_gap_std", 2)

    @property
    def health(self) -> Any:
        """Health bits (see `touchline.Health`): an int, or (N,) integers for a recording."""
        if self.rows.ndim == 1:
            return whole(self.rows, self._slices["health"])
        return self._part("health")[..., 0].astype(np.uint32)


# What these properties say, the core says in less time: a view of so many columns, or a number.
_READ: dict[str, int | None] = {
    "health": None,
    "tau_ext": 0,
    "segment_torque": 0,
    "parity": 0,
    "joint_innovation": 0,
    "joint_gap_std": 0,
    "sensor_wrench": 6,
    "segment_wrench": 6,
    "segment_innovation": 6,
    "segment_gap_std": 2,
}
for _name, _columns in _READ.items():
    core.read_natively(Estimate, _name, _columns)


class Observer:
    """Extended momentum observer (Iskandar et al., ICRA 2021) for any tree with any sensors.

    Args:
        robot: the robot, as from `touchline.load_robot`.
        bandwidth: K [rad/s] of all rows; default: the description's.
        method: "segment" filters each segment's own momentum in world axes; "paper" filters each
            residual in its own sensor frame and subtracts afterwards (eq. 18), which leaves a
            ghost of order |omega| |F| / K on the structure while the arm moves.
        discretization: "tustin", "exponential", or "automatic": Tustin up to K dt = 0.5.

    Raises:
        ValueError: for an unknown method or discretization or a bandwidth that is not positive.
    """

    def __init__(
        self,
        robot: Robot,
        bandwidth: float | None = None,
        method: str = "segment",
        discretization: str = "automatic",
    ) -> None:
        _require(method, METHODS, "method")
        _require(discretization, DISCRETIZATIONS, "discretization")
        if bandwidth is not None and not (np.isfinite(bandwidth) and bandwidth > 0):
            raise ValueError(f"bandwidth is {bandwidth}, but must be a positive number [rad/s]")
        self.robot = robot
        self.kernel = robot.kernel(method, discretization, bandwidth)
        self._slices = {name: slice(*ends) for name, ends in self.kernel.slices.items()}
        self._making: Any = core.Estimating(self.kernel, Estimate, self._slices)

    def update(
        self,
        time: float,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> Estimate:
        """Takes one sample, as the robot reports it; a bad one is reported in `health`.

        Args:
            time: time stamp [s].
            q: joint positions (n,) [rad or m].
            qd: joint velocities (n,) [rad/s or m/s].
            tau: logged joint torques (n,), NaN where not measured.
            wrench: logged sensor wrenches (k, 6), NaN where not measured.

        Raises:
            ValueError: for a wrong shape, or integer nanoseconds as `time`.
        """
        if not isinstance(time, float):
            require_seconds(time)
        estimate: Estimate = self._making.update(*self.sample(time, q, qd, tau, wrench))
        return estimate

    def run(
        self,
        time: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> Estimate:
        """Takes a recording, or the next part of one: N samples, the same numbers as `update`.

        Raises:
            ValueError: for a wrong shape.
        """
        stamps, signals = self.recording(time, q, qd, tau, wrench)
        return Estimate(self.kernel.run(stamps, *signals), self._slices)

    def reset(self) -> None:
        """Forgets the past: the next sample starts anew."""
        self.kernel.reset()

    def estimate(self, rows: Array) -> Estimate:
        """Names the parts of the kernel's rows."""
        return Estimate(rows, self._slices)

    def recording(self, time: ArrayLike, *signals: ArrayLike | None) -> tuple[Array, list[Array]]:
        """Stamps (N,) and the signals of N samples as the kernel wants them.

        Raises:
            ValueError: for a wrong shape.
        """
        require_seconds(time)
        stamps = _numbers(time, "time", None)
        if stamps.ndim != 1:
            raise ValueError(f"time has shape {stamps.shape}, expected (N,)")
        return stamps, self.arrays(stamps.shape, *signals)

    def sample(self, time: Any, *signals: ArrayLike | None) -> tuple[float, *tuple[Array, ...]]:
        """Stamp and signals of one sample as the kernel wants them.

        Raises:
            ValueError: for a wrong shape.
        """
        return float(_numbers(time, "time", ())), *self.arrays((), *signals)

    def arrays(self, lead: tuple[int, ...], *signals: ArrayLike | None) -> list[Array]:
        """Signals q, qd, tau, wrench as the kernel wants them, `lead` being () or (N,).

        Raises:
            ValueError: for a wrong shape.
        """
        n, k = len(self.robot.joint_names), len(self.robot.sensor_names)
        shapes = {"q": (n,), "qd": (n,), "tau": (n,), "wrench": (k, 6)}
        arrays = []
        for (name, shape), signal in zip(shapes.items(), signals, strict=True):
            full = lead + shape
            if signal is None and name in ("tau", "wrench"):
                arrays.append(np.full(full, np.nan))
            elif signal is None:
                raise ValueError(f"{name} is missing: {NEEDED[name]}")
            else:
                arrays.append(_numbers(signal, name, full))
        return arrays


core.Estimating.take_over(Observer)  # arrays of float64 need none of this: the core takes them


def require_seconds(time: ArrayLike) -> None:
    """Makes sure that integer stamps, () or (N,), are no nanoseconds, as ROS keeps them.

    Raises:
        ValueError: they are too late, or too far apart, to be seconds; or they are dates.
    """
    stamps = np.atleast_1d(np.asarray(time))
    if stamps.dtype.kind == "M":
        raise ValueError(
            "time is in seconds, but holds dates; pass (time - time[0]) / np.timedelta64(1, 's')"
        )
    if stamps.dtype.kind not in "iu" or stamps.ndim != 1 or not len(stamps):
        return
    step = float(np.median(np.diff(stamps.astype(float)))) if len(stamps) > 1 else 0.0
    if step > LONGEST or stamps.max() > LATEST:
        raise ValueError(
            f"time is in seconds, but holds integers up to {stamps.max()}; "
            "for nanoseconds pass (time - time[0]) * 1e-9"
        )


def _numbers(signal: ArrayLike | None, name: str, shape: tuple[int, ...] | None) -> Array:
    """The signal as an array of float64, row by row, of the given shape if there is one."""
    try:
        array = np.asarray(signal, dtype=float, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} is not an array of numbers: {error}") from None
    if shape is not None and array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}, expected {shape}")
    return array


def _require(value: str, allowed: tuple[str, ...], what: str) -> None:
    if value not in allowed:
        raise ValueError(f"{what} is '{value}', allowed: {', '.join(allowed)}")
