# SPDX-License-Identifier: Apache-2.0
"""A contact particle filter, written from its description: Manuelli and Tedrake, IROS 2016.

Particles are points of the links' surfaces. The likelihood of one follows from a quadratic program:
the least misfit of the measured residual over forces in the friction cone, here a pyramid of four
edges. Particles are moved at random along the surface, weighed and resampled. A further set of
particles begins where those there are leave the residual unexplained. Each set is weighed with
the others at their best places. Theirs has joint torques alone; this one has all rows of the robot,
its force-torque sensors included, with the same noise figures as our estimator.
"""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array, Index
from touchline.localizer.skin import Skin
from touchline.model.transforms import rotation_to_axis
from touchline.observer.dynamics import contact_loads

EDGES = 4  # of the friction pyramid
PIVOTS = 16  # rounds of the quadratic program
LEAST_NOISE = (0.05, 0.01, 0.05)  # N, Nm, Nm per sample: particles lie too thin for less
UNEXPLAINED = 4.0  # misfit per row beyond which another contact is supposed
REMAINING = 0.1  # of the particles that have a say after an update, at least
FRESH = 0.1  # of the particles that begin anew while a residual is unexplained
LEAST_PUSH = 1.0  # N, below which a contact is given up
YIELDING = 6  # updates for which the others hold still when a set begins
PATIENCE = 12  # updates that a set gets before another one begins
FINE, NARROW, WIDE = 3e-4, 4e-3, 0.03  # m, steps of the particles; up to wide while unexplained


@dataclass
class Particles:
    """A set of points, all explaining one contact.

    Attributes:
        patch: (p,) index of the surface.
        point: (p, 3) [m] and `normal` (p, 3), in the frame of the surface's node.
        best: index of the likeliest.
        cost: misfit of the likeliest, and `push` the sum of its forces along the edges [N].
        age: updates since it began.
    """

    patch: Index
    point: Array
    normal: Array
    best: int = 0
    cost: float = np.inf
    push: float = 0.0
    age: int = 0


