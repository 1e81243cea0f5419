# SPDX-License-Identifier: Apache-2.0
"""Noise figures beside the noise of a recording."""

from functools import lru_cache

import numpy as np

from touchline.arrays import Array
from touchline.check.findings import Findings
from touchline.check.seen import Seen
from touchline.model.description import AXES
from touchline.model.robot import Robot
from touchline.model.sources import given_keys

OFF = 1.5  # times the figure in use; thresholds follow from it
ODD = 2.0  # times what is usual among the joints: one that stands out is told by itself


@lru_cache(maxsize=4)
def _given(robot: Robot) -> frozenset[str]:
    """Which noise figures the description gives: `tau`, names of sensors."""
    return frozenset(given_keys(robot.description.path).get("noise") or ())


def check_noise(robot: Robot, seen: Seen, findings: Findings) -> None:
    """White noise per sample beside the figures in use.

    Figures that the description does not give are a guess, of which nothing is a finding. Only
    more noise is one: a driver that filters its signals shows less per sample, which says nothing
    of what it lets through.
    """
    given = _given(robot)
    _torques(robot, seen, findings, "tau" in given)
    k = len(robot.sensor_names)
    sigma = seen.wrench_noise.sigma().reshape(k, 6)
    for s, sensor in enumerate(robot.description.sensors):
        own = [AXES.index(axis) for axis in sensor.axes]
        figures = np.array(robot.description.noise.sensors[sensor.name])[own]
        ratio = _ratio(sigma[s, own], figures)
        if not np.isfinite(ratio).any():
            continue
        worst = float(np.nanmax(ratio))
        numbers = _numbers(np.where(np.isfinite(sigma[s, own]), sigma[s, own], figures))
        findings.note("noise", f"  {sensor.name}: [{numbers}], at most {worst:.2g} times described")
        if worst > OFF and sensor.name in given:
            findings.find(
                f"sensor {sensor.name} is up to {worst:.1f} times as noisy as its figures in use: "
                f"noise: {{{sensor.name}: [{numbers}]}}"
            )
            all_axes = np.array(robot.description.noise.sensors[sensor.name])
            all_axes[own] = _louder(sigma[s, own], figures)
            _mend(findings, sensor.name, all_axes)


def _torques(robot: Robot, seen: Seen, findings: Findings, given: bool) -> None:
    joints = robot.description.joints
    own = [j for j, joint in enumerate(joints) if joint.measured]
    gains = np.abs([joint.gain for joint in joints])
    sigma = seen.torque_noise.sigma() * gains
    figures = np.array(robot.description.noise.tau)
    ratio = _ratio(sigma, figures)
    own = [j for j in own if np.isfinite(ratio[j])]
    if not own:
        return
    usual = float(np.median(ratio[own]))
    text = _numbers(np.where(np.isfinite(sigma), sigma, figures))
    findings.note("noise", f"  torques: [{text}] Nm, {usual:.2g} times the figures in use (median)")
    if not given:
        return
    loud = [j for j in own if ratio[j] > OFF]
    single = [j for j in loud if ratio[j] > ODD * usual]
    if loud:
        _mend(findings, "tau", _louder(sigma, figures))
    for j in single:
        findings.find(
            f"torque of {joints[j].name} is {ratio[j]:.1f} times as noisy as its figure in use, "
            f"the others {usual:.1f} times: {sigma[j]:.2g} Nm per sample"
        )
    if len(loud) > len(single):
        least, most = f"{min(ratio[loud]):.1f}", f"{max(ratio[loud]):.1f}"
        times = most if least == most else f"{least} to {most}"
        findings.find(
            f"torques are {times} times as noisy as the figures in use: noise: {{tau: [{text}]}}"
        )


def _louder(sigma: Array, figures: Array) -> Array:
    """The figures, with what is shown where that is more by so much that it is a finding."""
    return np.where(_ratio(sigma, figures) > OFF, sigma, figures)


def _mend(findings: Findings, key: str, figures: Array) -> None:
    numbers = [float(f"{x:.2g}") for x in figures]
    findings.fixes.setdefault("noise", {})[key] = numbers


def _ratio(sigma: Array, figures: Array) -> Array:
    return np.divide(sigma, figures, out=np.full(len(sigma), np.nan), where=figures > 0)


def _numbers(values: Array) -> str:
    return ", ".join(f"{x:.2g}" for x in values)
