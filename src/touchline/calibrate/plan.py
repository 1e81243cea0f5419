# SPDX-License-Identifier: Apache-2.0
"""A short motion that excites what shall be identified, within the limits of the arm.

Each joint follows a Fourier series (Swevers et al., IEEE T-RA 13(5), 1997) whose phase starts and
ends at rest. It runs once: a path that repeats shows no more postures, and what is held out of it
is as what was fitted. Of many random series that keep the limits, the one is taken whose equations
tell most. The same equations foretell the standard errors.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.identify.choice import CORRELATED
from touchline.identify.evidence import Evidence, gather
from touchline.identify.fit import BodyChange, Column, Equations, Problem, main_links
from touchline.identify.payload import payload_link, seen_leaves
from touchline.model.robot import Robot
from touchline.model.surface import mechanism_surfaces
from touchline.observer.dynamics import inverse_dynamics
from touchline.observer.samples import Samples

SECONDS = 60.0
RATE = 100.0  # samples a second
HARMONICS = 15  # of the series: joints turn up to some 20 times
# Amplitudes fall with the square of the harmonic's number, from about this one on. At the same
# speed larger ones of high harmonics reach fewer postures, smaller ones turn joints less often.
CORNER = 3
MARGIN = 0.1  # of a joint's range that stays free at either end
SPEED_SHARE, EFFORT_SHARE = 0.5, 0.6  # of the limits
SPEED, TIP_SPEED = 1.0, 1.0  # a joint: rad/s at most, or faster where it moves no point faster: m/s
SPREAD = 2.0  # rad; of a joint that could turn for ever
CLEARANCE = 0.03  # m between the surfaces of bodies that are no neighbours
POINTS = 120  # on each body, for clearances
TRIES, WANTED = 400, 24  # random motions, and how many of those that keep the limits are compared
LEAST = 180  # positions at which torques and clearances are looked at: every third of a second
ERROR_SHARE, ERROR = 0.02, 0.2  # 1 sigma left in a row: of its largest load, and Nm or N
LINK_SIGMA = 0.1  # prior of inertias
POSES, CANDIDATES = 12, 400


@dataclass(frozen=True)
class Plan:
    """A motion, poses, and what they will tell.

    Attributes:
        robot: whose plan it is.
        time: (N,) [s].
        q, qd, qdd: (N, n) [rad, rad/s, rad/s2].
        poses: (P, n) for a force-torque sensor; empty without one.
        errors: name, standard error, unit.
        unknown: what even this motion does not tell.
    """

    robot: Robot
    time: Array
    q: Array
    qd: Array
    qdd: Array
    poses: Array
    errors: list[tuple[str, float, str]]
    unknown: list[str]

    def text(self) -> str:
        """What it will identify."""
        lines = [
            f"{self.time[-1]:.0f} s of motion, at most {np.abs(self.qd).max():.2g} rad/s; stay "
            "clear of the arm and watch its first run slowly: only joint limits, speeds, torques",
            "and contacts of the arm with itself were looked at, no table, cable or wall",
            "",
            "what it will tell, 1 sigma, where the model leaves 2 % of the loads unexplained",
            *(f"  {name:36} {error:8.2g} {unit}" for name, error, unit in self.errors),
        ]
        if self.unknown:
            lines.append(f"  not told by it: {', '.join(self.unknown)}")
        if len(self.poses):
            lines.append(f"{len(self.poses)} poses tell biases, mass and centre: rest 3 s in each")
        return "\n".join(lines)


def make_plan(robot: Robot, seed: int = 0) -> Plan:
    """Searches a motion.

    Raises:
        InputError: no random motion keeps the limits.
    """
    rng = np.random.default_rng(seed)
    space = _Space(robot, rng)
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    best: tuple[float, tuple[Array, Array, Array]] | None = None
    kept = 0
    for i in range(TRIES):
        motion = _series(space, time, rng, shrink=1.0 - 0.8 * i / TRIES)
        if not space.allows(*motion):
            continue
        kept += 1
        score = _score(robot, time, *motion[:2])
        if best is None or score > best[0]:
            best = score, motion
        if kept == WANTED:
            break
    if best is None:
        raise InputError(
            f"{robot.name}: no motion was found that keeps the limits of joints, speeds, torques "
            "and the clearance of its links: are the limits of the model right?"
        )
    q, qd, qdd = best[1]
    errors, unknown = _foretell(robot, time, q, qd)
    return Plan(robot, time, q, qd, qdd, _poses(space, rng), errors, unknown)


def write_plan(plan: Plan, folder: Path) -> list[Path]:
    """Writes a plan as a table, a JointTrajectory (YAML and JSON) and Python lists.

    Raises:
        InputError: the folder cannot be written.
    """
    names = list(plan.robot.joint_names)
    points = [
        {
            "positions": _rounded(plan.q[i]),
            "velocities": _rounded(plan.qd[i]),
            "accelerations": _rounded(plan.qdd[i]),
            "time_from_start": {
                "sec": int(plan.time[i]),
                "nanosec": round(1e9 * (plan.time[i] % 1.0)),
            },
        }
        for i in range(len(plan.time))
    ]
    header = ["time", *(f"q.{n}" for n in names), *(f"qd.{n}" for n in names)]
    table = np.column_stack([plan.time, plan.q, plan.qd])
    rows = [",".join(f"{x:.6g}" for x in row) for row in table]
    files = {
        "motion.csv": "\n".join([",".join(header), *rows]) + "\n",
        "motion.json": json.dumps({"joint_names": names, "points": points}),
        "motion.yaml": _yaml(names, points),
        "motion.py": _python(plan, names),
    }
    if len(plan.poses):
        rows = [",".join(f"{x:.6g}" for x in row) for row in plan.poses]
        files["poses.csv"] = "\n".join([",".join(f"q.{n}" for n in names), *rows]) + "\n"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be written: {error.strerror}") from None
    return [folder / name for name in files]


class _Space:
    """Where a robot may be."""

    def __init__(self, robot: Robot, rng: np.random.Generator) -> None:
        self.robot = robot
        joints = [robot.mechanism.joints[name] for name in robot.joint_names]
        low, high = robot.ranges
        middle = 0.5 * (low + high)
        room = np.minimum((0.5 - MARGIN) * (high - low), SPREAD)
        self.low, self.high = middle - room, middle + room
        velocity = np.array([joint.velocity for joint in joints])
        effort = np.array([joint.effort for joint in joints])
        self.effort = EFFORT_SHARE * np.where(effort > 0, effort, np.inf)
        self._points = self._sampled(rng)
        self._pairs = self._far_pairs()
        fast = np.maximum(SPEED, TIP_SPEED / self._reaches())
        self.speed = np.minimum(fast, SPEED_SHARE * np.where(velocity > 0, velocity, np.inf))

    def allows(self, q: Array, qd: Array, qdd: Array) -> bool:
        """Does a motion keep the limits of position, speed, torque and clearance?"""
        if (q < self.low).any() or (q > self.high).any() or (np.abs(qd) > self.speed).any():
            return False
        some = np.linspace(0, len(q) - 1, LEAST).astype(int)
        torque = inverse_dynamics(self.robot, q[some], qd[some], qdd[some]).torque
        return not (np.abs(torque) > self.effort).any() and all(self.clear(x) for x in q[some])

    def clear(self, q: Array) -> bool:
        """Are bodies that are no neighbours apart from each other?"""
        from scipy.spatial import KDTree

        poses = self.robot.poses(q)
        placed = {i: p @ poses[i][:3, :3].T + poses[i][:3, 3] for i, p in self._points.items()}
        trees = {i: KDTree(p) for i, p in placed.items()}
        near = (trees[a].query(placed[b], distance_upper_bound=CLEARANCE) for a, b in self._pairs)
        return all(np.isinf(distances).all() for distances, _ in near)

    def _sampled(self, rng: np.random.Generator) -> dict[int, Array]:
        """Points on the surfaces of the nodes, in their frames."""
        surfaces = mechanism_surfaces(self.robot.mechanism).by_link
        points: dict[int, Array] = {}
        for i, node in enumerate(self.robot.nodes):
            parts = []
            for name in node.links:
                surface = surfaces.get(name)
                if surface is None or surface.areas.sum() <= 0.0:
                    continue
                share = surface.areas / surface.areas.sum()
                faces = surface.faces[rng.choice(len(share), POINTS, p=share)]
                weights = rng.dirichlet(np.ones(3), POINTS)
                own = np.einsum("pk,pkx->px", weights, surface.vertices[faces])
                T = self.robot.places[name].T_node_link
                parts.append(own @ T[:3, :3].T + T[:3, 3])
            if parts:
                points[i] = np.concatenate(parts)
        return points

    def _far_pairs(self) -> list[tuple[int, int]]:
        """Pairs of bodies with at least two joints between them that are apart in mid-range."""
        nodes = list(self._points)
        pairs = [(a, b) for a in nodes for b in nodes if a < b and self._between(a, b) >= 3]
        self._pairs = pairs
        keep, middle = [], 0.5 * (self.low + self.high)
        for pair in pairs:  # what always touches is how the arm is built
            self._pairs = [pair]
            if self.clear(middle):
                keep.append(pair)
        return keep

    def _reaches(self) -> Array:
        """(n,) how far from each joint's origin a body that it moves can be at most [m]."""
        home = self.robot.poses(0.5 * (self.low + self.high))
        reaches = np.full(len(self.low), 1e-3)
        for i, points in self._points.items():
            reach, at = float(np.linalg.norm(points, axis=1).max()), i
            while at >= 0:
                node = self.robot.nodes[at]
                if node.coordinate >= 0:
                    reaches[node.coordinate] = max(reaches[node.coordinate], reach)
                if node.parent >= 0:
                    reach += float(np.linalg.norm(home[at][:3, 3] - home[node.parent][:3, 3]))
                at = node.parent
        return reaches

    def _between(self, a: int, b: int) -> int:
        count = 0
        while b != a and b >= 0:
            count += self.robot.nodes[b].coordinate >= 0
            b = self.robot.nodes[b].parent
        return count if b == a else 3


