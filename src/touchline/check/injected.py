# SPDX-License-Identifier: Apache-2.0
"""Errors put into simulated recordings: does `check` name them, and is it silent without?

Three arms move freely: `sara-full` with its sensors, a Panda and a UR10 with torques alone. Their
inertias are 1.5 % off the model. Noise is that of the description.
"""

import re
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from tqdm import tqdm

from touchline.arrays import Array
from touchline.check.findings import Findings
from touchline.check.order import SIGNALS, known_orders
from touchline.check.recording import check_recording
from touchline.logs import write_table
from touchline.model.mechanism import Inertia, Mechanism
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot, load_robot
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples

SECONDS, RATE = 20.0, 100.0  # of a recording; s, Hz
UNKNOWN = 0.015  # relative error of the arms' inertias
FELT = 2.0  # N or Nm; a scaled inertia changes some reading by more
CLEAN = 1 / 4  # as many clean cases as this part of the others
NAMED, SILENT = 0.95, 0.98  # that are required

PANDA = """\
name: panda
model: package://example-robot-data/robots/panda_description/urdf/panda.urdf
noise: {tau: 0.05}
locked: {panda_finger_joint1: 0.0}
"""
UR10 = """\
name: ur10
model: package://example-robot-data/robots/ur_description/urdf/ur10_robot.urdf
noise: {tau: 0.05}
"""


@dataclass
class Case:
    """A recording in the making.

    Attributes:
        robot: as described to `check`.
        rng: draws the error's place and size.
        mechanism: of the arm that truly moves.
        samples: what is logged, once it has moved.
        told: by error, what a finding that names it must match.
        unmounted: mass [kg] at the last link that is described and not there.
    """

    robot: Robot
    rng: np.random.Generator
    mechanism: Mechanism
    samples: Samples
    told: dict[str, str] = field(default_factory=dict)
    unmounted: float = 0.0

    def joint(self) -> int:
        """A joint that carries enough to be judged: one of those that bear gravity's load."""
        size = np.nanmax(np.abs(self.samples.tau), axis=0)
        return int(self.rng.choice(np.flatnonzero(size > 0.2 * size.max())))

    def sensor(self) -> int:
        """A force-torque sensor with all six axes."""
        sensors = self.robot.description.sensors
        return int(self.rng.choice([k for k, s in enumerate(sensors) if len(s.axes) == 6]))

    def name(self, j: int) -> str:
        """A joint's name, as a pattern."""
        return re.escape(self.robot.joint_names[j])

    def sensor_name(self, k: int) -> str:
        """A sensor's name, as a pattern."""
        return re.escape(self.robot.sensor_names[k])

    def sign(self) -> float:
        """Plus or minus one."""
        return float(self.rng.choice([-1.0, 1.0]))


Change = Callable[[Case], str]
"""Puts an error into a case and returns the pattern of a finding that names it."""


@dataclass(frozen=True)
class Error:
    """A kind of error.

    Attributes:
        name: for the table.
        change: of the recording, or of the mechanism before it moves.
        before: is it the mechanism that is changed?
        sensors: does it need force-torque sensors?
        group: words; two errors that share one are not put into one recording.
        blinding: do the torques then tell nothing of weights? Beside another error the arm is one
            with force-torque sensors.
    """

    name: str
    change: Change
    group: str
    before: bool = False
    sensors: bool = False
    blinding: bool = False


def _tilted(case: Case) -> str:
    angle, way = np.radians(case.rng.uniform(4, 20)), case.rng.uniform(0, 2 * np.pi)
    gravity = 9.81 * np.array(
        [np.sin(angle) * np.cos(way), np.sin(angle) * np.sin(way), -np.cos(angle)]
    )
    case.mechanism = replace(case.mechanism, gravity=gravity)
    return r"base is tilted"


def _last_link(case: Case) -> str:
    """The link at the end of the arm that the most joints move, where hands are mounted."""
    above = {joint.child: joint for joint in case.mechanism.joints.values()}
    moved = dict.fromkeys(case.mechanism.links, 0)
    for name in moved:
        at = name
        while at in above:
            moved[name] += above[at].kind != "fixed"
            at = above[at].parent
    parents = {joint.parent for joint in above.values()}
    ends = [name for name in moved if name not in parents]
    return max(ends, key=lambda name: moved[name])


