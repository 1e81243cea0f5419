# SPDX-License-Identifier: Apache-2.0
"""An arm led by its handle for a long while: how often is that taken for a collision?

Nothing reacts as long as nothing is taken for a collision, so the loop need not be closed, and
places are not needed: detector and classifier see the log at once.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from touchline.classifier.classifier import Classifier, Kind
from touchline.classifier.zones import Zones
from touchline.detector.detector import Detector
from touchline.model.robot import load_robot
from touchline.model.surface import link_surface
from touchline.observer.observer import Observer
from touchline.simulation.guiding import guided_samples
from touchline.simulation.noise import SensorNoise
from touchline.simulation.plant import Plant
from touchline.simulation.scene import Run, make_plant
from touchline.simulation.setup import Setup, read_setup

HANDLE = "handle"
PART = 60.0  # s of one simulation
RATE = 1000.0  # Hz
SETTLED = 0.1  # s after which the observer has settled


@dataclass(frozen=True)
class Guided:
    """One part of guiding.

    Attributes:
        seconds: simulated.
        collisions: touches that were taken for a collision, on any segment.
        felt: part of the time in which the handle's touch was noticed.
        rate: largest rate of force on the handle [N/s], and `limit`, that of a collision.
        force: largest force of the hand [N].
        speed: largest joint velocity [rad/s].
    """

    seconds: float
    collisions: int
    felt: float
    rate: float
    limit: float
    force: float
    speed: float


@cache
def _arm(seed: int) -> tuple[Plant, Setup]:
    robot = load_robot("sara")
    settings = Run(seed=seed, physics=RATE, model_error=0.02)
    return make_plant(robot, settings), read_setup(robot)


def handle_point(plant: Plant) -> np.ndarray:
    """Where the handle is held (3,), in its frame [m]: the middle of its surface."""
    surface = link_surface(plant.robot.mechanism.links[HANDLE])
    return np.zeros(3) if surface is None else surface.vertices.mean(axis=0)


def guide(part: int, seconds: float = PART, velocity_noise: float = 1e-3) -> Guided:
    """Leads the arm for a while; the same `part` gives the same figures.

    Args:
        part: number of the part; every sixth has other errors of the model.
        seconds: duration.
        velocity_noise: 1 sigma of the joint velocities [rad/s].
    """
    plant, setup = _arm(part % 6)
    robot, noise = plant.robot, SensorNoise(velocity=velocity_noise)
    hand = (HANDLE, handle_point(plant))
    s, force = guided_samples(robot, plant, setup, hand, seconds, (7, part), noise)
    observer = Observer(robot)
    detector, zones = Detector(observer), Zones(robot)
    classifier = Classifier(observer, detector.thresholds, zones)
    estimate, detection = detector.run(s.time, s.q, s.qd, s.tau, s.wrench)
    classes = classifier.follow(s.time, estimate, detection.levels)
    struck = classes.kinds == Kind.COLLISION
    begins = struck & ~np.vstack([np.zeros_like(struck[:1]), struck[:-1]])
    g = robot.segment_names.index(HANDLE)
    return Guided(
        seconds,
        int(begins.sum()),
        float(np.mean(detection.levels[s.time > SETTLED, g] > 0)),
        float(np.nanmax(classes.rates[:, g])),
        zones.onset(HANDLE),
        float(np.linalg.norm(force, axis=1).max()),
        float(np.abs(s.qd).max()),
    )


def told(parts: list[Guided]) -> str:
    """The figures of all parts in a few lines."""
    seconds = sum(part.seconds for part in parts)
    collisions = sum(part.collisions for part in parts)
    felt = sum(part.felt * part.seconds for part in parts) / seconds
    return (
        f"guiding by the handle for {seconds / 3600:.2f} h: {collisions} collisions\n"
        f"  hand up to {max(p.force for p in parts):.0f} N, joints up to "
        f"{max(p.speed for p in parts):.1f} rad/s, touch noticed {100 * felt:.1f} % of the time\n"
        f"  force on the handle grew by at most {max(p.rate for p in parts):.0f} N/s; "
        f"a collision begins at {parts[0].limit:.0f} N/s"
    )
