# SPDX-License-Identifier: Apache-2.0
"""The baselines of the localization benchmark, on the same signals as our estimator."""

import numpy as np

from touchline.arrays import Array
from touchline.bench.localization.line_rules import first_entry, nearest_to_line
from touchline.bench.localization.particle_filter import ParticleFilter
from touchline.detector.detector import Detection
from touchline.localizer.skin import Skin
from touchline.observer.observer import Estimate
from touchline.trials.touches import Signals

BASELINES = {
    "first": "first entry of the line (Iskandar et al., ICRA 2021)",
    "nearest": "first entry, or the surface nearest to the line",
    "particles": "contact particle filter (as Manuelli and Tedrake, IROS 2016), all sensors",
}
PARTICLE_RUNS = 100  # it takes long: runs per cell
STEP = 5  # samples from one update of the particles to the next


def baseline_places(
    name: str, skin: Skin, signals: Signals, estimate: Estimate, detection: Detection, run: int
) -> list[Array] | None:
    """The places (3,) [m] in world that a baseline names at the last sample.

    Args:
        name: one of `BASELINES`.
        skin: the robot's surfaces.
        signals: of the run.
        estimate: of all its samples.
        detection: of all its samples.
        run: its number, which is the particles' seed.

    Returns:
        None where the baseline is not run: particles on an arm that moves, or after the first
        `PARTICLE_RUNS`.
    """
    q = signals.q[-1]
    if name == "particles":
        if run >= PARTICLE_RUNS or np.ptp(signals.q, axis=0).any():
            return None
        return _particles(skin, q, estimate, detection, run)
    rule = {"first": first_entry, "nearest": nearest_to_line}[name]
    found = []
    for g, segment in enumerate(skin.robot.segment_names):
        if detection.levels[-1, g] and segment != "root":
            found.append(rule(skin, q, segment, estimate.segment_wrench[-1, g]))
    return [place for place in found if place is not None]


def _particles(
    skin: Skin, q: Array, estimate: Estimate, detection: Detection, run: int
) -> list[Array]:
    touched = np.flatnonzero(detection.levels.any(axis=1))
    if not len(touched):
        return []
    particles = ParticleFilter(skin, q, np.random.default_rng(run))
    for i in range(int(touched[0]), len(detection.levels), STEP):
        residual = np.r_[estimate.tau_ext[i], estimate.sensor_wrench[i].ravel()]
        particles.update(residual)
    return particles.places()
