# SPDX-License-Identifier: Apache-2.0
"""Force-torque sensors beside the weight and the motion of what they carry."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import permutations, product

import numpy as np

from touchline.arrays import Array
from touchline.check.delays import axis_delays, common_delay
from touchline.check.findings import Findings, Kind
from touchline.check.fit import FORCE_FACTORS, MOMENT_FACTORS, factor_words
from touchline.check.model import outboard_mass
from touchline.check.windows import Windows
from touchline.model.description import SensorDescription
from touchline.model.robot import Robot
from touchline.observer.dynamics import Loads, contact_loads, to_world

LEAST_WEIGHT = 0.5  # N; a lighter load says nothing
MASS_OFF, MASS_OFF_KG = 0.05, 0.05
CLEARER = 0.4  # another explanation must leave so much less
# Moments that change by so many times what a unit of the forces lets expect, and by so much [Nm],
# are those of a load that is mounted farther out than the model's.
FARTHER, FARTHER_NM = 5.0, 0.1
BORNE = 0.5  # of what a sensor reads too much: more of it felt before it is a load and no unit
BORNE_LEAST = 0.5  # Nm or N, root sum of squares; less of it before the sensor tells nothing
AXIS_NAMES = "xyz"


@dataclass(frozen=True)
class Explanation:
    """How a sensor's log may relate to what the model expects.

    Attributes:
        kind: "described", "polarity", "frame", "axes" or "compensated".
        words: what would have to be changed.
        R_log_sensor: (W, 3, 3) leads from the sensor's axes to the log's, with its sign.
        forces, moments: (W, 3) expected, in the log's axes and with its sign.
        columns: (3, 3) what leads from the logged axes to the described ones, where that is all.
        change: of the sensor's keys in `robot.yaml`, that says so.
    """

    kind: str
    words: str
    R_log_sensor: Array
    forces: Array
    moments: Array
    columns: Array | None = None
    change: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Fit:
    """reading = factor * expected + offset, for forces or for moments; `cost` is what is left."""

    factor: float
    offset: Array
    cost: float
    varied: bool
    telling: bool


Limits = dict[tuple[str, int], float]


@dataclass(frozen=True)
class WrenchMend:
    """What is wrong with a sensor's columns, and what mends it.

    Attributes:
        sensor: its number.
        matrix: (6, 6) that leads from the logged columns to those that it should have.
        words: of the findings.
    """

    sensor: int
    matrix: Array
    words: tuple[str, ...]


def check_wrenches(
    robot: Robot, windows: Windows, dead: set[str], limits: Limits, findings: Findings
) -> list[WrenchMend]:
    """Polarity, axes, frame, units, weight and bias of every sensor; returns what can be mended.

    `limits` are the contact thresholds by segment and component [N, Nm].
    """
    mends: list[WrenchMend] = []
    if len(windows) < 1:
        return mends
    for k, sensor in enumerate(robot.description.sensors):
        names = {f"{sensor.name}.{axis}" for axis in sensor.axes}
        if not names & dead and np.isfinite(windows.wrench[:, k]).any():
            mends += _SensorCheck(robot, windows, k, limits, findings).run()
    return mends


class _SensorCheck:
    def __init__(
        self, robot: Robot, windows: Windows, k: int, limits: Limits, findings: Findings
    ) -> None:
        self.limits = limits
        self.robot, self.windows, self.k, self.findings = robot, windows, k, findings
        self.sensor: SensorDescription = robot.description.sensors[k]
        self.mass = outboard_mass(robot, self.sensor.name)
        axes = ("fx", "fy", "fz", "mx", "my", "mz")
        self.has = np.array([axis in self.sensor.axes for axis in axes])
        poses = [robot.poses(q) for q in windows.q]
        self.node = next(i for i, n in enumerate(robot.nodes) if n.sensor == self.sensor.name)
        self.R_world_sensor = np.array([T[self.node][:3, :3] for T in poses])
        self.poses = poses
        self.reading = windows.wrench[:, k]

    def run(self) -> list[WrenchMend]:
        """Judges the sensor; returns what a change of its columns would mend."""
        weight = self.mass * float(np.linalg.norm(self.robot.gravity))
        if weight < LEAST_WEIGHT:
            line = f"  {self.sensor.name}: carries {weight:.2g} N, too little to tell anything"
            self.findings.note("wrenches", line)
            return []
        explanations = list(self._explanations())
        costs = np.array([self._cost(e) for e in explanations])
        own = costs[0]
        order = [i for i in range(len(costs)) if costs[i] <= max(1.3 * costs.min(), 1e-12)]
        best = explanations[0] if costs.min() > CLEARER * own else explanations[order[0]]
        words = []
        if best.kind != "described":
            words.append(f"sensor {self.sensor.name}: {best.words}")
        force, force_words = self._factor("forces", best, FORCE_FACTORS)
        moment, moment_words = self._factor("moments", best, MOMENT_FACTORS)
        for line in words:
            self.findings.find(line, Kind.AXES)
        for line in (*force_words, *moment_words):
            self.findings.find(line)
        if best.change:
            self.findings.mend("force_torque_sensors", self.sensor.name, **best.change)
        self._judge(best)
        if best.kind == "described" and not words + force_words + moment_words:
            self._judge_delay()
        if best.columns is None:
            return []
        matrix = np.zeros((6, 6))
        matrix[:3, :3], matrix[3:, 3:] = best.columns / force, best.columns / moment
        if np.array_equal(matrix, np.eye(6)):
            return []
        mended = words + [
            line
            for factor, lines in ((force, force_words), (moment, moment_words))
            for line in lines
            if factor != 1.0
        ]
        return [WrenchMend(self.k, matrix, tuple(mended))]

    def _cost(self, explanation: Explanation) -> float:
        """Misfit relative to the readings, forces and moments alike, unit and bias left free."""
        force = self._fit(explanation.forces, slice(0, 3))
        moment = self._fit(explanation.moments, slice(3, 6))
        costs = [fit.cost for fit in (force, moment) if fit is not None and fit.telling]
        return float(np.mean(costs)) if costs else 1.0

    def _fit(self, expected: Array, part: slice) -> Fit | None:
        has = self.has[part]
        reading = self.reading[:, part][:, has]
        usable = np.isfinite(reading).all(axis=1) & np.isfinite(expected).all(axis=1)
        if not has.any() or not usable.any():
            return None
        turned = self.sensor.frame != "sensor" and not has.all()
        if turned:
            return None
        return fit_vectors(expected[usable][:, has], reading[usable])

    def _explanations(self) -> Iterator[Explanation]:
        """The description as it is first, then what might be wrong with it, the likeliest first."""
        described = self.sensor.compensated
        sign = 1.0 if self.sensor.polarity == "outboard" else -1.0
        R = self._to_log(self.sensor.frame)
        own = self._expected(described)
        yield Explanation("described", "", *self._turned(own, R, sign), np.eye(3))
        other = "inboard" if sign > 0 else "outboard"
        words = f"reads the opposite of what it carries: set polarity: {other}"
        yield Explanation(
            "polarity", words, *self._turned(own, R, -sign), -np.eye(3), {"polarity": other}
        )
        if described == "gravity":
            words = "the weight is still in the signal: compensated: none"
            turned = self._turned(self._expected("none"), R, sign)
            yield Explanation("compensated", words, *turned, None, {"compensated": "none"})
        for frame in ("sensor", "world", self.robot.mechanism.root, self.sensor.link):
            if frame != self.sensor.frame:
                R_other = self._to_log(frame)
                words = f"the log gives its axes in another frame: frame: {frame}"
                change = {"frame": frame}
                yield Explanation("frame", words, *self._turned(own, R_other, sign), None, change)
                words += f", polarity: {other}"
                change = {"frame": frame, "polarity": other}
                yield Explanation("frame", words, *self._turned(own, R_other, -sign), None, change)
        if self.has.all():
            for P, words in axis_mixes():
                yield Explanation("axes", words, *self._turned(own, P @ R, sign), P.T)

    def _expected(self, compensated: str) -> Array:
        w = self.windows
        return (w.expected_wrench if compensated == "none" else w.weightless_wrench)[:, self.k]

    def _turned(
        self, expected: Array, R_log_sensor: Array, sign: float
    ) -> tuple[Array, Array, Array]:
        """How the log has the sensor's axes (W, 3, 3), and forces and moments (W, 3) in them."""
        M = sign * R_log_sensor
        force, moment = (np.einsum("wij,wj->wi", M, x) for x in (expected[:, :3], expected[:, 3:]))
        return M, force, moment

    def _to_log(self, frame: str) -> Array:
        """(W, 3, 3): from the sensor's axes to those of the log."""
        if frame == "sensor":
            return np.broadcast_to(np.eye(3), self.R_world_sensor.shape)
        if frame == "world":
            return self.R_world_sensor
        place = self.robot.places[frame]
        R = [
            (np.eye(3) if place.node < 0 else T[place.node][:3, :3]) @ place.T_node_link[:3, :3]
            for T in self.poses
        ]
        return np.einsum("wji,wjk->wik", np.array(R), self.R_world_sensor)

    def _judge(self, best: Explanation) -> None:
        name = self.sensor.name
        force = self._fit(best.forces, slice(0, 3))
        moment = self._fit(best.moments, slice(3, 6))
        if force is None or not force.telling or best.kind == "compensated":
            return
        if self.sensor.compensated == "gravity":
            return
        mass = force.factor * self.mass
        sort = "" if force.varied else " (with the bias: its orientation never changed)"
        self.findings.note(
            "wrenches",
            f"  {name}: carries {self.mass:.3f} kg in the model, {mass:.3f} kg measured{sort}",
        )
        near = 0.5 < force.factor < 2.0
        if near and abs(mass - self.mass) > max(MASS_OFF * self.mass, MASS_OFF_KG):
            self.findings.find(
                f"sensor {name}: {mass:.3f} kg measured outboard of it, {self.mass:.3f} kg in the "
                "model: a load is missing or too many, or its gain is off"
            )
        if near:
            self._judge_bias(force, moment)

    def _factor(
        self, what: str, best: Explanation, factors: dict[float, str]
    ) -> tuple[float, list[str]]:
        """The factor of a known unit (1 where it is none), and what is said of it."""
        moments = best.moments
        if what == "forces":
            fit = self._fit(best.forces, slice(0, 3))
        else:
            fit = self._fit(moments, slice(3, 6))
        if fit is None or not fit.telling or 0.5 < fit.factor < 2.0:
            return 1.0, []
        found = factor_words(fit.factor, factors)
        start = f"sensor {self.sensor.name}: {what} are {fit.factor:.3g} times those expected"
        if what == "forces" and fit.factor > 1.0 and self._carries_more(best, fit):
            return 1.0, [f"{start}, as by a load that the model lacks"]
        if found is not None:
            return found[0] * float(np.sign(fit.factor)), [f"{start}: in {found[1]}"]
        if abs(fit.factor) < 0.2:
            return 1.0, [f"{start}: the weight seems taken out already; compensated: gravity"]
        return 1.0, [f"{start}: check the unit, and what is mounted on it"]

    def _carries_more(self, best: Explanation, force: Fit) -> bool:
        """Is what a sensor reads too much a load that the model lacks, rather than a unit?

        What is before the sensor, joints and further sensors, feels a load, too. Without these
        its moments tell it where they change by far more than those expected do in another unit.
        """
        borne = self._borne_before(best, force)
        if borne is not None:
            return borne > BORNE
        has = self.has[3:]
        read = self.reading[:, 3:][:, has]
        known = np.isfinite(read).all(axis=1) & np.isfinite(best.moments[:, has]).all(axis=1)
        if not has.any() or not known.any():
            return False
        size, expected = (
            float(np.sqrt(x[known].var(axis=0).sum())) for x in (read, best.moments[:, has])
        )
        return size > max(FARTHER_NM, FARTHER * max(1.0, abs(force.factor)) * expected)

    def _borne_before(self, best: Explanation, force: Fit) -> float | None:
        """Which part of what the sensor reads too much is felt before it; None: nothing tells it.

        A bias may be in every reading, so only what changes with the posture counts.
        """
        links = self.robot.nodes[self.node].links
        if not links or not self.has.all():
            return None
        w = self.windows
        offset = np.concatenate([force.offset, np.zeros(3)])
        over = (self.reading - offset).reshape(-1, 2, 3)
        over = np.einsum("wji,wpj->wpi", best.R_log_sensor, over).reshape(-1, 6)
        over -= w.expected_wrench[:, self.k]
        T = np.array([poses[self.node] for poses in self.poses])
        weight = to_world(over, T[:, :3, :3], T[:, :3, 3])
        loads = contact_loads(self.robot, w.q, links[0], weight)
        sense = float(np.sign(np.nansum(loads.wrench[:, self.k] * over)))
        power = borne = 0.0
        for foretold, left in self._rows_before(loads):
            use = np.isfinite(left) & np.isfinite(foretold)
            if use.any():
                x, y = sense * (foretold[use] - foretold[use].mean()), left[use] - left[use].mean()
                power += float(np.mean(x * x))
                borne += float(np.mean(x * y))
        return borne / power if power > BORNE_LEAST**2 else None

    def _rows_before(self, loads: Loads) -> Iterator[tuple[Array, Array]]:
        """Of each row that carries the sensor: what loads put on it, and what it has too much."""
        w, description = self.windows, self.robot.description
        for j, joint in enumerate(description.joints):
            if joint.measured and joint.compensated == "none":
                yield loads.torque[:, j], w.torque[:, j] - w.expected_torque[:, j]
        for k, sensor in enumerate(description.sensors):
            if k != self.k and (sensor.frame, sensor.compensated) == ("sensor", "none"):
                sign = 1.0 if sensor.polarity == "outboard" else -1.0
                left = sign * w.wrench[:, k] - w.expected_wrench[:, k]
                yield from zip(loads.wrench[:, k].T, left.T, strict=True)

    def _judge_delay(self) -> None:
        """Of a log in the sensor's own axes: these turn with the arm, and others do not."""
        if self.sensor.frame != "sensor":
            return
        w, k, name = self.windows, self.k, self.sensor.name
        sign = 1.0 if self.sensor.polarity == "outboard" else -1.0
        weightless = self.sensor.compensated != "none"
        rate = (w.weightless_rate if weightless else w.wrench_rate)[:, k]
        reading = np.where(self.has, sign * self.reading, np.nan)
        known = axis_delays(reading, self._expected(self.sensor.compensated), rate, w.period)
        late = common_delay(known)
        if late is None:
            return
        self.findings.note("wrenches", f"  {name}: delay {late.words}")
        if late.sure:
            self.findings.find(
                f"sensor {name} comes {late.words} late, beside the positions: "
                f"delay: {late.value:.4f}"
            )
            delay = round(self.sensor.delay + late.value, 5)
            self.findings.mend("force_torque_sensors", name, delay=delay)

    def _judge_bias(self, force: Fit, moment: Fit | None) -> None:
        name = self.sensor.name
        for fit, what, first, unit in ((force, "force", 0, "N"), (moment, "moment", 3, "Nm")):
            if fit is None or not fit.varied:
                continue
            words = ", ".join(f"{x:.3g}" for x in fit.offset)
            line = f"  {self.sensor.name}: {what} bias about [{words}] {unit} in the log's axes"
            self.findings.note("wrenches", line)
            limit = min(self.limits.get((name, i), np.inf) for i in range(first, first + 3))
            given = np.abs(np.array(self.sensor.bias[first : first + 3])).max()
            if np.abs(fit.offset).max() > max(limit, 1.05 * given + limit):
                self.findings.find(
                    f"sensor {self.sensor.name}: {what} bias about [{words}] {unit}, more than "
                    f"the contact threshold {limit:.2g}: set bias"
                )
                self._mend_bias(first, fit.offset)

    def _mend_bias(self, first: int, offset: Array) -> None:
        """What the description should have as bias, where the log gives sensor axes."""
        if self.sensor.frame != "sensor" or not self.has.all():
            return
        found = self.findings.fixes.get("force_torque_sensors", {}).get(self.sensor.name, {})
        bias = list(found.get("bias", self.sensor.bias))
        sign = 1.0 if self.sensor.polarity == "outboard" else -1.0
        bias[first : first + 3] = [round(float(x), 4) for x in sign * offset]
        self.findings.mend("force_torque_sensors", self.sensor.name, bias=bias)