def _with_mass(case: Case, name: str, mass: float, com: Array) -> None:
    """Adds a ball of 5 cm radius to a link; a negative mass takes it away."""
    link = case.mechanism.links[name]
    old = link.inertia
    total = old.mass + mass
    middle = (old.mass * old.com + mass * com) / total
    inertia = old.inertia + 0.4 * mass * 0.05**2 * np.eye(3)
    for weight, at in ((old.mass, old.com), (mass, com)):
        d = at - middle
        inertia = inertia + weight * (d @ d * np.eye(3) - np.outer(d, d))
    links = {**case.mechanism.links, name: replace(link, inertia=Inertia(total, middle, inertia))}
    case.mechanism = replace(case.mechanism, links=links)


def _hand_missing(case: Case) -> str:
    mass = case.rng.uniform(0.5, 2.0)
    _with_mass(case, _last_link(case), mass, np.array([0.0, 0.0, 0.08]))
    return r"kg are missing"


def _hand_too_many(case: Case) -> str:
    case.unmounted = float(case.rng.uniform(0.5, 2.0))
    return r"kg too many"


def _scaled(case: Case) -> str:
    heavy = sorted(case.mechanism.links.values(), key=lambda link: -link.inertia.mass)[1:5]
    factor = float(case.rng.choice([0.5, 0.7, 1.5, 2.0]))
    still, q = np.zeros_like(case.samples.qd), case.samples.q
    before = _loads(Robot(case.robot.description, case.mechanism), case.samples.time, q, still)
    while True:
        link = heavy.pop(int(case.rng.integers(len(heavy))))
        body = Inertia(factor * link.inertia.mass, link.inertia.com, factor * link.inertia.inertia)
        links = {**case.mechanism.links, link.name: replace(link, inertia=body)}
        changed = replace(case.mechanism, links=links)
        after = _loads(Robot(case.robot.description, changed), case.samples.time, q, still)
        # Of a link that turns about the vertical nothing shows its mass.
        if max(np.abs(a - b).max(initial=0.0) for a, b in zip(after, before, strict=True)) > FELT:
            break
    case.mechanism = changed
    return rf"kg .*{re.escape(link.name)}|inertia|masses outboard"


def _polarity(case: Case) -> str:
    k = case.sensor()
    case.samples.wrench[:, k] *= -1
    return rf"sensor {case.sensor_name(k)}.*polarity"


def _axis_order(case: Case) -> str:
    k = case.sensor()
    a, b = case.rng.choice(3, 2, replace=False)
    for first in (0, 3):
        pair = [first + a, first + b]
        case.samples.wrench[:, k, pair] = case.samples.wrench[:, k, pair[::-1]]
    return rf"sensor {case.sensor_name(k)}.*(swapped|holds)"


def _turned(case: Case) -> str:
    k, axis, quarters = case.sensor(), int(case.rng.integers(3)), int(case.rng.integers(1, 4))
    a, b = [i for i in range(3) if i != axis]
    R = np.eye(3)
    c, s = round(np.cos(quarters * np.pi / 2)), round(np.sin(quarters * np.pi / 2))
    R[[a, a, b, b], [a, b, a, b]] = c, -s, s, c
    for part in (slice(0, 3), slice(3, 6)):
        case.samples.wrench[:, k, part] = case.samples.wrench[:, k, part] @ R.T
    return rf"sensor {case.sensor_name(k)}.*(holds|turned|opposite)"


def _force_unit(case: Case) -> str:
    k = case.sensor()
    factor, word = ((1 / 9.80665, "kgf"), (1e3, "mN"), (1e-3, "kN"))[int(case.rng.integers(3))]
    case.samples.wrench[:, k, :3] *= factor
    return rf"sensor {case.sensor_name(k)}.*forces.*{word}"


def _torque_unit(case: Case) -> str:
    factor, word = ((1e3, "mNm"), (100.0, "Ncm"), (1 / 9.80665, "kgf m"))[int(case.rng.integers(3))]
    case.samples.tau[:] *= factor
    return rf"torque of .*{word}"


def _degrees(case: Case) -> str:
    case.samples.q[:] = np.degrees(case.samples.q)
    return r"positions look like degrees"


def _speed_degrees(case: Case) -> str:
    case.samples.qd[:] = np.degrees(case.samples.qd)
    return r"velocity of .*degrees"


def _time_unit(case: Case) -> str:
    # Nanoseconds are read as such.
    factor, word = ((1e3, "milliseconds"), (1e6, "microseconds"))[int(case.rng.integers(2))]
    case.samples.time[:] *= factor
    return rf"time.*{word}"