def _series(
    space: _Space, time: Array, rng: np.random.Generator, shrink: float
) -> tuple[Array, Array, Array]:
    """A random Fourier series that keeps positions and speeds: q, qd, qdd (N, n)."""
    n = len(space.low)
    x = time / time[-1]
    # The phase rises from rest to rest, smoothly: a quintic.
    phase = 2.0 * np.pi * (10 * x**3 - 15 * x**4 + 6 * x**5)
    rate = 2.0 * np.pi * (30 * x**2 - 60 * x**3 + 30 * x**4) / time[-1]
    bend = 2.0 * np.pi * (60 * x - 180 * x**2 + 120 * x**3) / time[-1] ** 2
    k = np.arange(1, HARMONICS + 1)
    a, b = rng.normal(size=(2, HARMONICS, n)) / (CORNER + k[:, None]) ** 2
    sine, cosine = np.sin(np.outer(phase, k)), np.cos(np.outer(phase, k))
    q = sine @ a + cosine @ b
    dq = (cosine * k) @ a - (sine * k) @ b  # per rad of phase
    ddq = -(sine * k**2) @ a - (cosine * k**2) @ b
    qd = dq * rate[:, None]
    qdd = ddq * rate[:, None] ** 2 + dq * bend[:, None]
    middle = 0.5 * (q.max(axis=0) + q.min(axis=0))
    room = 0.5 * (space.high - space.low) / (0.5 * np.ptp(q, axis=0))
    size = 0.99 * shrink * np.minimum(room, space.speed / np.abs(qd).max(axis=0))
    centre = 0.5 * (space.high + space.low)
    return centre + size * (q - middle), size * qd, size * qdd


