# SPDX-License-Identifier: Apache-2.0
"""What no estimator can do better: the bound of Cramer and Rao for what `calibrate` finds.

Unknown are the links, a payload, the offset of every reading, the frames of the sensors and the
delays. All else is known: accelerations, the noise, and how far links are off at random. That the
model tells links so closely counts as one more reading of them (Van Trees, Detection, Estimation,
and Modulation Theory, 1968).
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from touchline.arrays import Array
from touchline.calibrate.plan import Plan
from touchline.identify.fit import BIAS, FRAME
from touchline.identify.regressor import PARAMETERS, body_vector, momentum_regressors, rows_of
from touchline.model.mechanism import Inertia
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.trials.free_motion import Path, planned
from touchline.trials.wrong_arm import LATE, MASS, RADIUS, UNKNOWN, flange

STEP = 1e-4  # s, of the differences that make accelerations
DRAWN = 1000  # arms whose links tell how far they are off
INERTIA = 0.05  # kg m2: 1 sigma of a payload's second moments
SMALLEST = 1e-12  # of the largest variance of a link; what is below it is rounding


@dataclass(frozen=True)
class Bound:
    """Root mean squares that no estimator can fall below.

    Attributes:
        mass, centre: of the body at the end of the arm, payload and all [kg, m].
        turn, shift: by sensor, of its frame [rad, m].
        delay: by "torques" or the sensor [s].
    """

    mass: float
    centre: float
    turn: dict[str, float]
    shift: dict[str, float]
    delay: dict[str, float]

    def of(self, figure: str, name: str) -> float:
        """That of a figure of the benchmark in its unit [g, mm, degrees, ms]; NaN: none is known.

        `name` is the sensor's, or "torques".
        """
        if figure in ("mass", "centre"):
            return 1e3 * float(getattr(self, figure))
        if figure == "turn":
            return float(np.degrees(self.turn[name]))
        if figure in ("shift", "delay"):
            return 1e3 * float(getattr(self, figure)[name])
        return float("nan")


def least_errors(robot: Robot, plan: Plan, rate: float) -> Bound:
    """The bound for arms of `make_wrong_arm` that follow a planned motion.

    Args:
        robot: as described; its noise figures are those of the readings.
        plan: the motion.
        rate: of the recording [Hz].
    """
    n, names = len(robot.joint_names), robot.sensor_names
    time = np.arange(round(plan.time[-1] * rate)) / rate
    model = _regressors(robot, planned(plan), time)
    node, inertias = _typical(robot)
    load = np.einsum("nrbk,bk->nr", model, inertias)
    noise = robot.description.noise
    sigma = np.array([*noise.tau, *(x for name in names for x in noise.sensors[name])])
    rows = [j for j, joint in enumerate(robot.description.joints) if joint.measured]
    groups = {"torques": list(rows)} if rows else {}
    groups |= {name: [*range(n + 6 * s, n + 6 * s + 6)] for s, name in enumerate(names)}
    rows += range(n, n + 6 * len(names))
    links = _link_roots(robot)
    free = sum(root.shape[1] for _, root in links)
    offsets = free + PARAMETERS
    frames = offsets + len(rows)
    delays = frames + 6 * len(names)
    rates = CubicSpline(time, load)(time, 1)
    H = np.zeros((delays + len(groups), delays + len(groups)))
    for i, r in enumerate(rows):
        A = np.zeros((len(time), len(H)))
        A[:, :free] = np.concatenate([model[:, r, body] @ root for body, root in links], axis=1)
        A[:, free:offsets] = model[:, r, node]
        A[:, offsets + i] = 1.0
        if r >= n:
            s, axis = divmod(r - n, 6)
            first = frames + 6 * s
            A[:, first : first + 6] = _frame_columns(load[:, n + 6 * s : n + 6 * s + 6], axis)
        for g, own in enumerate(groups.values()):
            if r in own:
                A[:, delays + g] = rates[:, r]
        H += A.T @ A / sigma[r] ** 2
    prior = np.zeros(len(H))
    prior[:free] = 1.0
    prior[free + 4 : offsets] = INERTIA**-2.0
    prior[offsets:frames] = BIAS**-2.0
    prior[frames:delays] = np.tile(np.repeat([FRAME["turn"], FRAME["shift"]], 3), len(names)) ** -2
    prior[delays:] = LATE**-2.0
    C = np.linalg.inv(H + np.diag(prior))
    whole = np.zeros((PARAMETERS, len(H)))
    whole[:, free:offsets] = np.eye(PARAMETERS)
    at = 0
    for body, root in links:
        if body == node:
            whole[:, at : at + root.shape[1]] = root
        at += root.shape[1]
    # A centre is what the first moments are over the mass.
    mass, centre = inertias[node, 0], inertias[node, 1:4] / inertias[node, 0]
    to_centre = np.hstack([-centre[:, None], np.eye(3)]) / mass @ whole[:4]

    def size(first: int, count: int) -> float:
        return float(np.sqrt(np.diag(C)[first : first + count].sum()))

    return Bound(
        float(np.sqrt((whole @ C @ whole.T)[0, 0])),
        float(np.sqrt(np.trace(to_centre @ C @ to_centre.T))),
        {name: size(frames + 6 * s, 3) for s, name in enumerate(names)},
        {name: size(frames + 6 * s + 3, 3) for s, name in enumerate(names)},
        {name: size(delays + g, 1) for g, name in enumerate(groups)},
    )


def _regressors(robot: Robot, motion: Path, time: Array) -> Array:
    """What readings are per unit of the bodies' parameters, without any filter."""
    rows = rows_of(robot)
    after, before = (
        momentum_regressors(robot, rows, *motion(time + step)[:2])[0] for step in (STEP, -STEP)
    )
    slope = (after - before) / (2.0 * STEP)
    return slope + momentum_regressors(robot, rows, *motion(time)[:2])[1]


