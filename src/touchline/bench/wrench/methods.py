# SPDX-License-Identifier: Apache-2.0
"""Every route from a log to the wrench on each segment, ours and the peers', behind one call.

A route takes a log and yields trials: wrenches (N, m, 6) in world axes about the world's origin,
NaN where it has nothing to say, for each bandwidth that makes sense on the log. Peers are treated
as well as is known: they are told the true contact links, and the wrenches and accelerations that
they get belong to the same instant.
"""

import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.bench.wrench.log import Log
from touchline.observer.classical import ClassicalObserver
from touchline.observer.dynamics import point_jacobian, posture, to_world
from touchline.observer.observer import Observer
from touchline.simulation.truth import filter_truth

OPEN = float("inf")  # the bandwidth of no low-pass
BANDWIDTHS = (10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)  # [rad/s]


@dataclass(frozen=True)
class Trial:
    """One setting of a method and what it estimates.

    Attributes:
        bandwidth: [rad/s].
        setting: what else can be chosen; may be empty.
        wrench: (N, m, 6).
    """

    bandwidth: float
    setting: str
    wrench: Array


@dataclass(frozen=True)
class Method:
    """A route to the wrenches.

    Attributes:
        name: short, as in tables and files.
        title: what it is, in a line.
        trials: all that it makes of a log.
        own: whether it is Touchline's.
        real: whether a robot has what it needs; no robot has the simulator's accelerations.
        module: that it needs, and the `package` that brings it.
    """

    name: str
    title: str
    trials: Callable[[Log], Iterator[Trial]]
    own: bool = False
    real: bool = True
    module: str = ""
    package: str = ""

    @property
    def missing(self) -> str:
        """One line that says how to install what it needs; empty if that is there."""
        if not self.module or importlib.util.find_spec(self.module) is not None:
            return ""
        return f"{self.module} is not installed: pip install {self.package}"


def bandwidths(log: Log) -> list[float]:
    """Those that a log is sampled fast enough for."""
    period = float(np.median(np.diff(log.time)))
    return [K for K in BANDWIDTHS if K * period < 1.001]


def lowpass(signal: Array, time: Array, bandwidth: float) -> Array:
    """The observers' own first-order low-pass of a signal (N, ...), begun at 0 like theirs."""
    return signal if bandwidth == OPEN else filter_truth(signal, time, bandwidth)


def segment(log: Log) -> Iterator[Trial]:
    """Ours: the momentum of each segment."""
    for K in bandwidths(log):
        estimate = Observer(log.robot, K).run(*log.signals())
        yield Trial(K, "", estimate.segment_wrench)
    raw = estimate.segment_innovation.copy()
    raw[0] = 0.0  # there is no interval yet
    yield Trial(OPEN, "", raw)


def paper(log: Log) -> Iterator[Trial]:
    """Ours, as the paper prints it (18)."""
    for K in bandwidths(log):
        yield Trial(K, "", Observer(log.robot, K, "paper").run(*log.signals()).segment_wrench)


def pinocchio(log: Log) -> Iterator[Trial]:
    """The paper's extended model with Pinocchio's mass and Coriolis matrices."""
    from touchline.bench.pinocchio_peer import PinocchioObserver

    for K in bandwidths(log):
        yield Trial(K, "", PinocchioObserver(log.robot, K).run(*log.signals())[2])


def classical(log: Log) -> Iterator[Trial]:
    """Accelerations from (6), Newton-Euler at the sensors, and perhaps the same low-pass after."""
    for K in bandwidths(log):
        wrench = ClassicalObserver(log.robot, K).run(*log.signals()).segment_wrench
        yield Trial(K, "residual", wrench)
        yield Trial(K, "residual and wrench", lowpass(wrench, log.time, K))


def joints(log: Log) -> Iterator[Trial]:
    """The joint observer and the pseudo-inverse of all touched links together (5).

    Where nothing is touched each segment's outermost link is taken by itself.
    """
    groups = [log.touched] if log.touched else [{s: k} for s, k in outermost_links(log).items()]
    for K in bandwidths(log):
        residual = Observer(log.robot, K).run(*log.signals()).tau_ext
        out = np.full_like(log.truth, np.nan)
        for group in groups:
            wrenches = pseudo_inverse(log, residual, tuple(group.values()))
            for name, wrench in zip(group, np.moveaxis(wrenches, 1, 0), strict=True):
                out[:, log.robot.segment_names.index(name)] = wrench
        yield Trial(K, "", out)


