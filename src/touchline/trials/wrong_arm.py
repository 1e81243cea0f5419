# SPDX-License-Identifier: Apache-2.0
"""Arms with a payload that their model lacks, and one thing more that is not as described."""

from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.identify.gain import motor_joints
from touchline.model.description import Friction, SensorDescription
from touchline.model.mechanism import Inertia
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.model.transforms import combine_inertias, rotation_about, rotation_rpy, rpy_of
from touchline.observer.samples import Samples
from touchline.trials.free_motion import MotionMaker
from touchline.trials.free_motion import Path as Motion

UNKNOWN = 0.015  # relative error of masses and inertias, 1 sigma
MASS = 0.3, 2.0  # kg, of the payload
RADIUS = 0.04  # m, of its gyration
REACH = 0.08  # m; how far its centre may be from that of the link that carries it
TURNED, MOVED = np.radians(2.0), 5e-3  # rad, m; of a sensor's frame
BIAS, FRICTION, LATE = 2.0, 1.0, 5e-3  # N, Nm, s
WIDTHS = 0.01, 0.1  # rad/s, of the Coulomb friction's tanh
FALLING, SPEEDS = (0.3, 1.2), (0.05, 0.4)  # Nm, rad/s; how friction falls with speed, and where
APART = 2.5  # times the width at least is that speed
GAINS, DRY = (0.7, 1.4), (1.0, 5.0)  # of currents to the described ones; Nm, their joints' friction
KINDS = "payload alone", "frame", "bias", "friction", "delay", "falling friction", "gain"


@dataclass(frozen=True)
class WrongArm:
    """An arm as described and as it is.

    Attributes:
        robot: as described.
        real: as it is, sensor frames too.
        payload: the node that carries it.
        bias: (6 k,) of the sensors [N, Nm].
        friction: by joint.
        late: by "torques" or the sensor [s].
        turned: the sensor whose frame is off; -1: none.
    """

    robot: Robot
    real: Robot
    payload: int
    bias: Array
    friction: dict[int, Friction]
    late: dict[str, float]
    turned: int = -1

    @property
    def gains(self) -> Array:
        """Gains of the torques as they are, over the described ones (n,)."""
        real, told = (robot.description.joints for robot in (self.real, self.robot))
        return np.array([a.gain / b.gain for a, b in zip(real, told, strict=True)])


def make_wrong_arm(robot: Robot, kind: str, rng: np.random.Generator) -> WrongArm:
    """An arm with a payload that its model lacks, and one thing more.

    Gains, masses and a payload scale together: where no sensor weighs the payload, an arm whose
    gains are off has none.
    """
    description, k = robot.description, len(robot.sensor_names)
    mechanism = perturbed(robot.mechanism, UNKNOWN, rng)
    node, link = flange(robot)
    mass = float(rng.uniform(*MASS))
    centre = robot.mechanism.links[link].inertia.com + _direction(rng) * rng.uniform(0.0, REACH)
    body = Inertia(mass, centre, mass * RADIUS**2 * np.eye(3))
    if kind == "gain" and not k:
        body = Inertia.zero()
    own = mechanism.links[link]
    loaded = replace(own, inertia=combine_inertias([own.inertia, body]))
    mechanism = replace(mechanism, links=mechanism.links | {link: loaded})
    turned, bias = -1, np.zeros(6 * k)
    friction: dict[int, Friction] = {}
    late: dict[str, float] = {}
    if kind == "frame" and k:
        turned = int(rng.integers(k))
        sensors = list(description.sensors)
        sensors[turned] = _off(sensors[turned], rng)
        description = replace(description, sensors=tuple(sensors))
    elif kind == "bias" and k:
        first = 6 * int(rng.integers(k))
        bias[first : first + 3] = BIAS * _direction(rng)
    elif kind == "friction":
        measured = [j for j, joint in enumerate(description.joints) if joint.measured]
        if measured:
            width = float(np.exp(rng.uniform(*np.log(WIDTHS))))
            friction[int(rng.choice(measured))] = Friction(FRICTION, 0.0, width)
    elif kind == "falling friction":
        measured = [j for j, joint in enumerate(description.joints) if joint.measured]
        if measured:
            width = float(np.exp(rng.uniform(*np.log(WIDTHS))))
            speed = max(float(np.exp(rng.uniform(*np.log(SPEEDS)))), APART * width)
            law = Friction(FRICTION, 0.0, width, float(rng.uniform(*FALLING)), speed)
            friction[int(rng.choice(measured))] = law
    elif kind == "delay":
        torques = ["torques"] if any(joint.measured for joint in description.joints) else []
        late[str(rng.choice([*torques, *robot.sensor_names]))] = LATE
    elif kind == "gain":
        joints = list(description.joints)
        for j in motor_joints(robot):
            joints[j] = replace(joints[j], gain=joints[j].gain * float(rng.uniform(*GAINS)))
            friction[j] = Friction(float(rng.uniform(*DRY)), 0.0, WIDTHS[0])
        description = replace(description, joints=tuple(joints))
    return WrongArm(robot, Robot(description, mechanism), node, bias, friction, late, turned)


def flange(robot: Robot) -> tuple[int, str]:
    """The node at the end of the arm that the most joints move, and its heaviest link."""
    moved = []
    for i, node in enumerate(robot.nodes):
        count, at = 0, i
        while at >= 0:
            count, at = count + (robot.nodes[at].coordinate >= 0), robot.nodes[at].parent
        moved.append((count, i) if node.links else (-1, i))
    node = max(moved)[1]
    names = robot.nodes[node].links
    return node, max(names, key=lambda name: robot.mechanism.links[name].inertia.mass)


def _direction(rng: np.random.Generator) -> Array:
    x = rng.normal(size=3)
    return x / np.linalg.norm(x)


def _off(sensor: SensorDescription, rng: np.random.Generator) -> SensorDescription:
    """A sensor that stands and points a little otherwise than described."""
    R = rotation_rpy(sensor.rpy) @ rotation_about(_direction(rng), TURNED)
    xyz = np.array(sensor.xyz) + MOVED * _direction(rng)
    return replace(sensor, xyz=tuple(xyz.tolist()), rpy=tuple(rpy_of(R)))


def record(
    case: WrongArm, motion: Motion, seconds: float, rate: float, rng: np.random.Generator
) -> Samples:
    """What the arm logs of a motion."""
    maker = MotionMaker(case.robot, case.real, rate, seconds)
    q, qd, loads = maker.loads(motion)
    n = q.shape[1]
    for name, late in case.late.items():
        shifted = maker.loads(lambda t, late=late: motion(t - late))[2]
        s = case.robot.sensor_names.index(name) if name != "torques" else -1
        columns = slice(0, n) if s < 0 else slice(n + 6 * s, n + 6 * s + 6)
        loads[:, columns] = shifted[:, columns]
    for j, law in case.friction.items():
        loads[:, j] += law.dry(qd[:, j])
    loads[:, :n] /= case.gains
    loads[:, n:] += case.bias
    return maker.sensed(q, qd, loads, rng)