def _typical(robot: Robot) -> tuple[int, Array]:
    """The node at the end of the arm, and all nodes' parameters (B, 10) with a mean payload."""
    node, _ = flange(robot)
    inertias = np.array([body_vector(own.inertia) for own in robot.nodes])
    mass = float(np.mean(MASS))
    ball = Inertia(mass, robot.nodes[node].inertia.com, mass * RADIUS**2 * np.eye(3))
    inertias[node] += body_vector(ball)
    return node, inertias


def _link_roots(robot: Robot) -> list[tuple[int, Array]]:
    """By node, a root of the covariance of its parameters as links are off at random."""
    rng = np.random.default_rng(0)
    own = np.array([body_vector(node.inertia) for node in robot.nodes])
    off = np.empty((DRAWN, *own.shape))
    for i in range(DRAWN):
        arm = Robot(robot.description, perturbed(robot.mechanism, UNKNOWN, rng))
        off[i] = [body_vector(node.inertia) for node in arm.nodes]
    roots = []
    for i, x in enumerate(np.moveaxis(off - own, 1, 0)):
        values, axes = np.linalg.eigh(x.T @ x / DRAWN)
        kept = values > SMALLEST * max(values.max(), 1e-300)
        if kept.any():
            roots.append((i, axes[:, kept] * np.sqrt(values[kept])))
    return roots


def _frame_columns(wrench: Array, axis: int) -> Array:
    """What an axis reads more (N, 6) per unit of turns and shifts of a frame with that wrench."""
    moment, own = divmod(axis, 3)
    turns = np.cross(np.eye(3)[:, None], wrench[:, 3 * moment : 3 * moment + 3])[..., own].T
    if not moment:
        return np.hstack([turns, np.zeros_like(turns)])
    return np.hstack([turns, np.cross(np.eye(3)[:, None], wrench[:, :3])[..., own].T])
