# SPDX-License-Identifier: Apache-2.0
"""The arms of the localization benchmark, and how noisy their sensors are."""

from dataclasses import dataclass, replace
from pathlib import Path

from touchline.model.description import Noise
from touchline.model.robot import Robot, load_robot

FILES = Path(__file__).parent / "arms"
ARMS = ("panda", "panda-torques", "sara", "sara-full", "ur10")


@dataclass(frozen=True)
class Tier:
    """White noise per sample, one sigma: `force` [N], `moment` [Nm], joint `torque` [Nm]."""

    force: float
    moment: float
    torque: float

    def __str__(self) -> str:
        if self.force == 0.0:
            return "noise-free"
        return f"{self.force:g} N / {self.moment:g} Nm / {self.torque:g} Nm"


TIERS = (Tier(0.0, 0.0, 0.0), Tier(0.05, 0.01, 0.05), Tier(0.2, 0.05, 0.1), Tier(0.5, 0.2, 0.3))


def described_arm(name: str) -> Robot:
    """An arm with the noise figures of its own description.

    Args:
        name: one of `ARMS`, or of another file beside theirs.

    Raises:
        InputError: if the package with the arm's model is not installed.
    """
    file = FILES / f"{name}.yaml"
    return load_robot(file if file.exists() else name)


def load_arm(name: str, tier: int) -> Robot:
    """An arm whose description says exactly how noisy its sensors are in the benchmark.

    Args:
        name: one of `ARMS`.
        tier: index into `TIERS`.

    Raises:
        InputError: if the package with the arm's model is not installed.
    """
    robot = described_arm(name)
    noise = TIERS[tier]
    n = len(robot.joint_names)
    axes = (noise.force,) * 3 + (noise.moment,) * 3
    figures = Noise(
        (0.0,) * n, (0.0,) * n, (noise.torque,) * n, dict.fromkeys(robot.sensor_names, axes)
    )
    return Robot(replace(robot.description, noise=figures), robot.mechanism)
