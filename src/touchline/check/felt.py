# SPDX-License-Identifier: Apache-2.0
"""What can be felt: the smallest force on each link that these sensors and thresholds find."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from touchline.arrays import Array
from touchline.check.findings import Findings
from touchline.detector.residual_noise import residual_noise
from touchline.detector.thresholds import RowThreshold, make_thresholds
from touchline.localizer.skin import Patch, Skin
from touchline.model.robot import Robot

POSTURES, PLACES = 60, 12  # drawn: 720 pushes on a link
SHARE = 0.95  # of the pushes are found
NOISE_SIGMAS = 1.645  # above the threshold: 95 % of the samples fire
FRICTION = 0.5  # largest tangent of the angle between a push and the surface's normal
POINT_RANK = 5  # unknowns of a push: three of its force, two of its place


@dataclass(frozen=True)
class Felt:
    """What can be felt on one link.

    Attributes:
        link: name.
        segment: that feels it; None if no sensor can.
        force: of which SHARE of all pushes are found [N]; infinite where more go unnoticed.
        median: of which half are found [N].
        rank: how many independent measurements a push loads, at most 6; it has five unknowns.
    """

    link: str
    segment: str | None
    force: float
    median: float
    rank: int

    @property
    def place(self) -> str:
        """What is told of the place."""
        if self.segment is None or self.rank == 0:
            return "nothing"
        if self.rank >= POINT_RANK:
            return "a place"
        return f"candidates: {self.rank} of {POINT_RANK} unknowns are measured"

    def faint(self, touch: str, force: float) -> str | None:
        """A line on a touch of this link that is weaker than what is surely felt; else None.

        Args:
            touch: what it is called.
            force: of it [N].
        """
        if not force < self.force:
            return None
        start = f"{touch}: {force:.1f} N on {self.link} lies below what can be felt there"
        if not np.isfinite(self.force):
            return f"{start}: many pushes on it load no sensor"
        return f"{start}: {100 * SHARE:.0f} % are found from {self.force:.1f} N on"


@lru_cache(maxsize=4)
def felt(robot: Robot, period: float = 1e-3) -> tuple[Felt, ...]:
    """What can be felt on each link that has a surface.

    A push of force F at a place x with direction u loads the joints by J(x)^T u F (eq. 2) and the
    sensor of its segment by F [u; x x u]. It is found when one row is beyond its contact threshold
    although noise stands against it: F = min over the rows of (threshold + 1.645 sigma) / |load|.
    Pushes are drawn evenly over postures, surfaces, and a friction cone.

    Args:
        robot: with its noise figures and thresholds.
        period: between samples [s].
    """
    rows = make_thresholds(robot, period).rows
    limits = _limits(robot, rows, period)
    rng = np.random.default_rng(0)
    postures = rng.uniform(*robot.ranges, (POSTURES, len(robot.joint_names)))
    frames = np.array([robot.poses(q) for q in postures])
    screws = np.zeros((len(frames), len(rows), 6))
    for i, row in enumerate(rows):
        screws[:, i] = screw_of(robot, row, frames)
    patches = Skin(robot).patches
    return tuple(_on_link(robot, patch, rows, limits, frames, screws, rng) for patch in patches)


def note_felt(robot: Robot, findings: Findings, period: float = 1e-3) -> None:
    """Add a table of what can be felt."""
    links = felt(robot, period)
    if not links:
        findings.note(
            "what can be felt",
            "  no link has a surface: a touch is felt in the joints that it loads, and not located",
        )
        return
    lines = [
        "  smallest pushes found, of any direction and posture: 95 % and 50 % of them (thresholds "
        f"at {1.0 / period:.4g} Hz)",
        f"  {'link':24} {'95 % [N]':>9} {'50 % [N]':>9}  where",
    ]
    deaf = []
    for found in links:
        lines.append(
            f"  {found.link:24} {_number(found.force):>9} {_number(found.median):>9}  {found.place}"
        )
        if not np.isfinite(found.median):
            deaf.append(found.link)
    findings.note("what can be felt", *lines)
    if deaf:
        findings.note(
            "what can be felt", f"  most pushes on {', '.join(deaf)} load no sensor at all"
        )


def _number(force: float) -> str:
    return f"{force:.1f}" if np.isfinite(force) else "never"


def _limits(robot: Robot, rows: tuple[RowThreshold, ...], period: float) -> Array:
    """What each row (r,) must show to be found in 95 % of the samples [N or Nm]."""
    torque, wrench = residual_noise(robot, period)
    limits = []
    for row in rows:
        if row.component < 0:
            sigma = torque[row.joint]
        else:
            sigma = wrench[robot.segment_names[row.segment]][row.component]
        limits.append(row.contact + NOISE_SIGMAS * float(sigma))
    return np.array(limits)


def _on_link(
    robot: Robot,
    patch: Patch,
    rows: tuple[RowThreshold, ...],
    limits: Array,
    frames: Array,
    screws: Array,
    rng: np.random.Generator,
) -> Felt:
    body = robot.body_of(patch.link)
    own = [i for i, row in enumerate(rows) if robot.segment_names[row.segment] == body.segment]
    moved = set(robot.joints_inboard_of(body))
    own = [i for i in own if rows[i].component >= 0 or robot.joint_names[rows[i].joint] in moved]
    if not own:
        return Felt(patch.link, None, np.inf, np.inf, 0)
    forces, screws = [], screws[:, own]
    for poses, shown in zip(frames, screws, strict=True):
        points, directions = _pushes(patch, poses[patch.node], rng)
        wrenches = np.hstack([directions, np.cross(points, directions)])
        loads = np.abs(wrenches @ shown.T)
        with np.errstate(divide="ignore"):
            forces.append(np.min(limits[own] / loads, axis=1))
    rank = int(np.max(np.linalg.matrix_rank(screws, tol=1e-6)))
    low, high = np.quantile(np.concatenate(forces), (0.5, SHARE), method="higher")
    return Felt(patch.link, body.segment, float(high), float(low), rank)


def _pushes(patch: Patch, T_world_node: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Places (p, 3) on a surface and unit directions (p, 3) into it, in world."""
    surface = patch.surface
    picked = rng.choice(len(surface.faces), PLACES, p=surface.areas / surface.areas.sum())
    a, b = np.sort(rng.random((2, PLACES, 1)), axis=0)
    corners = surface.vertices[surface.faces[picked]]
    points = a * corners[:, 0] + (b - a) * corners[:, 1] + (1.0 - b) * corners[:, 2]
    into = -surface.normals[picked]
    aside = np.cross(into, rng.normal(size=(PLACES, 3)))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    directions = into + FRICTION * rng.random((PLACES, 1)) * aside
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    T = T_world_node @ patch.T_node_link
    return points @ T[:3, :3].T + T[:3, 3], directions @ T[:3, :3].T


def screw_of(robot: Robot, row: RowThreshold, poses: Array) -> Array:
    """What a row shows of a wrench about the world's origin: its joint's or axis's screw (..., 6).

    Args:
        robot: the robot.
        row: of the detector.
        poses: (..., nodes, 4, 4) of the nodes in world.
    """
    if row.component < 0:
        name = robot.joint_names[row.joint]
        node = next(i for i, n in enumerate(robot.nodes) if n.joint == name)
        along, straight = 2, robot.nodes[node].kind == "prismatic"
    else:
        segment = robot.segment_names[row.segment]
        node = next(i for i, n in enumerate(robot.nodes) if n.sensor == segment)
        along, straight = row.component % 3, row.component < 3
    axis, origin = poses[..., node, :3, along], poses[..., node, :3, 3]
    parts = (axis, np.zeros_like(axis)) if straight else (np.cross(origin, axis), axis)
    return np.concatenate(parts, axis=-1)
