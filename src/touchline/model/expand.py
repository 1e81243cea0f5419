# SPDX-License-Identifier: Apache-2.0
"""Values given once, per joint or per axis, brought to one per joint and six per sensor."""

from typing import Any

from touchline.model import values
from touchline.model.description import (
    AXES,
    CalibrationDescription,
    DetectionDescription,
    Noise,
    Vector,
)
from touchline.model.entries import SensorEntry
from touchline.model.names import RESERVED_SENSORS
from touchline.suggest import unknown

DEFAULT_NOISE = {"q": 0.0, "qd": 2e-4, "tau": 0.05}
DEFAULT_SENSOR_NOISE = (0.05, 0.05, 0.05, 0.01, 0.01, 0.01)
DEFAULT_BANDWIDTH = 100.0


class Expander:
    """Expands the values of one file; what does not fit goes to `problems`.

    Args:
        joint_count: number of observed joints; None if it is not known.
        sensors: the readable sensors.
        sensor_names: the names of all sensors.
    """

    def __init__(
        self, joint_count: int | None, sensors: list[SensorEntry], sensor_names: list[str]
    ):
        self.joint_count = joint_count
        self.sensors = sensors
        self.sensor_names = sensor_names
        self.problems: list[tuple[str, str]] = []

    def noise(self, given: dict[str, Any]) -> Noise:
        """Return one sigma per joint and six per sensor, defaults filled in."""
        for key in given:
            if key not in (*DEFAULT_NOISE, *self.sensor_names):
                known = (*DEFAULT_NOISE, *self.sensor_names)
                self.problems.append((f"noise.{key}", unknown(key, "key", known)))
        q, qd, tau = (
            self._per_joint(f"noise.{key}", given.get(key, default), values.non_negative)
            for key, default in DEFAULT_NOISE.items()
        )
        return Noise(
            q, qd, tau, {sensor.name: self._sensor_noise(given, sensor) for sensor in self.sensors}
        )

    def bandwidth(self, given: Any) -> tuple[Vector, dict[str, float]]:
        """Return K [rad/s] per joint and per sensor."""
        where = "observer.bandwidth"
        if not isinstance(given, dict):
            sensors = {name: float(given) for name in self.sensor_names}
            return self._per_joint(where, given, values.positive), sensors
        for key in given:
            if key not in ("joints", *self.sensor_names):
                known = ("joints", *self.sensor_names)
                self.problems.append((f"{where}.{key}", unknown(key, "key", known)))
        joints = given.get("joints", DEFAULT_BANDWIDTH)
        sensors = {
            name: self._number(
                f"{where}.{name}", given.get(name, DEFAULT_BANDWIDTH), values.positive
            )
            for name in self.sensor_names
        }
        return self._per_joint(f"{where}.joints", joints, values.positive), sensors

    def detection(self, given: DetectionDescription) -> DetectionDescription:
        """Return the detection settings, names and counts of their thresholds checked."""
        for name in ("contact", "collision"):
            level, where = getattr(given, name), f"detection.{name}"
            if isinstance(level.torque, tuple):
                self._per_joint(f"{where}.torque", list(level.torque), values.positive)
            for kind in ("force", "moment"):
                by_sensor = getattr(level, kind)
                for key in by_sensor if isinstance(by_sensor, dict) else ():
                    if key not in self.sensor_names:
                        what = unknown(key, "sensor", self.sensor_names)
                        self.problems.append((f"{where}.{kind}.{key}", what))
        if given.calibration is not None:
            self._calibration(given.calibration)
        return given

    def _calibration(self, given: CalibrationDescription) -> None:
        where = "detection.calibration"
        segments = (*self.sensor_names, "root")
        rows = [f"{name}.{axis}" for name in self.sensor_names for axis in AXES]
        for name in given.rows:
            if "." in name and name not in rows:
                self.problems.append((f"{where}.rows.{name}", unknown(name, "row", rows)))
        for segment, tails in given.tails.items():
            if segment not in segments:
                what = unknown(segment, "segment", segments)
                self.problems.append((f"{where}.tails.{segment}", what))
            for method in tails:
                if method not in values.METHODS:
                    what = unknown(method, "method", values.METHODS)
                    self.problems.append((f"{where}.tails.{segment}.{method}", what))

    def per_axis(self, where: str, given: Any, sensor: SensorEntry, default: Vector) -> Vector:
        """Return six values; `given` has six, one per measured axis, or is None (the default)."""
        count = len(sensor.axes)
        if given is None or len(given) == 6:
            return given or default
        if len(given) != count:
            allowed = "6" if count == 6 else f"6, or {count} for the axes {', '.join(sensor.axes)}"
            self.problems.append(
                (where, f"{list(given)} has {len(given)} values; allowed: {allowed}")
            )
            return default
        known = dict(zip(sensor.axes, given, strict=True))
        return tuple(
            known.get(axis, fallback) for axis, fallback in zip(AXES, default, strict=True)
        )

    def _sensor_noise(self, noise: dict[str, Any], sensor: SensorEntry) -> Vector:
        where, given = f"noise.{sensor.name}", noise.get(sensor.name)
        if given is None or sensor.name in RESERVED_SENSORS:
            return DEFAULT_SENSOR_NOISE
        read = self._read(where, given, values.non_negative, 0.05)
        many = read if isinstance(read, tuple) else (read,) * 6
        return self.per_axis(where, many, sensor, DEFAULT_SENSOR_NOISE)

    def _per_joint(self, where: str, given: Any, item: values.Hook) -> Vector:
        read = self._read(where, given, item, 0.0)
        if not isinstance(read, tuple):
            return (read,) * (self.joint_count or 0)
        if self.joint_count is not None and len(read) != self.joint_count:
            what = f"{list(read)} has {len(read)} values"
            allowed = f"a number, or one for each of the {self.joint_count} joints"
            self.problems.append((where, f"{what}; allowed: {allowed}"))
        return read

    def _number(self, where: str, given: Any, item: values.Hook) -> float:
        return self._checked(where, given, item, 0.0)

    def _read(self, where: str, given: Any, item: values.Hook, fallback: float) -> float | Vector:
        return self._checked(where, given, values.number_or_list(item), fallback)

    def _checked(self, where: str, given: Any, hook: values.Hook, fallback: float) -> Any:
        try:
            return hook(given, None)
        except ValueError as error:
            self.problems.append((where, str(error)))
            return fallback