def _order(case: Case, order: list[int], signals: str) -> str:
    """Puts what belongs to joint j into the column of joint `order[j]`, of `SIGNALS`."""
    columns = np.argsort(order)
    for name in ("tau",) if signals == "torque" else ("q", "qd", "tau"):
        values = getattr(case.samples, name)
        values[:] = values[:, columns]
    what = f"{SIGNALS[signals][0]} "
    moved = [j for j, column in enumerate(order) if column != j]
    name = known_orders(case.robot.joint_names).get(tuple(order))
    forms = [] if name is None else [rf"of all joints seem to be in {re.escape(name)}"]
    if len(moved) == 2:
        a, b = map(case.name, moved)
        forms.append(rf"of ({a} and {b}|{b} and {a}) seem swapped")
    # Of joints that are light the data may tell nothing, which then is said.
    right = [
        rf"(?=.*(\b{case.name(j)} in that of {case.name(order[j])}\b|not tell.*{case.name(j)}\b))"
        for j in moved
    ]
    wrong = [
        rf"(?!.*\b{case.name(j)} in that of (?!{case.name(column)}\b))"
        for j, column in enumerate(order)
    ]
    forms.append("seem to stand in another" + "".join(right + wrong))
    return f"^{what}({'|'.join(forms)})"


def _some_order(case: Case) -> list[int]:
    """Any order in which a joint that bears a load is moved."""
    j = case.joint()
    while True:
        order = case.rng.permutation(len(case.robot.joint_names)).tolist()
        if order[j] != j:
            return order


def _some_swap(case: Case) -> list[int]:
    """A joint that bears a load is swapped with any other."""
    order = list(range(len(case.robot.joint_names)))
    j = case.joint()
    k = int(case.rng.choice([i for i in order if i != j]))
    order[j], order[k] = k, j
    return order


def _ur_order(case: Case) -> list[int]:
    """As drivers of UR arms list joints, by the alphabet: the first and the third are swapped."""
    order = list(range(len(case.robot.joint_names)))
    order[0], order[2] = 2, 0
    return order


def _reversed(case: Case) -> str:
    return _order(case, list(range(len(case.robot.joint_names)))[::-1], "torque")


def _two_swapped(case: Case) -> str:
    return _order(case, _some_swap(case), "torque")


def _torques_anyhow(case: Case) -> str:
    return _order(case, _some_order(case), "torque")


def _ur(case: Case) -> str:
    return _order(case, _ur_order(case), "all")


def _joints_swapped(case: Case) -> str:
    return _order(case, _some_swap(case), "all")


def _joints_anyhow(case: Case) -> str:
    return _order(case, _some_order(case), "all")


def _torque_sign(case: Case) -> str:
    j = case.joint()
    case.samples.tau[:, j] *= -1
    return rf"torque of {case.name(j)} .*opposite sign"


def _position_sign(case: Case) -> str:
    j = case.joint()
    case.samples.q[:, j] *= -1
    case.samples.qd[:, j] *= -1
    return rf"position.* of {case.name(j)} .*opposite sign"


def _speed_sign(case: Case) -> str:
    j = case.joint()
    case.samples.qd[:, j] *= -1
    return rf"velocity of {case.name(j)} .*opposite sign"


def _not_the_derivative(case: Case) -> str:
    j = case.joint()
    case.samples.qd[:, j] = np.roll(case.samples.qd[:, j], int(case.rng.integers(100, 400)))
    return rf"velocity of {case.name(j)} .*(does not follow|times the slope)"


def _without_gravity(case: Case) -> str:
    """Gravity's share, as a slow motion through the same positions would read it."""
    still = np.zeros_like(case.samples.qd)
    truth = Robot(case.robot.description, case.mechanism)
    case.samples.tau[:] -= _loads(truth, case.samples.time, case.samples.q, still)[0]
    return r"torque of .*compensated: gravity"


def _external(case: Case) -> str:
    case.samples.tau[:] = 0.1 * case.rng.normal(size=case.samples.tau.shape)
    return r"torque of .*compensated: .*model"


def _current(case: Case) -> str:
    qd = case.samples.qd
    size = np.nanmax(np.abs(case.samples.tau), axis=0)
    coulomb, viscous = 0.15 * size + 1.0, 0.1 * size + 0.5
    case.samples.tau[:] += coulomb * np.tanh(qd / 0.02) + viscous * qd
    return r"friction|motor"


