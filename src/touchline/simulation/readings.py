# SPDX-License-Identifier: Apache-2.0
"""What ideal sensors read over a simulated run."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from touchline.arrays import Array
from touchline.simulation.plant import Plant, Reading

HALF = np.array(0.5)  # an array, since numpy converts a number each time


@dataclass(frozen=True)
class Readings:
    """N samples of ideal sensors, and what is needed to log them in any convention.

    Attributes:
        time: (N,) [s].
        q, qd: (N, n) [rad or m].
        link_torque, motor_torque: (N, n) [Nm or N]; see `Reading`.
        wrench: (N, k, 6) on the outboard body, sensor frame [N, Nm].
        gravity_torque: (N, n) that holds the robot; None where no driver takes it out.
        motion_torque: (N, n) that moves it as well; None where no driver takes it out.
        weight: (N, k, 6) gravity's wrench on what the sensor carries, sensor frame; None where no
            sensor takes it out.
        R_log_sensor: (N, k, 3, 3) turns sensor axes into those of the log; None if all are the
            sensors' own.
        acceleration: (N, n) of the joints, which no sensor reads; None where it is not known.
    """

    time: Array
    q: Array
    qd: Array
    link_torque: Array
    motor_torque: Array
    wrench: Array
    gravity_torque: Array | None = None
    motion_torque: Array | None = None
    weight: Array | None = None
    R_log_sensor: Array | None = None
    acceleration: Array | None = None

    @classmethod
    def empty(cls, plant: Plant, count: int) -> Self:
        """Room for `count` samples of what the plant's description calls for."""
        description = plant.robot.description
        n, k = len(description.joints), len(description.sensors)
        compensated = {joint.compensated for joint in description.joints}
        weighed = any(sensor.compensated == "gravity" for sensor in description.sensors)
        turned = any(sensor.frame != "sensor" for sensor in description.sensors)
        q, qd, link_torque, motor_torque = np.empty((4, count, n))
        return cls(
            np.empty(count),
            q,
            qd,
            link_torque,
            motor_torque,
            np.empty((count, k, 6)),
            np.empty((count, n)) if "gravity" in compensated else None,
            np.empty((count, n)) if "model" in compensated else None,
            np.empty((count, k, 6)) if weighed else None,
            np.empty((count, k, 3, 3)) if turned else None,
            np.empty((count, n)),
        )

    def put(self, row: int, plant: Plant, before: Reading, after: Reading) -> None:
        """Stores the mean of two readings of the plant's present state."""
        self.time[row] = round(plant.time * plant.rate) / plant.rate
        self.q[row], self.qd[row] = plant.q, plant.qd
        rooms = (
            self.link_torque,
            self.motor_torque,
            self.wrench,
            self.acceleration,
            self.motion_torque,
        )
        for room, first, second in zip(rooms, before, after, strict=True):
            if room is None or first is None or second is None:
                continue
            if first is second:
                room[row] = first
            else:
                mean = np.add(first, second, room[row])
                np.multiply(mean, HALF, mean)
        if self.gravity_torque is not None:
            self.gravity_torque[row] = plant.gravity_torque()
        if self.weight is not None:
            self.weight[row] = plant.sensor_weights()
        if self.R_log_sensor is not None:
            self.R_log_sensor[row] = plant.log_rotations()
