# SPDX-License-Identifier: Apache-2.0
"""Writes a long recording of an arm with seven joints and two force-torque sensors.

python benchmarks/make_long_log.py OUT [HOURS] makes OUT/robot.yaml and OUT/log.parquet (1 kHz):
smooth motion with exact torques and wrenches, noise, and a touch every ten seconds. Then

    /usr/bin/time -v touchline analyze OUT/log.parquet --robot OUT/robot.yaml --out OUT/results
"""

import sys
from pathlib import Path

import numpy as np

import touchline as tl
from touchline.logs import TableWriter
from touchline.logs.tables import table_columns
from touchline.observer.samples import Samples

RATE = 1000
PERIOD = 60  # s; the motion repeats
ROBOT = """\
name: long
model: package://example-robot-data/robots/panda_description/urdf/panda.urdf
locked: {panda_finger_joint1: 0.0}
force_torque_sensors:
  - {name: base, link: panda_link0}
  - {name: wrist, link: panda_hand}
"""


def motion() -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (PERIOD * RATE, 7) [rad, rad/s] that repeat."""
    t = np.arange(PERIOD * RATE)[:, None] / RATE
    centre = np.array([0.0, 0.2, 0.0, -1.8, 0.0, 2.0, 0.5])
    cycles = np.array([5, 7, 9, 8, 11, 12, 15])
    w = 2 * np.pi * cycles / PERIOD
    return centre + 0.4 * np.sin(w * t), 0.4 * w * np.cos(w * t)


def loads(robot: tl.Robot, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torques (N, 7) and wrenches (N, 2, 6) without contact.

    An observer without lag that is told nothing takes all that moves the arm for external.
    """
    observer = tl.Observer(robot, bandwidth=1e9, method="paper", discretization="exponential")
    q, qd = (np.vstack([x, x[:2]]) for x in (q, qd))
    time = np.arange(len(q)) / RATE
    n, k = len(robot.joint_names), len(robot.sensor_names)
    nothing = np.zeros((len(q), n)), np.zeros((len(q), k, 6))
    estimate = observer.run(time, q, qd, *nothing)
    tau, wrench = estimate.tau_ext.copy(), estimate.sensor_wrench.copy()
    return 0.5 * (tau[1:-1] + tau[2:]), 0.5 * (wrench[1:-1] + wrench[2:])


def main(out: Path, hours: float = 1.0) -> None:
    """Write the robot and the log, a period at a time."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "robot.yaml").write_text(ROBOT)
    robot = tl.load_robot(out / "robot.yaml")
    q, qd = motion()
    tau, wrench = loads(robot, q, qd)
    q, qd = np.roll(q, -1, axis=0), np.roll(qd, -1, axis=0)
    rng = np.random.default_rng(0)
    time = np.arange(len(q)) / RATE
    touch = ((time % 10 > 8) & (time % 10 < 8.5))[:, None]
    writer = None
    for turn in range(round(hours * 3600 / PERIOD)):
        noisy_tau = tau + rng.normal(0, 0.02, tau.shape)
        noisy_wrench = wrench + rng.normal(0, 0.02, wrench.shape)
        noisy_wrench[:, 0, :3] -= 15 * touch
        part = Samples(turn * PERIOD + time, q, qd, noisy_tau, noisy_wrench)
        columns = table_columns(part, robot.description)
        if writer is None:
            writer = TableWriter(out / "log.parquet", dict.fromkeys(columns, "f8"))
        writer.write(columns)
    if writer is not None:
        writer.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 1.0)
