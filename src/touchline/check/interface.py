# SPDX-License-Identifier: Apache-2.0
"""Widgets that cannot work: off the surface, in each other's way, unfelt, or too small."""

from functools import partial
from itertools import combinations
from math import erf, sqrt

import numpy as np

from touchline.arrays import Array
from touchline.check.felt import NOISE_SIGMAS, POINT_RANK, POSTURES, SHARE, screw_of
from touchline.check.findings import Findings
from touchline.detector.residual_noise import residual_noise
from touchline.detector.thresholds import make_thresholds
from touchline.errors import InputError
from touchline.localizer.localizer import TORQUE_ERROR, Localizer
from touchline.localizer.skin import Patch, Skin
from touchline.model.robot import Robot
from touchline.observer.observer import Observer
from touchline.touch.touch import SURE, make_widget
from touchline.touch.widget import DEPTH, Widget

SETTLED = 200  # samples after which an observer has settled
SAMPLES = 6000  # points of a link's surface that are looked at: one in 0.2 cm2 of a forearm
OFF = 0.005  # m that a widget may lie beside the surface, as meshes are no better
RAYLEIGH = 2.448 / sqrt(2.0)  # of `position_std`: 95 % of the estimates are nearer to the truth
NOWHERE = 0.1  # m; a place less sure than that is none
FINEST = 0.001  # m; smallest sizes are told in so large steps


def check_interface(robot: Robot, findings: Findings, period: float = 1e-3) -> None:
    """Adds a table of the widgets, and a finding for each that cannot work as described."""
    given = robot.description.interface
    if not given:
        return
    skin = Skin(robot)
    patches = {patch.link: patch for patch in skin.patches}
    limits = _Limits(robot, skin, period)
    lines = [f"  {'widget':16} {'kind':7} {'link':20} {'place [mm]':>10} {'smallest [mm]':>13}"]
    widgets: list[tuple[Widget, Patch]] = []
    for name in given:
        try:
            widget = make_widget(name, given[name], patches)
        except InputError as error:
            for problem in error.problems:
                findings.find(problem)
            continue
        if widget.given.taught:
            lines.append(f"  {name:16} {widget.kind:7} taught by torques, in its postures alone")
            continue
        patch = patches.get(widget.link or "")
        if patch is None:
            findings.find(f"interface.{name}.link: '{widget.link}' has no surface to touch")
            continue
        place, smallest = _felt(widget, patch, limits, findings)
        lines.append(f"  {name:16} {widget.kind:7} {patch.link:20} {place:>10} {smallest:>13}")
        if patch.segment is not None:
            _on_surface(widget, patch, findings)
            widgets.append((widget, patch))
    findings.note("widgets", *lines)
    for (one, patch), (other, _) in combinations(widgets, 2):
        if one.link == other.link and _overlap(one, other, patch):
            findings.find(
                f"interface.{one.name} and interface.{other.name} overlap on {one.link}: "
                "a touch of both means neither; move one or make it smaller"
            )


