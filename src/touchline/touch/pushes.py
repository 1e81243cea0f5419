# SPDX-License-Identifier: Apache-2.0
"""Which joint torques a push on the surface can bring, in one posture.

A push at a point x with force f brings `J(x)^T f`: its direction follows from the place and the
direction of the force, not from its size. Pushes all over the surface, near its normal, so make a
density of directions; and a hand that wavers in place and direction moves one direction in the few
ways that `J` allows. Both are sums of bell curves on the planes that touch the unit sphere where
the curves have their middles; on these planes the directions of forces at one point form a plane.
"""

from dataclasses import dataclass
from math import lgamma

import numpy as np

from touchline.arrays import Array, Mask
from touchline.localizer.skin import Patch, Skin

POINTS = 200  # pushes on each link: some 2 cm apart on a forearm
CONE = 0.3  # rad: one sigma, in two directions, between a push and the surface's normal
LEAST_LEVER = 0.02  # Nm/N; pushes that move the joints less cannot be felt
LEAST_COSINE = 0.1  # directions farther apart (84 degrees) have nothing to do with each other
OTHER = 0.01  # of the touches: two hands, a hand that pulls, a push on what is mounted on the arm
LIKELY = 60  # of the pushes: those that explain a direction best; the rest does not count


@dataclass(frozen=True)
class Directions:
    """A density of unit vectors (n,): a sum of bell curves.

    Attributes:
        middles: (M, n) unit vectors.
        variances: (M, n) along `axes` (M, n, n), one in each column.
        axes: see `variances`.
        weights: (M,) logarithms.
    """

    middles: Array
    variances: Array
    axes: Array
    weights: Array

    @staticmethod
    def of(middles: Array, covariances: Array, weights: Array) -> "Directions":
        """Of middles (M, n), covariances (M, n, n) and weights (M,)."""
        variances, axes = np.linalg.eigh(covariances)
        with np.errstate(divide="ignore"):
            return Directions(middles, np.maximum(variances, 0.0), axes, np.log(weights))

    def log_densities(self, unit: Array, noise: float) -> Array:
        """Of each bell curve (M,) at a unit vector (n,) with noise of one sigma `noise`."""
        cosine = self.middles @ unit
        near = cosine > LEAST_COSINE
        found = np.full(len(cosine), -np.inf)
        if not near.any():
            return found
        off = unit / cosine[near, None] - self.middles[near]
        along = (off[:, None, :] @ self.axes[near])[:, 0]
        spread = self.variances[near] + noise**2
        found[near] = (
            self.weights[near]
            - 0.5 * (along**2 / spread + np.log(2.0 * np.pi * spread)).sum(axis=1)
            - len(unit) * np.log(cosine[near])
        )
        return found

    def log_density(self, unit: Array, noise: float) -> float:
        """Of a unit vector (n,) that carries noise of one sigma `noise`."""
        return log_sum(self.log_densities(unit, noise))


