# SPDX-License-Identifier: Apache-2.0
"""What is done to a log's rows before the observer sees them: velocities and delays."""

from pathlib import Path

import numpy as np

from touchline.logs.align import delay_halo, shift, typical_period
from touchline.logs.blocks import Window
from touchline.logs.source import Source
from touchline.logs.velocity import (
    VelocityWindow,
    choose_window,
    estimate_velocity,
    position_noise,
)
from touchline.model.description import RobotDescription
from touchline.observer.samples import Samples


class Preparation:
    """Estimates the velocities that a log lacks and undoes the delays of its signals.

    Everything is chosen once from the log's first rows, so that it is the same for every chunk.

    Attributes:
        halo: rows on either side that a window must offer.
        warnings: what was chosen.
    """

    def __init__(self, path: Path, description: RobotDescription, source: Source):
        self.warnings: list[str] = []
        self._tau_delays = _grouped([joint.delay for joint in description.joints])
        delays = [sensor.delay for sensor in description.sensors]
        self._wrench_delays = _grouped(delays) if source.delayed_wrenches else {}
        self._lacking = list(source.without_velocity)
        self._velocity: VelocityWindow | None = None
        self._period = float("nan")
        self.halo = 0
        if self._tau_delays or self._wrench_delays or self._lacking:
            self._look_at_head(path, description, source)

    def _look_at_head(self, path: Path, description: RobotDescription, source: Source) -> None:
        head = source.head()
        self._period = typical_period(head["time"])
        delays = [*self._tau_delays, *self._wrench_delays]
        halos = [delay_halo(delay, self._period) for delay in delays]
        if self._lacking and np.isfinite(self._period):
            self._velocity = self._choose_velocity(description, head["q"])
            halos.append(self._velocity.halo)
            names = ", ".join(description.joints[j].name for j in self._lacking)
            self.warnings.append(
                f"{path}: no velocities of {names}: estimated from the positions over "
                f"{2 * self._velocity.half + 1} samples ({1e3 * self._velocity.seconds:.3g} ms)"
            )
        self.halo = max(halos, default=0)

    def _choose_velocity(self, description: RobotDescription, q: np.ndarray) -> VelocityWindow:
        at = self._lacking
        noise = np.maximum(np.array(description.noise.q)[at], position_noise(q)[at])
        wanted = np.array(description.noise.qd)[at]
        bandwidth = np.array(
            [*description.bandwidth_joints, *description.bandwidth_sensors.values()]
        )
        return choose_window(noise, wanted, bandwidth, self._period)

    def samples(self, window: Window) -> Samples:
        """The window's rows, ready for the observer."""
        rows, block = slice(window.start, window.stop), window.padded
        qd, tau, wrench = block["qd"][rows], block["tau"][rows], block["wrench"][rows]
        if self._velocity is not None:
            q = block["q"][:, self._lacking]
            qd = qd.copy()
            qd[:, self._lacking] = estimate_velocity(block["time"], q, rows, self._velocity)
        tau = self._shifted(window, "tau", tau, self._tau_delays)
        wrench = self._shifted(window, "wrench", wrench, self._wrench_delays)
        return Samples(block["time"][rows], block["q"][rows], qd, tau, wrench, window.row)

    def _shifted(
        self, window: Window, signal: str, values: np.ndarray, delays: dict[float, list[int]]
    ) -> np.ndarray:
        if not delays:
            return values
        rows, block, values = slice(window.start, window.stop), window.padded, values.copy()
        for delay, columns in delays.items():
            halo = delay_halo(delay, self._period)
            logged = block[signal][:, columns]
            values[:, columns] = shift(block["time"], logged, delay, rows, halo, self._period)
        return values


def _grouped(delays: list[float]) -> dict[float, list[int]]:
    """Delay -> indices of the signals that have it; those without delay are left alone."""
    groups: dict[float, list[int]] = {}
    for index, delay in enumerate(delays):
        if delay:
            groups.setdefault(delay, []).append(index)
    return groups