class ParticleFilter:
    """Follows the contacts of an arm at rest.

    Args:
        skin: the robot's surfaces.
        q: joint positions (n,) [rad or m].
        rng: source of chance.
        period: between samples [s], for the noise that the observer lets through.
        count: particles per contact.
        most: contacts at once.
        friction: coefficient of the friction cone.
    """

    def __init__(
        self,
        skin: Skin,
        q: Array,
        rng: np.random.Generator,
        period: float = 1e-3,
        count: int = 200,
        most: int = 3,
        friction: float = 0.8,
    ) -> None:
        self.robot, self._rng, self._count, self._most = skin.robot, rng, count, most
        self._patches = [patch for patch in skin.patches if patch.segment is not None]
        self._rows, self._scale = _rows_and_noise(skin, period)
        self._poses = self.robot.poses(q)
        loads = {p.node: self._load_matrix(q, p.link) for p in self._patches}
        self._loads = np.array([loads[patch.node] for patch in self._patches])
        self._friction = friction
        areas = np.array([patch.surface.areas.sum() for patch in self._patches])
        self._shares = areas / areas.sum()
        self.sets: list[Particles] = []

    def update(self, residual: Array) -> None:
        """Takes the residual of all rows (n + 6 k,) [Nm; N, Nm in the sensors' frames]."""
        y = residual[self._rows] / self._scale
        self._count_sets(y)
        newest = self.sets[-1].age if self.sets else 0
        for k, particles in enumerate(self.sets):
            if k + 1 < len(self.sets) and newest < YIELDING:
                continue  # what has just begun is explained by the newest
            self._move(particles)
            x, cost = least_misfit(self._with_others(k), y)
            particles.push = float(x[int(np.argmin(cost)), :EDGES].sum())
            self._resample(particles, cost)
        self.sets = [s for s in self.sets if s.push > LEAST_PUSH or s.age < PATIENCE]

    def places(self) -> list[Array]:
        """The likeliest point (3,) [m] of each contact, in world."""
        found = []
        for s in self.sets:
            T = self._poses[self._patches[s.patch[s.best]].node]
            found.append(T[:3, :3] @ s.point[s.best] + T[:3, 3])
        return found

    def _with_others(self, k: int) -> Array:
        """Columns (p, rows, 4 c) of one set's particles and of the others' likeliest."""
        columns = self._columns(self.sets[k])
        others = [self._columns(s, s.best)[0] for i, s in enumerate(self.sets) if i != k]
        fixed = np.hstack([np.empty((columns.shape[1], 0)), *others])
        return np.concatenate([columns, np.broadcast_to(fixed, (len(columns), *fixed.shape))], 2)

    def _count_sets(self, y: Array) -> None:
        """Begins a set where the residual is unexplained by those there are, once they are old."""
        if len(self.sets) == self._most or any(s.age < PATIENCE for s in self.sets):
            return
        misfit = float(y @ y)
        if self.sets:
            together = np.hstack([self._columns(s, s.best)[0] for s in self.sets])
            misfit = least_misfit(together[None], y)[1][0]
        if misfit > UNEXPLAINED * len(y):
            self.sets.append(self._spread())

    def _spread(self) -> Particles:
        """Points uniform over the area of all surfaces."""
        which = self._rng.choice(len(self._patches), self._count, p=self._shares)
        points, normals = np.empty((self._count, 3)), np.empty((self._count, 3))
        for i, patch in enumerate(self._patches):
            mine = np.flatnonzero(which == i)
            surface, T = patch.surface, patch.T_node_link
            shares = surface.areas / surface.areas.sum()
            faces = self._rng.choice(len(shares), len(mine), p=shares)
            corner = self._rng.dirichlet(np.ones(3), len(mine))
            local = np.einsum("ij,ijk->ik", corner, surface.vertices[surface.faces[faces]])
            points[mine] = local @ T[:3, :3].T + T[:3, 3]
            normals[mine] = surface.normals[faces] @ T[:3, :3].T
        return Particles(which, points, normals)

    def _move(self, particles: Particles) -> None:
        """A random step in space, then to the nearest point of any surface of the same body.

        The likeliest particle stays.
        """
        widest = WIDE if self._unexplained(particles) else NARROW
        step = np.exp(self._rng.uniform(np.log(FINE), np.log(widest), (self._count, 1)))
        particles.age += 1
        moved = particles.point + step * self._rng.normal(size=particles.point.shape)
        for i in range(len(moved)):
            if i == particles.best and particles.age > 1:
                continue
            row = self._patches[particles.patch[i]].mesh.nearest_to_point(moved[i])[0]
            particles.point[i], particles.normal[i] = row[2:5], row[5:8]

    def _columns(self, particles: Particles, only: int | None = None) -> Array:
        """What unit forces along the edges of each pyramid load the rows with (p, rows, 4)."""
        part = slice(None) if only is None else slice(only, only + 1)
        patches = particles.patch[part]
        nodes = np.array([patch.node for patch in self._patches])[patches]
        R, p = self._poses[nodes][:, :3, :3], self._poses[nodes][:, :3, 3]
        point = np.einsum("nij,nj->ni", R, particles.point[part]) + p
        normal = np.einsum("nij,nj->ni", R, particles.normal[part])
        frames = rotation_to_axis(normal)
        s, t = frames[..., 0], frames[..., 1]
        edges = np.stack([-s, -t, s, t], axis=1) * self._friction - normal[:, None]
        edges /= np.linalg.norm(edges, axis=2)[..., None]
        wrenches = np.concatenate([edges, np.cross(point[:, None], edges)], axis=2)
        loads = self._loads[patches] / self._scale[:, None]
        return loads @ np.swapaxes(wrenches, 1, 2)

    def _resample(self, particles: Particles, cost: Array) -> None:
        """Draws particles by their likelihood, tempered so that many of them remain.

        While a residual is unexplained, some begin anew anywhere.
        """
        particles.cost = float(cost.min())
        weights = tempered_weights(cost, REMAINING * len(cost))
        chosen = self._rng.choice(len(cost), len(cost), p=weights)
        chosen[0] = int(np.argmin(cost))
        particles.best = 0
        for name in ("patch", "point", "normal"):
            setattr(particles, name, getattr(particles, name)[chosen])
        if self._unexplained(particles):
            fresh, new = self._spread(), slice(len(cost) - int(FRESH * len(cost)), None)
            for name in ("patch", "point", "normal"):
                getattr(particles, name)[new] = getattr(fresh, name)[new]

    def _unexplained(self, particles: Particles) -> bool:
        return particles.cost > UNEXPLAINED * len(self._rows)

    def _load_matrix(self, q: Array, link: str) -> Array:
        """What a wrench on a link, in world, loads the rows with (rows, 6)."""
        felt = contact_loads(self.robot, q, link, np.eye(6))
        return np.hstack([felt.torque, felt.wrench.reshape(6, -1)]).T[self._rows]


