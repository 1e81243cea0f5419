# SPDX-License-Identifier: Apache-2.0
"""What is wrong with an arm of which only its model is told."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.model.mechanism import Inertia, Mechanism
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

PAYLOAD = 0.3  # kg, 5 cm out of the last link's origin
SHIFT = 5e-3  # m, by which centres of mass are off
BIAS = 2.0  # N, in a random direction at the first force-torque sensor; Nm on arms without one
GAIN = 0.01  # relative error of every reading's scale, either sign
COULOMB = 1.0  # Nm, friction of every joint, of the other sign at once when it turns
TURN = 0.01  # rad/s, over which it changes its sign
# Of an arm on which several things are wrong at once:
MASSES = 0.03  # relative error of masses and inertias, 1 sigma
FRICTION, VISCOUS = (0.2, 1.5), (0.0, 1.5)  # Nm and Nm s/rad, drawn for each joint
RIPPLE, STAGES = 0.2, 9.0  # Nm, and per rad of a joint: as its gears have it
BIASES = 0.8  # N, 1 sigma, along each axis of a force-torque sensor


@dataclass(frozen=True)
class Fault:
    """An arm that is not as told.

    Attributes:
        name: of what is wrong.
        arm: makes the mechanism that moves of the one that is told.
        read: makes what the sensors report of what they should.
    """

    name: str
    arm: Callable[[Mechanism, np.random.Generator], Mechanism]
    read: Callable[[Robot, Samples, np.random.Generator], Samples]

    def moving(self, robot: Robot, rng: np.random.Generator) -> Robot:
        """The arm as it is."""
        return Robot(robot.description, self.arm(robot.mechanism, rng))


def _same(mechanism: Mechanism, _: np.random.Generator) -> Mechanism:
    return mechanism


def _true(_robot: Robot, samples: Samples, _: np.random.Generator) -> Samples:
    return samples


def _masses(fraction: float) -> Callable[[Mechanism, np.random.Generator], Mechanism]:
    return lambda mechanism, rng: perturbed(mechanism, fraction, rng)


def _shifted(mechanism: Mechanism, rng: np.random.Generator) -> Mechanism:
    def moved(body: Inertia) -> Inertia:
        way = rng.normal(size=3)
        return replace(body, com=body.com + SHIFT * way / np.linalg.norm(way))

    links = {n: replace(link, inertia=moved(link.inertia)) for n, link in mechanism.links.items()}
    return replace(mechanism, links=links)


def _loaded(mechanism: Mechanism, _: np.random.Generator) -> Mechanism:
    """With a point mass on the link of the last joint that moves."""
    moving = [j for j in mechanism.joints.values() if j.kind != "fixed"]
    name = moving[-1].child
    link = mechanism.links[name]
    body, at = link.inertia, np.array([0.0, 0.0, 0.05])
    mass = body.mass + PAYLOAD
    com = (body.mass * body.com + PAYLOAD * at) / mass
    inertia = body.inertia + _about(body.mass, body.com - com) + _about(PAYLOAD, at - com)
    return replace(
        mechanism,
        links=mechanism.links | {name: replace(link, inertia=Inertia(mass, com, inertia))},
    )


def _about(mass: float, r: Array) -> Array:
    return np.asarray(mass * (float(r @ r) * np.eye(3) - np.outer(r, r)), dtype=np.float64)


def _biased(_: Robot, samples: Samples, rng: np.random.Generator) -> Samples:
    if samples.wrench.shape[1] == 0:
        return replace(samples, tau=samples.tau + BIAS * rng.choice([-1.0, 1.0]))
    way = rng.normal(size=3)
    wrench = samples.wrench.copy()
    wrench[:, 0, :3] += BIAS * way / np.linalg.norm(way)
    return replace(samples, wrench=wrench)


def _scaled(_: Robot, samples: Samples, rng: np.random.Generator) -> Samples:
    gains = 1.0 + GAIN * rng.choice([-1.0, 1.0], samples.tau.shape[1])
    wrench = samples.wrench * (1.0 + GAIN * rng.choice([-1.0, 1.0], samples.wrench.shape[1:]))
    return replace(samples, tau=samples.tau * gains, wrench=wrench)


def _rubbing(_robot: Robot, samples: Samples, _: np.random.Generator) -> Samples:
    return replace(samples, tau=samples.tau + COULOMB * np.tanh(samples.qd / TURN))


def _noisier(factor: float) -> Callable[[Robot, Samples, np.random.Generator], Samples]:
    """With `factor` times the noise that is told."""
    more = np.sqrt(factor**2 - 1.0)

    def read(robot: Robot, s: Samples, rng: np.random.Generator) -> Samples:
        noise = robot.description.noise
        sensors = np.array([noise.sensors[name] for name in robot.sensor_names]).reshape(-1, 6)
        return replace(
            s,
            qd=s.qd + more * np.array(noise.qd) * rng.normal(size=s.qd.shape),
            tau=s.tau + more * np.array(noise.tau) * rng.normal(size=s.tau.shape),
            wrench=s.wrench + more * sensors * rng.normal(size=s.wrench.shape),
        )

    return read


def _several(_robot: Robot, s: Samples, rng: np.random.Generator) -> Samples:
    """Friction and ripple of its gears by joint; biases and gains of its sensors."""
    n, k = s.tau.shape[1], s.wrench.shape[1]
    dry, viscous = rng.uniform(*FRICTION, n), rng.uniform(*VISCOUS, n)
    ripple = RIPPLE * np.sin(STAGES * s.q + rng.uniform(0.0, 2 * np.pi, n))
    tau = s.tau + dry * np.tanh(s.qd / TURN) + viscous * s.qd + ripple
    biases = np.hstack([BIASES * rng.normal(size=(k, 3)), np.zeros((k, 3))])
    wrench = (s.wrench + biases) * (1.0 + GAIN * rng.choice([-1.0, 1.0], (k, 6)))
    return replace(s, tau=tau, wrench=wrench)


SEVERAL = Fault("several", _masses(MASSES), _several)
FAULTS = (
    Fault("nothing", _same, _true),
    Fault("masses 2 %", _masses(0.02), _true),
    Fault("masses 5 %", _masses(0.05), _true),
    Fault("centres 5 mm", _shifted, _true),
    Fault("payload 0.3 kg", _loaded, _true),
    Fault("bias 2 N", _same, _biased),
    Fault("gains 1 %", _same, _scaled),
    Fault("friction 1 Nm", _same, _rubbing),
    Fault("noise x 3", _same, _noisier(3.0)),
    Fault("noise x 10", _same, _noisier(10.0)),
)