def _stuck(case: Case) -> str:
    j = case.joint()
    case.samples.tau[:, j] = case.samples.tau[7, j]
    return rf"torque of {case.name(j)} is always"


def _stuck_later(case: Case) -> str:
    j, first = case.joint(), int(case.rng.uniform(0.3, 0.7) * len(case.samples))
    case.samples.tau[first:, j] = case.samples.tau[first, j]
    return rf"torque of {case.name(j)}.*stuck"


def _clipped(case: Case) -> str:
    j = case.joint()
    tau = case.samples.tau[:, j]
    low, high = np.quantile(tau, [0.15, 0.85])
    np.clip(tau, low, high, out=tau)
    return rf"torque of {case.name(j)}.*(clipped|saturated)"


def _noisy(case: Case) -> str:
    j, factor = case.joint(), case.rng.uniform(3, 10)
    size = 0.02 * np.nanmax(np.abs(case.samples.tau[:, j]))
    noise = factor * max(_torque_noise(case.robot)[j], size)
    case.samples.tau[:, j] += noise * case.rng.normal(size=len(case.samples))
    return rf"torque of {case.name(j)} .*nois"


def _noise_figure(case: Case) -> str:
    """All torques are noisier than described, by a factor of two to five."""
    factor = case.rng.uniform(2, 5)
    more = np.sqrt(factor**2 - 1) * _torque_noise(case.robot)
    case.samples.tau[:] += more * case.rng.normal(size=case.samples.tau.shape)
    return r"noise"


def _delayed(case: Case) -> str:
    late = int(case.rng.integers(2, 11))  # samples; 10 to 50 ms
    case.samples.tau[late:] = case.samples.tau[:-late].copy()
    return r"delay|late"


def _missing(case: Case) -> str:
    j = case.joint()
    share = case.rng.uniform(0.05, 0.4)
    case.samples.tau[case.rng.random(len(case.samples)) < share, j] = np.nan
    return rf"torque of {case.name(j)}: missing"


def _gap(case: Case) -> str:
    after = case.samples.time > case.rng.uniform(0.3, 0.7) * case.samples.time[-1]
    case.samples.time[after] += case.rng.uniform(2, 20)
    return r"gaps"


JOINTS = "positions speeds torques"
ERRORS = (
    Error("base tilted", _tilted, "loads", before=True),
    Error("hand missing in the model", _hand_missing, "loads", before=True),
    Error("hand modelled, not mounted", _hand_too_many, "loads", before=True),
    Error("a link's inertia scaled", _scaled, "loads", before=True),
    Error("sensor polarity", _polarity, "sensor", sensors=True),
    Error("sensor axes swapped", _axis_order, "sensor", sensors=True),
    Error("sensor turned by 90 or 180", _turned, "sensor", sensors=True),
    Error("sensor forces in another unit", _force_unit, "sensor", sensors=True),
    Error("torques in another unit", _torque_unit, "torques"),
    Error("positions in degrees", _degrees, "positions"),
    Error("velocities in degrees", _speed_degrees, "speeds"),
    Error("time in another unit", _time_unit, "time"),
    Error("torques in reversed order", _reversed, "torques"),
    Error("two torques swapped", _two_swapped, "torques"),
    Error("torques in any order", _torques_anyhow, "torques"),
    Error("joints in a UR's order", _ur, JOINTS),
    Error("two joints swapped", _joints_swapped, JOINTS),
    Error("joints in any order", _joints_anyhow, JOINTS),
    Error("a torque's sign", _torque_sign, "torques"),
    Error("a position's sign", _position_sign, "positions"),
    Error("a velocity's sign", _speed_sign, "speeds"),
    Error("velocity not the derivative", _not_the_derivative, "speeds"),
    Error("gravity compensated", _without_gravity, "torques", blinding=True),
    Error("external torques logged", _external, "torques", blinding=True),
    Error("motor currents, no friction", _current, "torques"),
    Error("a torque stuck throughout", _stuck, "torques"),
    Error("a torque stuck later", _stuck_later, "torques"),
    Error("a torque clipped", _clipped, "torques"),
    Error("a torque noisy", _noisy, "torques"),
    Error("noise figures too small", _noise_figure, "torques"),
    Error("torques delayed", _delayed, "torques"),
    Error("samples missing", _missing, "torques"),
    Error("a gap in time", _gap, "time"),
)