def fit_vectors(expected: Array, reading: Array) -> Fit:
    """One factor and one offset for vectors (W, 3); windows far off (touches) are left out.

    Without enough variation of the expected vectors factor and offset are one: the offset is 0.
    """
    centred = expected - np.median(expected, axis=0)
    size = float(np.sqrt((expected**2).sum(axis=1).mean()))
    varied = float(np.sqrt((centred**2).sum(axis=1).mean())) > 0.15 * size
    use = np.ones(len(reading), dtype=bool)
    factor, offset, rest = 1.0, np.zeros(reading.shape[1]), np.zeros(len(reading))
    for _ in range(8):
        x, y = expected[use], reading[use]
        mean_x, mean_y = (x.mean(0), y.mean(0)) if varied else (0.0 * x[0], 0.0 * y[0])
        power = float(((x - mean_x) ** 2).sum())
        factor = float(((x - mean_x) * (y - mean_y)).sum()) / power if power > 0 else 0.0
        offset = mean_y - factor * mean_x
        rest = np.linalg.norm(reading - factor * expected - offset, axis=1)
        keep = rest <= 3.0 * max(float(np.median(rest)), 1e-12)
        if (keep == use).all() or keep.sum() < 4:
            break
        use = keep
    spread = reading - np.median(reading, axis=0) if varied else reading
    whole = max(float(np.median(np.linalg.norm(spread, axis=1))), 1e-12)
    cost = float(np.median(rest)) / whole
    if factor < 0:  # a sign is an explanation of its own, never a factor
        cost = max(cost, 1.0)
    return Fit(factor, offset, cost, varied, telling=size > 0.05)


def axis_mixes() -> list[tuple[Array, str]]:
    """Signed permutations (3, 3) of the axes but for the identity and its opposite, in words."""
    mixes = []
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            P = np.zeros((3, 3))
            for row, (column, sign) in enumerate(zip(order, signs, strict=True)):
                P[row, column] = sign
            if order == (0, 1, 2) and len(set(signs)) == 1:
                continue
            mixes.append((P, _mix_words(order, signs)))
    return sorted(mixes, key=lambda pair: int((pair[0] != np.eye(3)).sum()))


def _mix_words(order: tuple[int, ...], signs: tuple[int, ...]) -> str:
    parts = [
        f"{AXIS_NAMES[row]} holds {'-' if sign < 0 else ''}{AXIS_NAMES[column]}"
        for row, (column, sign) in enumerate(zip(order, signs, strict=True))
        if row != column or sign < 0
    ]
    swapped = "axes swapped" if order != (0, 1, 2) else "axes of opposite sign"
    return f"{swapped}: {', '.join(parts)}; mend the columns in log, or the pose"