class _Limits:
    """What each row of the detector needs and how noisy it is, in random postures."""

    def __init__(self, robot: Robot, skin: Skin, period: float) -> None:
        self.robot, self._skin, self._period = robot, skin, period
        self.rows = make_thresholds(robot, period).rows
        torque, wrench = residual_noise(robot, period)
        self.sigma = np.array(
            [
                torque[row.joint]
                if row.component < 0
                else wrench[robot.segment_names[row.segment]][row.component]
                for row in self.rows
            ]
        )
        self.limit = np.array([row.contact for row in self.rows]) + NOISE_SIGMAS * self.sigma
        rng = np.random.default_rng(0)
        self._postures = rng.uniform(*robot.ranges, (POSTURES, len(robot.joint_names)))
        self._known: dict[str | None, list[tuple[Array, Array | None]]] = {}

    def of(self, patch: Patch) -> list[int]:
        """Rows that a push on a link loads."""
        body = self.robot.body_of(patch.link)
        moved = set(self.robot.joints_inboard_of(body))
        return [
            i
            for i, row in enumerate(self.rows)
            if self.robot.segment_names[row.segment] == body.segment
            and (row.component >= 0 or self.robot.joint_names[row.joint] in moved)
        ]

    def push(self, patch: Patch, point: Array, into: Array, force: float) -> tuple[float, float]:
        """What holds in SHARE of all postures of a push with `force` [N].

        Args:
            patch: the link's surface.
            point: (3,) [m] and `into` (3,), a unit vector, in the link's frame.
            into: see `point`.
            force: [N].

        Returns:
            The least force that is felt [N], and how sure the place is [m] (`position_std`);
            infinite where it is not felt, or has no place.
        """
        own = self.of(patch)
        joint = np.array([self.rows[i].component < 0 for i in own])
        six_axis = patch.segment in self.robot.sensor_names
        least, spread = [], []
        for poses, covariance in self._frames(patch.segment if six_axis else None):
            T = poses[patch.node] @ patch.T_node_link
            x, u = T[:3, :3] @ point + T[:3, 3], T[:3, :3] @ into
            screws = np.array([screw_of(self.robot, self.rows[i], poses) for i in own])
            loads = screws @ np.concatenate([u, np.cross(x, u)])
            with np.errstate(divide="ignore"):
                least.append(float(np.min(self.limit[own] / np.abs(loads))))
            error = TORQUE_ERROR * force * np.abs(loads[joint])
            weight = _whitened(screws[joint], np.hypot(self.sigma[own][joint], error), covariance)
            spread.append(_spread(weight, x, u, force))
        quantile = partial(np.quantile, q=SHARE, method="higher")
        return float(quantile(least)), float(quantile(spread))

    def _frames(self, segment: str | None) -> list[tuple[Array, Array | None]]:
        """Poses of all nodes in random postures, and the covariance of a segment's wrench there."""
        if segment not in self._known:
            n, k = len(self.robot.joint_names), len(self.robot.sensor_names)
            observer = Observer(self.robot)
            localizer = Localizer(observer, period=self._period, skin=self._skin)
            still = np.zeros((SETTLED, n))
            time = self._period * np.arange(SETTLED)
            rows = observer.run(time, still, still, still, np.zeros((SETTLED, k, 6))).rows
            estimate = observer.estimate(rows[-1])
            self._known[segment] = [
                (
                    self.robot.poses(q),
                    localizer.wrench_covariance(segment, q, estimate) if segment else None,
                )
                for q in self._postures
            ]
        return self._known[segment]


def _whitened(joints: Array, sigma: Array, covariance: Array | None) -> Array:
    """Rows (r, 6) that show a wrench about the world's origin with unit noise each."""
    rows: Array = joints / sigma[:, None]
    if covariance is not None:
        root = np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), float)
        rows = np.vstack([root, rows])
    return rows


def _spread(rows: Array, x: Array, u: Array, force: float) -> float:
    """Root of the trace of the covariance of a place [m]: force (3,) and two ways are unknown."""
    aside = np.linalg.svd(u[None])[2][1:]  # two directions along the surface
    by_force = rows[:, :3] + np.cross(rows[:, 3:], x)  # s_m . (x x f) = (s_m x x) . f
    by_way = rows[:, 3:] @ np.cross(aside, force * u).T
    A = np.hstack([by_force, by_way])
    scale = np.linalg.norm(A, axis=0)
    if not scale.all() or np.linalg.matrix_rank(A / scale, tol=1e-6) < POINT_RANK:
        return np.inf
    covariance = np.linalg.inv((A / scale).T @ (A / scale)) / np.outer(scale, scale)
    return float(np.sqrt(covariance[3, 3] + covariance[4, 4]))


def _felt(widget: Widget, patch: Patch, limits: _Limits, findings: Findings) -> tuple[str, str]:
    """Can it be felt, and is it large enough? How sure its place is, and the smallest size."""
    where = f"interface.{widget.name}"
    if patch.segment is None or not limits.of(patch):
        findings.find(f"{where}.link: no sensor feels '{patch.link}': put it on another link")
        return "-", "-"
    point, normal = _nearest(patch, _middle(widget, patch))
    least, spread = limits.push(patch, point, -normal, widget.force)
    if widget.force < least:
        more = (
            f"give a force of {np.ceil(10 * least) / 10:g} N or more" if np.isfinite(least) else ""
        )
        findings.find(
            f"{where}.force: {widget.force:g} N are not felt there in {100 * (1 - SHARE):.0f} % of "
            f"the postures: {more}"
        )
    if widget.whole:
        return "-", "any"
    if spread > NOWHERE:
        findings.find(
            f"{where}: these sensors tell no place on '{patch.link}', so no size works there: "
            "use the whole link, or teach it (touchline teach)"
        )
        return "none", "-"
    smallest = FINEST * np.ceil(smallest_reach(spread) / FINEST)
    if widget.reach < smallest:
        key, factor = SIZES[widget.kind]
        findings.find(
            f"{where}.{key}: too small for what can be resolved there with {widget.force:g} N "
            f"({1e3 * spread:.1f} mm): the smallest that works is {factor * smallest:.3f} m"
        )
    return f"{1e3 * spread:.1f}", f"{1e3 * smallest:.0f}"