def _torque_noise(robot: Robot) -> Array:
    """Noise (n,) [Nm] of the description's torques; where there is none, 0.05 Nm."""
    found = np.asarray(robot.description.noise.tau)
    return np.where(found > 0, found, 0.05)


def _loads(robot: Robot, time: Array, q: Array, qd: Array) -> tuple[Array, Array]:
    """Torques (N, n) [Nm] and wrenches (N, k, 6) of a free arm.

    An observer without lag that is told nothing takes all that moves the arm for external.
    """
    observer = Observer(robot, bandwidth=1e9, method="paper", discretization="exponential")
    nothing = np.zeros_like(q), np.zeros((len(q), len(robot.sensor_names), 6))
    estimate = observer.run(time, q, qd, *nothing)
    tau, wrench = estimate.tau_ext.copy(), estimate.sensor_wrench.copy()
    for values in (tau, wrench):  # means over intervals before and after make the sample's value
        values[0] = values[1]
        values[1:-1] = 0.5 * (values[1:-1] + values[2:])
    return tau, wrench


def _motion(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Time (N,) [s], positions and velocities (N, n): sines about the middle of each range."""
    joints = [robot.mechanism.joints[name] for name in robot.joint_names]
    lower = np.array([max(joint.lower, -2.0) for joint in joints])
    upper = np.array([min(joint.upper, 2.0) for joint in joints])
    time = np.arange(round(SECONDS * RATE)) / RATE
    w, phase = rng.uniform(0.8, 1.6, len(joints)), rng.uniform(0, 2 * np.pi, len(joints))
    swing, angle = 0.25 * (upper - lower), w * time[:, None] + phase
    return time, 0.5 * (lower + upper) + swing * np.sin(angle), swing * w * np.cos(angle)


def make_case(robot: Robot, errors: tuple[Error, ...], rng: np.random.Generator) -> Case:
    """A recording with errors in it."""
    time, q, qd = _motion(robot, rng)
    nothing = Samples(time, q, qd, np.zeros_like(q), np.zeros((len(q), len(robot.sensor_names), 6)))
    case = Case(robot, rng, perturbed(robot.mechanism, UNKNOWN, rng), nothing)
    for error in errors:
        if error.before:
            case.told[error.name] = error.change(case)
    tau, wrench = _loads(Robot(robot.description, case.mechanism), time, q, qd)
    tau += _torque_noise(robot) * rng.normal(size=tau.shape)
    for k, sensor in enumerate(robot.description.sensors):
        sigma = np.asarray(robot.description.noise.sensors[sensor.name])
        wrench[:, k] += sigma * rng.normal(size=wrench[:, k].shape)
    case.samples = Samples(time.copy(), q.copy(), qd.copy(), tau, wrench)
    # What torques lack is made from the true motion, before other errors hide it.
    for error in sorted(errors, key=lambda error: not error.blinding):
        if not error.before:
            case.told[error.name] = error.change(case)
    return case


@dataclass
class Tally:
    """What was said of the cases.

    Attributes:
        cases: by error, in how many it was.
        named: by error, in how many of these it was named.
        instead: by error, what was said where it was not named.
        clean: cases without error.
        false: what was said of clean cases.
        silent: clean cases of which nothing was said.
    """

    cases: Counter[str] = field(default_factory=Counter)
    named: Counter[str] = field(default_factory=Counter)
    instead: dict[str, Counter[str]] = field(default_factory=dict)
    clean: int = 0
    silent: int = 0
    false: list[str] = field(default_factory=list)

    def add(self, case: Case, findings: list[str]) -> None:
        """Takes a case and what `check` found in it."""
        if not case.told:
            self.clean += 1
            self.silent += not findings
            self.false += findings
        for name, pattern in case.told.items():
            self.cases[name] += 1
            if any(re.search(pattern, line) for line in findings):
                self.named[name] += 1
            else:
                said = self.instead.setdefault(name, Counter())
                said.update({kind_of(line) for line in findings} or {"nothing"})

    def text(self) -> str:
        """The confusion table."""
        lines = [f"{'error':30} {'cases':>5} {'named':>5}  where it was not named, was said"]
        for name in sorted(self.cases, key=[e.name for e in ERRORS].index):
            said = self.instead.get(name, Counter()).most_common(3)
            words = ", ".join(f"{kind} ({count})" for kind, count in said)
            lines.append(f"{name:30} {self.cases[name]:5} {self.named[name]:5}  {words}".rstrip())
        total, named = self.cases.total(), self.named.total()
        lines.append(
            f"named: {named} of {total}, {100 * named / max(total, 1):.1f} % "
            f"(required: {100 * NAMED:.0f} %)"
        )
        lines.append(
            f"nothing said of clean recordings: {self.silent} of {self.clean}, "
            f"{100 * self.silent / max(self.clean, 1):.1f} % (required: {100 * SILENT:.0f} %)"
        )
        for kind, count in Counter(kind_of(line) for line in self.false).most_common(5):
            lines.append(f"  falsely: {kind} ({count})")
        return "\n".join(lines)

    @property
    def passed(self) -> bool:
        """Are both requirements met?"""
        return (
            self.named.total() >= NAMED * self.cases.total() and self.silent >= SILENT * self.clean
        )


KINDS = (  # the first that a finding matches is its kind
    ("base tilted", r"base is tilted"),
    ("mass missing", r"kg are missing"),
    ("mass too many", r"kg too many"),
    ("polarity", r"polarity"),
    ("frame", r"holds|frame: "),
    ("order", r"swapped|another joint's column|order of|reversed order|order rotated"),
    ("degrees", r"degrees"),
    ("limits", r"limits"),
    ("compensated", r"compensated"),
    ("opposite sign", r"opposite sign"),
    ("another column", r"does not follow"),
    ("unit", r"use factor|: in "),
    ("gain", r"check gain|check the unit|check its unit|measured outboard"),
    ("bias", r"set bias"),
    ("dead", r"always"),
    ("stuck", r"stuck"),
    ("clipped", r"clipped"),
    ("saturated", r"saturated"),
    ("missing", r"missing in|no value"),
    ("time", r"^time"),
)


def kind_of(line: str) -> str:
    """A finding's kind, for the table."""
    return next((kind for kind, pattern in KINDS if re.search(pattern, line)), line[:40])


def findings_of(case: Case) -> list[str]:
    """What `check` finds in a case's recording; what it says of the model alone is left out."""
    source = case.robot.description.path
    assert source is not None
    text = source.read_text()
    if case.unmounted:
        link = _last_link(case)
        text += f"loads: [{{link: {link}, mass: {case.unmounted}, com: [0, 0, 0.08]}}]\n"
    with TemporaryDirectory() as folder:
        robot, log = Path(folder) / "robot.yaml", Path(folder) / "log.parquet"
        robot.write_text(text)
        samples: Any = case.samples  # a frozen Samples is not the protocol of mutable fields
        write_table(log, samples, case.robot.description)
        findings = Findings()
        check_recording(load_robot(robot), log, findings)
        return findings.findings


def trial(cases: int, seed: int) -> Tally:
    """Checks so many recordings with errors, and a quarter as many without.

    Every error has its turn, singly; a third of the recordings hold two that can be together.
    """
    with TemporaryDirectory() as folder:
        robots = [load_robot("sara-full")]
        for name, text in (("panda", PANDA), ("ur10", UR10)):
            path = Path(folder) / f"{name}.yaml"
            path.write_text(text)
            robots.append(load_robot(path))
        rng = np.random.default_rng(seed)
        singly = [(error,) for error in ERRORS]
        pairs = [p for p in combinations(ERRORS, 2) if not _alike(*p)]
        tally = Tally()
        count = cases + round(CLEAN * cases)
        for number in tqdm(range(count), file=sys.stderr, leave=False, disable=None):
            if number >= cases:
                errors: tuple[Error, ...] = ()
            elif number % 3 == 2:
                errors = pairs[int(rng.integers(len(pairs)))]
            else:
                errors = singly[(2 * (number // 3) + number % 3) % len(singly)]
            sensors = any(error.sensors for error in errors)
            sensors |= any(error.blinding for error in errors) and len(errors) > 1
            robot = robots[0 if sensors else int(rng.integers(len(robots)))]
            case = make_case(robot, errors, rng)
            tally.add(case, findings_of(case))
    return tally


def _alike(one: Error, other: Error) -> bool:
    return bool(set(one.group.split()) & set(other.group.split()))


def main(cases: int, seed: int) -> int:
    """Prints the confusion table; 1 where a requirement is missed."""
    tally = trial(cases, seed)
    print(tally.text())
    return int(not tally.passed)