def least_misfit(columns: Array, y: Array) -> tuple[Array, Array]:
    """The x >= 0 (p, m) of least |y - C x|^2 for each matrix C (p, rows, m), and what it is (p,).

    By principal pivoting (Portugal, Judice and Vicente 1994), all matrices at once: all signs that
    are wrong are exchanged, and one at a time after a few rounds.
    """
    gram = np.swapaxes(columns, 1, 2) @ columns
    target = np.swapaxes(columns, 1, 2) @ y
    m = gram.shape[1]
    size = np.einsum("nii->n", gram)[:, None] / m
    gram = gram + 1e-8 * size[..., None] * np.eye(m)  # four edges span three directions
    free = np.ones(target.shape, bool)
    x = np.zeros(target.shape)
    for turn in range(PIVOTS):
        both = free[:, :, None] & free[:, None, :]
        square = np.where(both, gram, size[..., None] * np.eye(m))
        x = np.linalg.solve(square, np.where(free, target, 0.0)[..., None])[..., 0]
        slope = (gram @ x[..., None])[..., 0] - target
        wrong = np.where(free, x < 0.0, slope < -1e-9 * np.abs(target).max())
        if not wrong.any():
            break
        if turn >= PIVOTS // 2:
            last = m - 1 - np.argmax(wrong[:, ::-1], axis=1)
            wrong &= np.arange(m) == last[:, None]
        free ^= wrong
    x = np.maximum(x, 0.0)
    rest = y - (columns @ x[..., None])[..., 0]
    return x, (rest * rest).sum(axis=1)


def tempered_weights(cost: Array, least: float) -> Array:
    """Weights exp(-cost / 2 T), T the smallest from 1 that leaves `least` effective particles."""
    low, high = 0.0, 0.0  # logarithms of T

    def weights(log_T: float) -> Array:
        w = np.exp(-0.5 * (cost - cost.min()) * np.exp(-log_T))
        return w / w.sum()

    while 1.0 / np.sum(weights(high) ** 2) < least:
        high = 2.0 * high + 1.0
    for _ in range(20 if high else 0):
        middle = 0.5 * (low + high)
        if 1.0 / np.sum(weights(middle) ** 2) < least:
            low = middle
        else:
            high = middle
    return weights(high)


def _rows_and_noise(skin: Skin, period: float) -> tuple[Index, Array]:
    """The measured rows, and the standard deviation of each after the observer's filter."""
    description = skin.robot.description
    force, moment, torque = LEAST_NOISE
    own = [joint.measured for joint in description.joints]
    sigma = [max(s, torque) for s in description.noise.tau]
    bandwidth = list(description.bandwidth_joints)
    for sensor in description.sensors:
        axes = description.noise.sensors[sensor.name]
        floor = [force] * 3 + [moment] * 3
        sigma += [max(s, least) for s, least in zip(axes, floor, strict=True)]
        bandwidth += [description.bandwidth_sensors[sensor.name]] * 6
    rows = np.flatnonzero([*own, *[True] * (len(sigma) - len(own))])
    kept = np.array(sigma)[rows]
    return rows, kept * np.sqrt(np.minimum(1.0, np.array(bandwidth)[rows] * period / 2))