def idyntree_inputs(log: Log) -> Iterator[Trial]:
    """IDynTree as it is mostly fed: accelerations and sensor wrenches low-passed alike."""
    q, qd, qdd, wrench = between_samples(log)
    for K in bandwidths(log):
        inputs = (x[0] + lowpass(x - x[0], log.time, K) for x in (qdd, wrench))
        yield Trial(K, "", run_idyntree(log, q, qd, *inputs))


def idyntree_result(log: Log) -> Iterator[Trial]:
    """IDynTree with raw inputs and a low-pass on what it makes of them, in world axes."""
    raw = run_idyntree(log, *between_samples(log))
    for K in (*bandwidths(log), OPEN):
        yield Trial(K, "", lowpass(raw, log.time, K))


def between_samples(log: Log) -> tuple[Array, Array, Array, Array]:
    """`q`, `qd`, `qdd` and `wrench`, all at the middle of the interval before each sample.

    The difference of two velocities is the mean acceleration between them and belongs there;
    beside signals at the sample itself it would be late by half an interval.
    """
    s = log.samples
    qdd = np.diff(s.qd, axis=0) / np.diff(log.time)[:, None]
    q, qd, wrench = ((x[1:] + x[:-1]) / 2 for x in (s.q, s.qd, s.wrench))
    q, qd, qdd, wrench = (np.concatenate([x[:1], x]) for x in (q, qd, qdd, wrench))
    return q, qd, qdd, wrench


def idyntree_exact(log: Log) -> Iterator[Trial]:
    """IDynTree with the simulator's accelerations, low-passed or not."""
    s = log.samples
    raw = run_idyntree(log, s.q, s.qd, log.acceleration, s.wrench)
    for K in (*bandwidths(log), OPEN):
        yield Trial(K, "", lowpass(raw, log.time, K))


def run_idyntree(log: Log, q: Array, qd: Array, qdd: Array, wrench: Array) -> Array:
    """IDynTree's wrenches (N, m, 6) for given signals, told the links in contact."""
    from touchline.bench.idyntree_peer import IdyntreeEstimator

    peer = IdyntreeEstimator(log.robot, log.touched)
    found = np.array([peer.update(*row) for row in zip(q, qd, qdd, wrench, strict=True)])
    placed, out = posture(log.robot, q), np.empty_like(log.truth)
    for s, node in enumerate(peer.nodes):
        at = log.robot.segment_names.index(log.robot.sensor_names[s])
        out[:, at] = to_world(found[:, s], placed.rotation[node], placed.origin[node])
    return out


def pseudo_inverse(log: Log, residual: Array, links: tuple[str, ...]) -> Array:
    """Wrenches (N, c, 6) on links that explain joint residuals (N, n) best, all at once (5)."""
    robot, q = log.robot, log.samples.q
    J = np.concatenate([point_jacobian(robot, q, link, np.zeros(3)) for link in links], axis=1)
    inverse = np.linalg.pinv(np.swapaxes(J, 1, 2), rcond=1e-9)
    wrench = (inverse @ residual[..., None]).reshape(len(q), len(links), 6)
    placed = posture(robot, q)
    for c, link in enumerate(links):
        place = robot.places[link]
        R = placed.rotation[place.node]
        origin = placed.origin[place.node] + R @ place.T_node_link[:3, 3]
        wrench[:, c] = to_world(wrench[:, c], np.broadcast_to(np.eye(3), R.shape), origin)
    return wrench


def outermost_links(log: Log) -> dict[str, str]:
    """By segment, the link that most joints move."""
    robot = log.robot
    links = {}
    for name in robot.segment_names:
        bodies = [body for body in robot.bodies if body.segment == name]
        links[name] = max(bodies, key=lambda body: len(robot.joints_inboard_of(body))).name
    return links


METHODS = (
    Method("segment", "ours: the momentum of each segment", segment, own=True),
    Method("paper", "ours, as the paper prints it, eq. (18)", paper, own=True),
    Method(
        "pinocchio",
        "the paper's model with Pinocchio",
        pinocchio,
        module="pinocchio",
        package="pin",
    ),
    Method("classical", "accelerations from eq. (6), then Newton-Euler", classical),
    Method("joints", "joint torques and pseudo-inverse, eq. (5); told the touched links", joints),
    Method(
        "idyn-in",
        "iDynTree, accelerations by differences, low-pass on its inputs; told the touched links",
        idyntree_inputs,
        module="idyntree",
        package="idyntree",
    ),
    Method(
        "idyn-out",
        "iDynTree, accelerations by differences, low-pass on its result; told the touched links",
        idyntree_result,
        module="idyntree",
        package="idyntree",
    ),
    Method(
        "idyn-exact",
        "iDynTree with the simulator's accelerations, which no robot has; told the touched links",
        idyntree_exact,
        real=False,
        module="idyntree",
        package="idyntree",
    ),
)
