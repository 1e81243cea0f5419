# SPDX-License-Identifier: Apache-2.0
"""Where two contacts may be, given exact readings: by geometry, without the estimator.

Let F, M be a segment's wrench about the world origin, f a force at the point p of one body and
h = F - f that on another. The wrench M - p x f that is left must be one of a pure force, and
h . (M - p x f) = 0 is linear in f: (M - p x F) . f = F . M. So is every joint torque between the
two bodies. With m of these, f has 2 - m degrees of freedom at each p; for m = 3 (nine equations for
ten unknowns) p must lie on a curve. What f remains must lie in its friction cone, and the line of h
must enter the other body, in its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array, Index, Mask
from touchline.bench.localization.touched import NEAR
from touchline.localizer.skin import Patch, Skin
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads
from touchline.result.contact import Contact
from touchline.trials.touches import Touch

MOST_FORCE = 100.0  # N: larger ones are not looked at
ALONG = 40  # forces that are tried on a line of forces
POINTS = 600  # that stand for a surface
CONSISTENT = 1e-6  # Nm: equations without unknowns


@dataclass(frozen=True)
class SurfacePoints:
    """Points uniform over the area of the links that a segment's sensors feel.

    Attributes:
        patches: of the segment.
        patch: (N,) index into `patches`.
        position: (N, 3) [m] and `normal` (N, 3), outward, in world.
    """

    patches: tuple[Patch, ...]
    patch: Index
    position: Array
    normal: Array

    def of_body(self, body: str) -> Index:
        """Indices of the points on a rigid body."""
        return np.flatnonzero([self.patches[k].body == body for k in self.patch])


def scatter(
    skin: Skin, q: Array, segment: str, count: int, rng: np.random.Generator
) -> SurfacePoints:
    """Random `SurfacePoints` of a segment at joint positions `q` (n,)."""
    patches = tuple(patch for patch in skin.patches if patch.segment == segment)
    areas = [patch.surface.areas for patch in patches]
    shares = np.array([area.sum() for area in areas])
    which = rng.choice(len(patches), count, p=shares / shares.sum())
    position, normal = np.empty((count, 3)), np.empty((count, 3))
    for k, (patch, area) in enumerate(zip(patches, areas, strict=True)):
        mine, surface = np.flatnonzero(which == k), patch.surface
        faces = rng.choice(len(area), len(mine), p=area / area.sum())
        corner = rng.dirichlet(np.ones(3), len(mine))
        T = skin.robot.poses(q)[patch.node] @ patch.T_node_link
        local = np.einsum("ij,ijk->ik", corner, surface.vertices[surface.faces[faces]])
        position[mine] = local @ T[:3, :3].T + T[:3, 3]
        normal[mine] = surface.normals[faces] @ T[:3, :3].T
    return SurfacePoints(patches, which, position, normal)


@dataclass(frozen=True)
class Readings:
    """What exact sensors say of the contacts on one segment.

    Attributes:
        q: joint positions (n,).
        wrench: (6,) of all contacts, world axes, about the world origin.
        torque: (n,) [Nm] of the joints; NaN where a joint has no sensor.
    """

    q: Array
    wrench: Array
    torque: Array


def exact_readings(robot: Robot, touches: Sequence[Touch]) -> Readings:
    """What the sensors would say of touches of one segment, without noise."""
    q = touches[0].q
    wrenches = [np.r_[t.force, np.cross(t.position, t.force)] for t in touches]
    torque = sum(
        contact_loads(robot, q, touch.patch.link, wrench).torque
        for touch, wrench in zip(touches, wrenches, strict=True)
    )
    own = [joint.measured for joint in robot.description.joints]
    return Readings(q, np.sum(wrenches, axis=0), np.where(own, torque, np.nan))


def covered(answers: Sequence[Contact], points: SurfacePoints) -> Mask:
    """For each point (N,): does it lie in a part of a link that answers name?"""
    inside = np.zeros(len(points.patch), dtype=bool)
    links = np.array([patch.link for patch in points.patches])[points.patch]
    for candidate in (k for answer in answers for k in answer.candidates):
        distance = np.linalg.norm(points.position - candidate.position, axis=1)
        inside |= (links == candidate.link) & (distance < max(NEAR, candidate.radius))
    return inside


class CompatiblePairs:
    """Which points may be touched by one of two contacts on different bodies.

    Args:
        skin: the robot's surfaces.
        readings: exact.
        friction: coefficient of the friction cones.
        resolution: points within it of a curve of such points count as well [m].
    """

    def __init__(
        self, skin: Skin, readings: Readings, friction: float, resolution: float = 5e-3
    ) -> None:
        self._skin, self._said, self._resolution = skin, readings, resolution
        self._least_cosine = float(np.cos(np.arctan(friction)))
        self._poses = skin.robot.poses(readings.q)
        self._F, self._M = readings.wrench[:3], readings.wrench[3:]

    def touched(self, points: SurfacePoints) -> Mask:
        """For each point (N,): is it one of a pair that the readings allow?"""
        touched = np.zeros(len(points.patch), dtype=bool)
        bodies = list(dict.fromkeys(patch.body for patch in points.patches))
        for one in bodies:
            for other in bodies:
                equations = self._equations(points, one, other) if one != other else None
                if equations is None or len(equations[0]) > 3:
                    continue
                for i in points.of_body(one):
                    touched[i] = touched[i] or self._allowed(points, int(i), other, *equations)
        return touched

    def _equations(self, points: SurfacePoints, one: str, other: str) -> tuple[Array, Array] | None:
        """A (m, 6) and b (m,): A w = b of the wrench w on `one`; None if the readings forbid it."""
        known = np.isfinite(self._said.torque)
        loads = [self._torques(points, body)[known] for body in (one, other)]
        A = loads[0] - loads[1]
        b = self._said.torque[known] - loads[1] @ self._said.wrench
        tells = np.abs(A).max(axis=1) > 1e-9
        return None if np.abs(b[~tells]).max(initial=0.0) > CONSISTENT else (A[tells], b[tells])

    def _torques(self, points: SurfacePoints, body: str) -> Array:
        """What wrenches on a body do to the joints (n, 6)."""
        link = next(patch.link for patch in points.patches if patch.body == body)
        return contact_loads(self._skin.robot, self._said.q, link, np.eye(6)).torque.T

    def _allowed(self, points: SurfacePoints, i: int, other: str, A: Array, b: Array) -> bool:
        p, normal = points.position[i], points.normal[i]
        E, e = self._linear(p, A, b)
        if len(E) == 4 and self._from_curve(p, normal, A, b) > self._resolution:
            return False
        for f in self._forces(E, e, normal):
            h, m = self._F - f, self._M - np.cross(p, f)
            if self._enters(points, other, h, m):
                return True
        return False

    def _linear(self, p: Array, A: Array, b: Array) -> tuple[Array, Array]:
        """E f = e of the force at p."""
        E = A[:, :3] + np.cross(A[:, 3:], p)  # m . (p x f) = f . (m x p)
        about = self._M - np.cross(p, self._F)
        return np.vstack([E, about]), np.r_[b, self._F @ self._M]

    def _from_curve(self, p: Array, normal: Array, A: Array, b: Array) -> float:
        """Distance [m] of p from where four equations have a solution, to first order."""

        def excess(x: Array) -> float:
            E, e = self._linear(x, A, b)
            return float(np.linalg.det(np.c_[E, e]))

        s = np.linalg.svd(normal[None])[2][1:]  # two tangents
        slope = [(excess(p + 1e-4 * t) - excess(p - 1e-4 * t)) / 2e-4 for t in s]
        return abs(excess(p)) / max(float(np.linalg.norm(slope)), 1e-300)

    def _forces(self, E: Array, e: Array, normal: Array) -> Array:
        """Forces (k, 3) in the friction cone that solve E f = e: all, or many of a line."""
        start = np.linalg.lstsq(E, e, rcond=None)[0].astype(np.float64)
        if len(E) >= 3:
            found = start[None]
        elif len(E) == 2:
            way = np.cross(E[0], E[1])
            way /= np.linalg.norm(way)
            found = start + self._in_cone(start, way, normal)[:, None] * way
        else:  # no joint tells the two bodies apart: one force in each direction
            ways = self._directions(normal)
            found = e[0] / (ways @ E[0])[:, None] * ways
        size = np.linalg.norm(found, axis=1)
        ok = (size > 0) & (size < MOST_FORCE) & (-found @ normal >= self._least_cosine * size)
        return np.asarray(found[ok], dtype=np.float64)

    def _directions(self, normal: Array) -> Array:
        """Unit vectors (k, 3) spread over the friction cone."""
        s = np.linalg.svd(normal[None])[2][1:]
        i = np.arange(ALONG) + 0.5
        cosine = 1.0 - (1.0 - self._least_cosine) * i / ALONG
        turn = np.pi * (1.0 + np.sqrt(5.0)) * i
        around = np.cos(turn)[:, None] * s[0] + np.sin(turn)[:, None] * s[1]
        return np.sqrt(1.0 - cosine**2)[:, None] * around - cosine[:, None] * normal

    def _in_cone(self, start: Array, way: Array, normal: Array) -> Array:
        """Numbers s so that start + s way lies in the friction cone, from end to end."""
        n0, n1, c2 = start @ normal, way @ normal, self._least_cosine**2
        roots = np.roots(
            [n1**2 - c2, 2 * (n0 * n1 - c2 * (start @ way)), n0**2 - c2 * (start @ start)]
        )
        ends = np.r_[-MOST_FORCE, np.sort(roots.real[np.abs(roots.imag) < 1e-12]), MOST_FORCE]
        parts = []
        for low, high in zip(ends[:-1], ends[1:], strict=True):
            f = start + 0.5 * (low + high) * way
            if high > low and -f @ normal >= self._least_cosine * np.linalg.norm(f):
                parts.append(np.linspace(low, high, ALONG + 2)[1:-1])
        return np.concatenate(parts) if parts else np.empty(0)

    def _enters(self, points: SurfacePoints, body: str, h: Array, m: Array) -> bool:
        """Does the line of a pure force enter a body within the friction cone?"""
        size = float(np.linalg.norm(h))
        if not 0.0 < size < MOST_FORCE:
            return False
        u, x = h / size, np.cross(h, m) / size**2
        for patch in points.patches:
            if patch.body != body:
                continue
            R, p = self._poses[patch.node][:3, :3], self._poses[patch.node][:3, 3]
            rows = patch.mesh.crossings(R.T @ (x - p), R.T @ u)
            if len(rows) and (-(rows[:, 2:5] @ (R.T @ u)) >= self._least_cosine).any():
                return True
        return False


def surface_shares(
    skin: Skin, touches: Sequence[Touch], answers: Sequence[Contact], friction: float, seed: int
) -> tuple[float, float]:
    """Which share of a segment's surface is named for two touches, and which exact readings allow.

    NaN for touches that do not share a segment with a six-axis sensor.
    """
    segments = {touch.patch.segment for touch in touches}
    segment = touches[0].patch.segment
    if len(segments) > 1 or segment is None or segment not in skin.robot.sensor_names:
        return np.nan, np.nan
    points = scatter(skin, touches[0].q, segment, POINTS, np.random.default_rng(seed))
    readings = exact_readings(skin.robot, touches)
    allowed = CompatiblePairs(skin, readings, friction).touched(points)
    return float(covered(answers, points).mean()), float(allowed.mean())