def _equations(robot: Robot, time: Array, q: Array, qd: Array) -> tuple[Equations, Evidence]:
    """What the motion will tell: the normal equations of everything that may be wrong."""
    n, k = len(robot.joint_names), len(robot.sensor_names)
    nothing = np.zeros((len(time), n)), np.zeros((len(time), k, 6))
    evidence = gather(robot, [[Samples(time, q, qd, *nothing)]])
    columns: list[Column] = []
    for r in np.flatnonzero(evidence.used).tolist():
        columns.append(Column("bias", r))
        if r < n:
            columns += [Column("coulomb", r, 0.05), Column("viscous", r)]
            if robot.description.joints[r].torque == "motor":
                columns.append(Column("rotor", r))
    links = main_links(robot)
    model = np.abs(evidence.model[:, evidence.used]).max(axis=(0, 1, 3), initial=0.0)
    bodies = tuple(BodyChange(i, links[i][1], LINK_SIGMA) for i in links if model[i] > 0)
    loads = np.abs(evidence.residual()).max(axis=0)
    sigma = np.maximum(ERROR, ERROR_SHARE * loads)
    weight = np.broadcast_to(CORRELATED / sigma**2, evidence.reading.shape)
    every = np.ones(len(evidence), dtype=bool)
    problem = Problem(tuple(columns), bodies)
    return Equations.of(evidence, problem, evidence.residual(), weight, every), evidence


def _score(robot: Robot, time: Array, q: Array, qd: Array) -> float:
    """How much a motion tells: the logarithm of the determinant, in units of the prior."""
    every = 4  # a coarser motion tells candidates apart as well
    equations, _ = _equations(robot, time[::every], q[::every], qd[::every])
    J, prior = equations.jacobian_at_start(), equations.whole_prior()
    H = J.T @ equations.normal @ J
    root = 1.0 / np.sqrt(prior + 1e-6)
    return float(np.linalg.slogdet(np.eye(len(H)) + root[:, None] * H * root)[1])


