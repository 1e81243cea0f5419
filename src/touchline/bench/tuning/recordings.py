# SPDX-License-Identifier: Apache-2.0
"""The recordings: touches of an arm that stands or moves, and the same with faults of channels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.detector.thresholds import Thresholds, expect_drift, make_thresholds
from touchline.localizer.localizer import MODEL_ERROR
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot, load_robot
from touchline.observer.samples import Samples
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.control import hold
from touchline.simulation.noise import SensorNoise
from touchline.simulation.places import PlaceFinder
from touchline.simulation.scenario import scripted
from touchline.simulation.scene import Run
from touchline.simulation.setup import read_setup
from touchline.simulation.touchable import structure_links

PERIOD = 1e-3  # s
FORCE = 20.0  # N
SPEED = 0.5  # rad/s, of those that move


@dataclass(frozen=True)
class Touch:
    """What truly happened.

    Attributes:
        body: that was touched.
        segment: that it belongs to.
        begin: [s], and `end`.
        point: (N, 3) in world [m], at each sample.
    """

    body: str
    segment: str
    begin: float
    end: float
    point: Array


@dataclass(frozen=True)
class Recording:
    """One recording with all that a pipeline of it needs.

    Attributes:
        name: and what it is, in words.
        robot: of it, with `skin` and `thresholds` that serve all runs.
        samples: as logged.
        touches: in the order of their slots.
    """

    name: str
    robot: Robot
    skin: Skin
    thresholds: Thresholds
    samples: Samples
    touches: tuple[Touch, ...]


def recordings() -> tuple[list[Recording], list[Recording]]:
    """Those with healthy channels, and those with faults: two seconds or so in all, of 1 kHz."""
    sara, full = load_robot("sara"), load_robot("sara-full")
    outer, inner = structure_links(full)[-2:], structure_links(full)[1:3]
    still = record("an arm that stands, touched twice one after the other", full, [inner, outer])
    moving = record("the same arm in motion", full, [inner, outer], speed=SPEED)
    wrong = record(
        "the same with inertias 2 % wrong", full, [inner, outer], speed=SPEED, model_error=0.02
    )
    one = record("an arm without a sensor in some joints, in motion", sara, [outer], speed=SPEED)
    together = record(
        "two touches that begin together", full, [inner, outer], begins=(0.15, 0.15), seconds=0.4
    )
    healthy = [still, moving, wrong, one, together]
    faulty = [
        replace(moving, name="in motion, 10 ms and 60 ms lost", samples=without_samples(moving)),
        replace(one, name="in motion, a torque that jumps", samples=with_spikes(one)),
        replace(moving, name="in motion, a torque that is stuck", samples=with_stuck(moving)),
        replace(moving, name="in motion, a velocity that is wrong", samples=with_offset(moving)),
    ]
    return healthy, faulty


def record(
    name: str,
    robot: Robot,
    groups: Sequence[Sequence[str]],
    begins: tuple[float, ...] = (0.15, 0.3),
    seconds: float = 0.55,
    speed: float = 0.0,
    model_error: float = 0.0,
) -> Recording:
    """A touch of `FORCE` on each group of links, which lasts until shortly before the end."""
    settings = Run(seed=0, noise=SensorNoise(), model_error=model_error, physics=2000.0)
    finder = PlaceFinder(robot, hold(read_setup(robot).home), np.random.default_rng(3))
    contacts = []
    end = seconds - 0.1
    for links, begin in zip(groups, begins, strict=False):
        place = finder.find(links, begin, end)
        profile = Profile(begin, max(end - begin - 0.04, 0.0), 0.02, 0.02)
        force = FORCE * place.direction
        contacts.append(
            ScriptedContact(place.link, place.at.point, force, profile, force_frame="link")
        )
    simulated = scripted(robot, contacts, seconds, speed, settings)
    skin = Skin(robot)
    patches = {patch.link: patch for patch in skin.patches}
    touches = tuple(
        Touch(
            patches[contact.link].body,
            str(patches[contact.link].segment),
            begin,
            end,
            simulated.truth.point[:, slot],
        )
        for slot, (contact, begin) in enumerate(zip(contacts, begins, strict=False))
    )
    thresholds = expect_drift(robot, make_thresholds(robot, PERIOD), MODEL_ERROR)
    return Recording(name, robot, skin, thresholds, simulated.samples, touches)


def without_samples(recording: Recording) -> Samples:
    """Lost once for 10 ms and once for 60 ms."""
    s = recording.samples
    lost = ((s.time >= 0.2) & (s.time < 0.21)) | ((s.time >= 0.35) & (s.time < 0.41))
    left = np.flatnonzero(~lost)
    return Samples(*(getattr(s, name)[left] for name in ("time", "q", "qd", "tau", "wrench")))


def with_spikes(recording: Recording) -> Samples:
    """One joint's torque is 50 Nm off for a sample, now and then."""
    s = recording.samples
    tau = s.tau.copy()
    column = int(np.flatnonzero(np.isfinite(tau).all(axis=0))[-1])
    tau[100::70, column] += 50.0
    return replace(s, tau=tau)


def with_stuck(recording: Recording) -> Samples:
    """One joint's torque keeps its value from 0.25 s on."""
    s = recording.samples
    tau = s.tau.copy()
    tau[250:, 3] = tau[250, 3]
    return replace(s, tau=tau)


def with_offset(recording: Recording) -> Samples:
    """One joint's velocity is 0.3 rad/s too fast for 0.1 s."""
    s = recording.samples
    qd = s.qd.copy()
    qd[80:180, 2] += 0.3
    return replace(s, qd=qd)