SIZES = {
    "button": ("radius", 1.0),
    "toggle": ("radius", 1.0),
    "dial": ("radius", 1.0),
    "slider": ("width", 2.0),
    "pad": ("size", 2.0),
}


def smallest_reach(spread: float) -> float:
    """From a widget's middle to its rim at least [m], where places are so uncertain [m].

    A finger in the middle counts if it is on the widget with a probability of `SURE`; 95 % of the
    estimates have to say so.
    """
    low, high = 0.0, 3.0
    while high - low > 1e-6:  # erf has no inverse in the standard library
        middle = 0.5 * (low + high)
        low, high = (middle, high) if 0.5 * (1.0 + erf(middle)) < SURE else (low, middle)
    return (high + RAYLEIGH) * spread


def _middle(widget: Widget, patch: Patch) -> Array:
    if widget.kind == "slider":
        return widget.point_at(0.5)
    if widget.given.at is not None:
        return np.array(widget.given.at)
    surface = patch.surface
    middles = surface.vertices[surface.faces].mean(axis=1)
    return (middles * surface.areas[:, None]).sum(axis=0) / surface.areas.sum()


def _nearest(patch: Patch, point: Array) -> tuple[Array, Array]:
    """The nearest point (3,) of a link's surface and its outward normal (3,), in link axes."""
    R, p = patch.T_node_link[:3, :3], patch.T_node_link[:3, 3]
    row = np.asarray(patch.mesh.nearest_to_point(R @ point + p)[0], float)
    nearest = R.T @ (row[2:5] - p)
    middles = patch.surface.vertices[patch.surface.faces].mean(axis=1)
    return nearest, patch.surface.normals[int(np.argmin(np.linalg.norm(middles - nearest, axis=1)))]


def _on_surface(widget: Widget, patch: Patch, findings: Findings) -> None:
    if widget.whole:
        return
    key = "path" if widget.kind == "slider" else "at"
    allowed = DEPTH / 2 if widget.kind in ("pad", "dial") else max(OFF, widget.reach / 2)
    points = [_middle(widget, patch)]
    if widget.kind == "slider":
        points = [widget.point_at(value) for value in np.linspace(0.0, 1.0, 11)]
    off = [float(np.linalg.norm(point - _nearest(patch, point)[0])) for point in points]
    worst = int(np.argmax(off))
    if off[worst] > allowed:
        near = ", ".join(f"{x:.3f}" for x in _nearest(patch, points[worst])[0])
        findings.find(
            f"interface.{widget.name}.{key}: lies {1e3 * off[worst]:.0f} mm off the surface of "
            f"'{patch.link}'; allowed: {1e3 * allowed:.0f} mm; the nearest point is [{near}]"
        )


def _overlap(one: Widget, other: Widget, patch: Patch) -> bool:
    """Is there a place of the surface, or a middle, that is on both?"""
    if one.whole or other.whole:
        return True
    surface, rng = patch.surface, np.random.default_rng(0)
    picked = rng.choice(len(surface.faces), SAMPLES, p=surface.areas / surface.areas.sum())
    a, b = np.sort(rng.random((2, SAMPLES, 1)), axis=0)
    corners = surface.vertices[surface.faces[picked]]
    points = a * corners[:, 0] + (b - a) * corners[:, 1] + (1.0 - b) * corners[:, 2]
    points = [_middle(one, patch), _middle(other, patch), *points]
    return any(one.read(x).beyond < 0 and other.read(x).beyond < 0 for x in points)