def _foretell(
    robot: Robot, time: Array, q: Array, qd: Array
) -> tuple[list[tuple[str, float, str]], list[str]]:
    """Standard errors, and what will stay unknown."""
    equations, evidence = _equations(robot, time, q, qd)
    problem, names = equations.problem, evidence.rows.names
    J = equations.jacobian_at_start()
    C = np.linalg.pinv(J.T @ equations.normal @ J + np.diag(equations.whole_prior()))
    sigma = np.sqrt(np.maximum(np.diag(J @ C @ J.T), 0.0))
    told: list[tuple[str, float, str]] = []
    kinds = (("bias", "offsets of joints", "Nm"), ("coulomb", "Coulomb friction", "Nm"))
    kinds += (("viscous", "viscous friction", "Nm s/rad"), ("rotor", "rotor inertia", "kg m2"))
    for kind, what, unit in kinds:
        own = [
            s
            for c, s in zip(problem.columns, sigma, strict=False)
            if c.kind == kind and c.row < evidence.joints
        ]
        if own:
            told.append((f"{what}, the worst joint", max(own), unit))
    for c, s in zip(problem.columns, sigma, strict=False):
        if c.row >= evidence.joints:
            told.append((f"bias of {names[c.row]}", s, "N" if names[c.row][-2] == "f" else "Nm"))
    told += _payload_errors(evidence, equations)
    unknown = []
    links = main_links(robot)
    for i, body in enumerate(problem.bodies):
        mass, error = body.model[0], sigma[len(problem.columns) + 10 * i]
        prior = 2.0 * body.sigma * mass
        if error < 0.5 * prior:
            told.append((f"mass of {links[body.node][0]}", error, "kg"))
        else:
            unknown.append(f"mass of {links[body.node][0]}")
    return told, unknown


def _payload_errors(evidence: Evidence, equations: Equations) -> list[tuple[str, float, str]]:
    """Errors of a payload's mass, and of its centre if it weighs a kilogram."""
    told = []
    problem = equations.problem
    linear = len(problem.columns)
    nodes = [body.node for body in problem.bodies]
    for node in seen_leaves(evidence):
        if node not in nodes:
            continue
        first = linear + 10 * nodes.index(node)
        index = np.array([*range(linear), *range(first, first + 4)])
        prior = np.concatenate([equations.only(Problem(problem.columns)).prior(), np.zeros(4)])
        C = np.linalg.pinv(equations.normal[np.ix_(index, index)] + np.diag(prior))
        mass, *centre = np.sqrt(np.maximum(np.diag(C)[linear:], 0.0))
        link = payload_link(evidence.robot, node)
        told.append((f"mass of a payload at {link}", float(mass), "kg"))
        told.append((f"centre of 1 kg at {link}, worst axis", float(max(centre)), "m"))
    return told


def _poses(space: _Space, rng: np.random.Generator) -> Array:
    """Poses in which gravity pulls at each sensor from all sides, chosen one after the other."""
    robot = space.robot
    if not robot.sensor_names:
        return np.empty((0, len(robot.joint_names)))
    tried = rng.uniform(space.low, space.high, (CANDIDATES, len(space.low)))
    down = robot.gravity / max(float(np.linalg.norm(robot.gravity)), 1e-9)
    frames = np.array([robot.sensor_poses(q)[:, :3, :3] for q in tried])
    seen = np.swapaxes(frames, -1, -2) @ down
    rows = np.concatenate([seen, np.ones((*seen.shape[:2], 1))], axis=-1)  # and a bias
    total = 1e-3 * np.eye(4) + np.zeros((len(robot.sensor_names), 4, 4))
    chosen: list[int] = []
    left = set(range(CANDIDATES))
    while len(chosen) < POSES and left:
        gain = {
            i: float(np.linalg.slogdet(total + rows[i][:, :, None] * rows[i][:, None, :])[1].sum())
            for i in left
        }
        best = max(gain, key=lambda i: gain[i])
        left.discard(best)
        if space.clear(tried[best]):
            chosen.append(best)
            total = total + rows[best][:, :, None] * rows[best][:, None, :]
    return tried[chosen]


def _rounded(values: Array) -> list[float]:
    return [round(float(x), 6) for x in values]


def _yaml(names: list[str], points: list[dict]) -> str:
    lines = [f"joint_names: [{', '.join(names)}]", "points:"]
    for point in points:
        for i, (key, value) in enumerate(point.items()):
            if isinstance(value, list):  # YAML 1.1 takes 1e-06 for text
                text = f"[{', '.join(f'{x:.6f}' for x in value)}]"
            else:
                text = f"{{{', '.join(f'{k}: {v}' for k, v in value.items())}}}"
            lines.append(f"{'  - ' if i == 0 else '    '}{key}: {text}")
    return "\n".join(lines) + "\n"


def _python(plan: Plan, names: list[str]) -> str:
    rows = [f"    ({t:.3f}, {_rounded(q)})," for t, q in zip(plan.time, plan.q, strict=True)]
    head = '"""Time [s] and joint positions [rad] of a motion for calibration."""'
    return "\n".join([head, "", f"JOINTS = {names}", "POINTS = [", *rows, "]", ""])
