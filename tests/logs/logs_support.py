# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np

from touchline.model.description import (
    JointDescription,
    Noise,
    RobotDescription,
    SensorDescription,
)
from touchline.observer.samples import Samples


def describe(joints=2, sensors=("base",), log=None, **changes) -> RobotDescription:
    """A description without a model; items may be names or finished descriptions."""
    names = [f"j{i + 1}" for i in range(joints)] if isinstance(joints, int) else joints
    made = [JointDescription(x) if isinstance(x, str) else x for x in names]
    n = len(made)
    values = {
        "name": "robot",
        "model": Path("robot.urdf"),
        "joints": tuple(made),
        "sensors": tuple(
            SensorDescription(x, "link") if isinstance(x, str) else x for x in sensors
        ),
        "noise": Noise((0.0,) * n, (2e-4,) * n, (0.05,) * n, {}),
        "bandwidth_joints": (100.0,) * n,
        "bandwidth_sensors": {},
        "log": log or {},
    }
    return RobotDescription(**(values | changes))


def make_samples(rows=500, joints=2, sensors=1, period=1e-3, seed=0) -> Samples:
    """Smooth positions, noisy torques and wrenches."""
    rng = np.random.default_rng(seed)
    time = 10.0 + period * np.arange(rows)
    phase = np.arange(joints) * 0.7 + 1.0
    return Samples(
        time,
        np.sin(3.0 * time[:, None] + phase),
        3.0 * np.cos(3.0 * time[:, None] + phase),
        rng.normal(size=(rows, joints)),
        rng.normal(size=(rows, sensors, 6)),
    )


def assert_same(a: Samples, b: Samples) -> None:
    for name in ("time", "q", "qd", "tau", "wrench"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