class Pushes:
    """Pushes all over a robot's surface, in one posture.

    Args:
        skin: of the robot.
        q: (n,) [rad or m].
        known: (n,) bool, the joints whose torque is measured; directions have these alone.

    Attributes:
        directions: the density of what pushes anywhere bring.
        links: (M,) the link that each is on.
    """

    def __init__(self, skin: Skin, q: Array, known: Mask) -> None:
        poses, rng = skin.robot.poses(q), np.random.default_rng(0)
        parts = [_on_link(skin, patch, poses, known, rng) for patch in skin.patches]
        levers, axes, into, apart, links = (
            np.concatenate([part[i] for part in parts]) for i in range(5)
        )
        felt = np.linalg.norm((levers @ into[:, :, None])[:, :, 0], axis=1) > LEAST_LEVER
        self._levers, self._axes, self._into = levers[felt], axes[felt], into[felt]
        self.links = links[felt]
        middles, by_force, by_place = self._shapes(slice(None), self._into)
        spread = CONE**2 * _square(by_force) + (apart[felt, None, None] / 2) ** 2 * _square(
            by_place
        )
        weights = np.full(len(middles), 1.0 / max(1, len(middles)))
        self.directions = Directions.of(middles, spread, weights)

    def log_density(self, unit: Array, noise: float) -> float:
        """Of a direction (n,) of a touch anywhere, seen with noise of one sigma `noise`.

        Most touches are single pushes; of the others any direction is as likely.
        """
        n = len(unit)
        sphere = np.log(2.0) + 0.5 * n * np.log(np.pi) - lgamma(0.5 * n)  # its area
        other = -sphere - 0.5 * np.log(2.0 * np.pi * noise**2)  # noise across the sphere, as a bell
        pushes = self.directions.log_density(unit, noise)
        return float(np.logaddexp(np.log1p(-OTHER) + pushes, np.log(OTHER) + other))

    def wavering(self, unit: Array, noise: float) -> tuple[Array, Array]:
        """How a direction (n,) varies with the direction of the force, and with the place.

        Over the pushes that may have brought it, seen with noise of one sigma `noise`.

        Returns:
            Covariances (n, n) for one radian each way, and for one metre each way.
        """
        aside = np.eye(len(unit)) - np.outer(unit, unit)
        logs = self.directions.log_densities(unit, noise)
        likely = np.argsort(-logs)[:LIKELY]
        if not len(likely) or not np.isfinite(logs[likely[0]]):
            return aside, np.zeros_like(aside)  # no push brings it: it may vary in any way
        weights = np.exp(logs[likely] - logs[likely[0]])
        weights /= weights.sum()
        forces = np.array([self._force(i, unit, noise) for i in likely])
        _, *parts = self._shapes(likely, forces)
        by_force, by_place = (
            aside @ np.einsum("i,ijk->jk", weights, _square(part)) @ aside for part in parts
        )
        return by_force, by_place

    def _force(self, push: int, unit: Array, noise: float) -> Array:
        """The direction (3,) of the force at a push's point that explains a direction best."""
        into, levers = self._into[push], self._levers[push]
        aside = np.stack(_aside(into[None]), axis=-1)[0]
        columns = np.column_stack([levers @ into, levers @ aside])
        stiff = np.r_[0.0, 1.0, 1.0] * (noise * np.linalg.norm(columns[:, 0]) / CONE) ** 2
        parts = np.linalg.solve(columns.T @ columns + np.diag(stiff), columns.T @ unit)
        force = into * parts[0] + aside @ parts[1:]
        return force / np.linalg.norm(force)

    def _shapes(self, which, forces: Array) -> tuple[Array, Array, Array]:
        """Directions (m, n), and their change (m, n, 2) with the force [1/rad], the place [1/m]."""
        levers, axes, into = self._levers[which], self._axes[which], self._into[which]
        torques = (levers @ forces[:, :, None])[:, :, 0]
        sizes = np.linalg.norm(torques, axis=1)
        units = torques / sizes[:, None]
        by_force = levers @ np.stack(_aside(forces), axis=-1)
        by_place = np.stack(
            [(np.cross(axes, way[:, None]) @ forces[:, :, None])[:, :, 0] for way in _aside(into)],
            axis=-1,
        )
        flat = np.eye(units.shape[1]) - units[:, :, None] * units[:, None, :]
        scale = sizes[:, None, None]
        return units, flat @ by_force / scale, flat @ by_place / scale


def log_sum(logs: Array) -> float:
    """The logarithm of the sum of what has these logarithms."""
    highest = float(np.max(logs, initial=-np.inf))
    return highest + float(np.log(np.exp(logs - highest).sum())) if highest > -np.inf else -np.inf


def _on_link(skin: Skin, patch: Patch, poses: Array, known: Mask, rng) -> tuple[Array, ...]:
    """Of pushes on a link: levers (P, k, 3), joint axes (P, k, 3), ways in (P, 3), spacing, link.

    A force f at the point brings the torques `levers @ f`; the axes are those about which a joint
    turns that carries the link, zero for the others.
    """
    surface, T = patch.surface, poses[patch.node] @ patch.T_node_link
    picked = rng.choice(len(surface.faces), POINTS, p=surface.areas / surface.areas.sum())
    a, b = np.sort(rng.random((2, POINTS, 1)), axis=0)
    corners = surface.vertices[surface.faces[picked]]
    points = a * corners[:, 0] + (b - a) * corners[:, 1] + (1.0 - b) * corners[:, 2]
    points = points @ T[:3, :3].T + T[:3, 3]
    into = -surface.normals[picked] @ T[:3, :3].T
    levers, axes = np.zeros((2, POINTS, len(known), 3))
    node = patch.node
    while node >= 0:
        here, pose = skin.robot.nodes[node], poses[node]
        if here.coordinate >= 0:
            axis = here.multiplier * pose[:3, 2]
            if here.kind == "revolute":
                levers[:, here.coordinate] += np.cross(axis, points - pose[:3, 3])
                axes[:, here.coordinate] += axis
            else:
                levers[:, here.coordinate] += axis
        node = here.parent
    apart = np.full(POINTS, np.sqrt(surface.areas.sum() / POINTS))
    return levers[:, known], axes[:, known], into, apart, np.full(POINTS, patch.link)


def _aside(ways: Array) -> tuple[Array, Array]:
    """Two unit vectors (m, 3) across each of some unit vectors (m, 3)."""
    other = np.where(np.abs(ways[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    one: Array = np.cross(ways, other)
    one = one / np.linalg.norm(one, axis=1, keepdims=True)
    return one, np.asarray(np.cross(ways, one), float)


def _square(columns: Array) -> Array:
    return columns @ columns.transpose(0, 2, 1)
