# SPDX-License-Identifier: Apache-2.0
"""A pipeline in a native thread, and what it has left for Python."""

import numpy as np

from touchline.live.sample import Sample
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline

SLOTS = 16384  # samples and results that may wait: two seconds at 8 kHz


class Felt:
    """Samples that a native thread has taken, with their results.

    Args:
        robot: whose samples they are.
        pipeline: that feels.

    Attributes:
        runner: the native thread.
    """

    def __init__(self, robot: Robot, pipeline: Pipeline) -> None:
        n, k = len(robot.joint_names), len(robot.sensor_names)
        self._ends = np.cumsum([n, n, n, 6 * k, k])
        self._pipeline = pipeline
        self.runner = pipeline.beside(SLOTS)

    def read(self, timeout: float) -> list[Sample]:
        """What the thread has left, after waiting at most so long [s] for the first."""
        self.runner.wait(timeout)
        return [self._sample(numbers) for numbers in self.runner.results()]

    def _sample(self, numbers: np.ndarray) -> Sample:
        arrival, number, at = (float(x) for x in numbers[:3])
        q, qd, tau, wrench, ages, rest = np.split(numbers[3:], self._ends)
        result = self._pipeline.result(rest)
        return Sample(at, q, qd, tau, wrench.reshape(-1, 6), arrival, int(number), ages, result)
