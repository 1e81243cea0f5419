# SPDX-License-Identifier: Apache-2.0
"""Joint signals beside the model: signs, units and order of velocities and torques."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from touchline.check.delays import common_delay
from touchline.check.findings import Findings, Kind
from touchline.check.fit import (
    ANGLE_FACTORS,
    MOMENT_FACTORS,
    Line,
    named_factor,
    robust_line,
    scatter_of,
)
from touchline.check.windows import Windows
from touchline.model.description import JointDescription
from touchline.model.robot import Robot

MOVED = 0.02  # rad/s or m/s; slower says nothing of a velocity's sign
OFF = 0.1  # a velocity's factor may be off by this much
TELLING = 1.0  # Nm; a smaller expected torque says nothing of a torque's sign
CHECK_GAIN = "check gain"  # in the words of a factor that has no other name
GAIN_OFF = 0.2  # friction and a payload change a torque's factor by less
TAKEN_OUT = 0.15  # below this fraction of the expected torque, gravity is not in the signal
UNEVEN = 0.2  # of its friction may a motor's joint have more in one sense, without a bias
RUBBING = 0.05  # of the largest expected torque; less friction is left to `calibrate`
SURE = 5.0  # standard errors
BOTH_WAYS = 0.1  # of the windows must move in either sense
LIGHT = 0.02  # of a reading's variation; a smaller expected torque cannot be told in it
MOSTLY = 0.5  # of a reading's variation must be what seems to drive the joint
DRIVES = 0.5  # Nm; a driver that takes off too much friction errs by less
SAME = 0.995  # correlation of an expected torque with an acceleration that it is all made of


@dataclass(frozen=True)
class TorqueFit:
    """reading = factor * expected + offset + friction, some time later, with 1 sigma errors.

    Attributes:
        factor, error: of the torque that the model expects.
        offset, offset_error: [Nm].
        scatter: 1 sigma of what is left [Nm].
        varied: was an offset fitted?
        coulomb, viscous: friction that the description does not know [Nm], [Nm s/rad], with its
            part at the speed of most windows, `rubbing` [Nm], and `rubbing_error`.
        delay, delay_error: of the reading [s]; NaN where it was not fitted.
        rotor, rotor_error: inertia that the description does not know [kg m2]; 0 if not fitted.
        rotor_torque: what it takes where the joint accelerates most [Nm].
    """

    factor: float
    error: float
    offset: float
    offset_error: float
    scatter: float
    varied: bool
    coulomb: float = 0.0
    viscous: float = 0.0
    rubbing: float = 0.0
    rubbing_error: float = np.inf
    delay: float = np.nan
    delay_error: float = np.inf
    rotor: float = 0.0
    rotor_error: float = np.inf
    rotor_torque: float = 0.0

    @property
    def certain(self) -> bool:
        """Is the factor known well enough to be judged?"""
        return not self.varied or self.error < 0.15 * max(abs(self.factor), 0.3)

    @property
    def has_rotor(self) -> bool:
        """Does the reading show an inertia beside the factor?"""
        return self.certain and self.rotor > SURE * self.rotor_error


@dataclass(frozen=True)
class VelocityProblem:
    """A velocity that is not the slope of its position.

    Attributes:
        joint: its number.
        factor: of the logged velocity to the slope; NaN where it does not follow it.
        words: of the finding.
    """

    joint: int
    factor: float
    words: str


def velocity_problems(robot: Robot, windows: Windows) -> list[VelocityProblem]:
    """Compares logged velocities with the slopes of the positions."""
    found = []
    for j, name in enumerate(robot.joint_names):
        slope, logged = windows.slope[:, j], windows.qd[:, j]
        moving = np.abs(slope) > MOVED
        if moving.sum() < 4 or not np.isfinite(logged[moving]).any():
            continue
        line = robust_line(slope[moving, None], logged[moving])
        if line is None:
            continue
        factor = float(line.coefficients[0])
        if abs(factor - 1) <= OFF:
            continue
        follows = line.scatter <= 0.5 * abs(factor) * scatter_of(slope[moving])
        words = _velocity_words(name, factor, follows)
        known = follows and factor != 0.0
        found.append(VelocityProblem(j, factor if known else np.nan, words))
    return found


def _velocity_words(name: str, factor: float, follows: bool) -> str:
    start = f"velocity of {name} is {factor:.3g} times the slope of its position"
    unit = named_factor(factor, ANGLE_FACTORS)
    if not follows:
        return f"{start}, and does not follow it: another joint's column?"
    if abs(factor + 1) <= OFF:
        return f"{start}: opposite sign; use factor -1 in log: qd (or in log: q)"
    return f"{start}{': ' + unit if unit else '; check its unit and that of time'}"


def judged_joints(robot: Robot, windows: Windows, dead: set[str]) -> list[int]:
    """Joints whose torque says something of the model."""
    return [
        j
        for j, joint in enumerate(robot.description.joints)
        if joint.measured
        and joint.compensated != "model"
        and joint.name not in dead
        and np.isfinite(windows.torque[:, j]).any()
    ]


def check_torques(
    robot: Robot,
    windows: Windows,
    dead: set[str],
    limits: dict[int, float],
    findings: Findings,
    clipped: Collection[str] = (),
) -> None:
    """Compare measured torques with those the model expects without contact.

    `limits` are the contact thresholds by joint [Nm]. What is cut off of `clipped` torques would
    look like an offset.
    """
    measured = judged_joints(robot, windows, dead)
    for j, joint in enumerate(robot.description.joints):
        if len(windows) and joint.torque == "motor" and np.isnan(windows.torque[:, j]).all():
            line = f"  {joint.name}: hardly moves, and dry friction can hold it: nothing is told"
            findings.note("joint torques", line)
    if not measured or not len(windows):
        return
    fits: dict[int, TorqueFit] = {}
    for j in measured:
        name = robot.joint_names[j]
        size = float(np.nanmax(np.abs(windows.expected_torque[:, j]), initial=0.0))
        if size < TELLING:
            line = f"  {name}: at most {size:.2g} Nm expected, too little to tell sign or unit"
            findings.note("joint torques", line)
            continue
        fit = fit_torque(windows, j)
        if fit is None:
            continue
        joint = robot.description.joints[j]
        driven = None  # the fit that knows of a rotor, where the description knows of none
        if joint.torque == "motor" and not joint.rotor_inertia and fit.factor > 0.0:
            driven = fit_torque(windows, j, rotor=True)
        if driven is not None and driven.has_rotor:
            fit = driven
        _note_fit(name, fit, findings)
        fits[j] = fit
        told = driven is not None and not driven.certain
        if name in clipped:
            fit = replace(fit, offset=0.0)
        _judge(joint, fit, size, limits.get(j, np.inf), told, findings)
    _judge_delays(robot, fits, findings)


def fit_torque(windows: Windows, j: int, rotor: bool = False) -> TorqueFit | None:
    """What leads from a joint's expected torque to its reading; `rotor`: an inertia beside it."""
    expected, reading, qd = windows.expected_torque[:, j], windows.torque[:, j], windows.qd[:, j]
    rate = windows.expected_rate[:, j]
    usable = np.isfinite(expected) & np.isfinite(reading) & np.isfinite(rate) & np.isfinite(qd)
    usable &= np.isfinite(windows.acceleration[:, j])
    if not usable.any():
        return None
    expected, reading, qd, rate = (x[usable] for x in (expected, reading, qd, rate))
    level = max(float(np.abs(np.median(expected))), TELLING)
    varied = float(np.std(expected)) > 0.1 * level
    columns = {"expected": expected, "one": np.ones(len(expected))} if varied else {"e": expected}
    if varied and min((qd > MOVED).mean(), (qd < -MOVED).mean()) > BOTH_WAYS:
        columns |= {"coulomb": np.tanh(qd / MOVED), "viscous": qd, "rate": rate}
        if rotor:
            columns["rotor"] = windows.acceleration[usable, j]
    line: Line | None = robust_line(np.column_stack(list(columns.values())), reading)
    if line is None:
        ratio = float(np.median(reading) / np.median(expected))
        return TorqueFit(ratio, np.inf, 0.0, np.inf, scatter_of(reading), False)
    values = dict(zip(columns, line.coefficients.tolist(), strict=True))
    errors = dict(zip(columns, line.errors.tolist(), strict=True))
    if not varied:
        return TorqueFit(values["e"], errors["e"], 0.0, np.inf, line.scatter, False)
    fit = TorqueFit(
        values["expected"], errors["expected"], values["one"], errors["one"], line.scatter, True
    )
    if "rate" not in columns:
        return fit
    speed = float(np.quantile(np.abs(qd), 0.7))
    factor = fit.factor if abs(fit.factor) > 1e-9 else np.nan
    inertia = values.get("rotor", 0.0)
    if rotor and abs(np.corrcoef(expected, columns["rotor"])[0, 1]) > SAME:
        return replace(fit, error=np.inf)
    return replace(
        fit,
        coulomb=values["coulomb"],
        viscous=values["viscous"],
        rubbing=values["coulomb"] + speed * values["viscous"],
        rubbing_error=float(np.hypot(errors["coulomb"], speed * errors["viscous"])),
        # The expectation is a mean over the interval before each sample, half a period early.
        delay=0.5 * windows.period - values["rate"] / factor,
        delay_error=errors["rate"] / abs(factor),
        rotor=inertia,
        rotor_error=errors.get("rotor", np.inf),
        rotor_torque=inertia * float(np.quantile(np.abs(windows.acceleration[usable, j]), 0.9)),
    )


def _note_fit(name: str, fit: TorqueFit, findings: Findings) -> None:
    if not fit.certain:
        findings.note("joint torques", f"  {name}: the load varies too little, or touches hide it")
        return
    offset = f", offset {fit.offset:+.2f} Nm" if fit.varied else " (one load only: no offset told)"
    line = f"  {name}: reads {fit.factor:.3f} of what the model expects{offset}"
    findings.note("joint torques", f"{line}, scatter {fit.scatter:.2f} Nm")


def torque_words(name: str, fit: TorqueFit) -> list[str]:
    """What is coarsely wrong with a torque: its unit, its sign, or that gravity is not in it."""
    start = f"torque of {name} is {fit.factor:.3g} times what the model expects"
    if not fit.certain:
        return []
    units = {k: v for k, v in MOMENT_FACTORS.items() if abs(k - 1) > 0.5}
    # A factor that may be zero is no unit.
    unit = named_factor(fit.factor, units) if abs(fit.factor) > SURE * fit.error else None
    if abs(fit.factor) < TAKEN_OUT and unit is None:
        line = f"{start}: gravity seems taken out already; compensated: gravity (or model)"
        if abs(fit.factor) > SURE * fit.error:
            sign = ", sign: -1" if fit.factor < 0 else ""
            line += f"; or a motor's current in amperes: gain: {1.0 / abs(fit.factor):.3g}{sign}"
        return [line]
    if unit is not None:
        sign = ", and of opposite sign: sign: -1" if fit.factor < 0 else ""
        return [f"{start}: in {unit} (or gain){sign}"]
    if fit.factor < 0:
        return [f"{start}: opposite sign; set the other sign ({name}: sign)"]
    return []


def _judge(
    joint: JointDescription,
    fit: TorqueFit,
    size: float,
    limit: float,
    or_rotor: bool,
    findings: Findings,
) -> None:
    if not fit.certain:
        return
    name = joint.name
    coarse = [] if or_rotor else torque_words(name, fit)
    for line in coarse:
        findings.find(line, Kind.TORQUE, name)
    if (
        not coarse
        and abs(fit.factor - 1) > GAIN_OFF
        and abs(fit.factor - 1) * size > max(limit, TELLING)
    ):
        rest = "and the masses outboard of it"
        if or_rotor:
            rest = "the masses outboard of it and rotor_inertia: this motion tells no more"
        findings.find(
            f"torque of {name} is {fit.factor:.3g} times what the model expects: {CHECK_GAIN}, "
            f"unit, {rest}",
            Kind.GAIN,
            name,
        )
    if fit.has_rotor and fit.rotor_torque > max(limit, TELLING):
        findings.find(
            f"torque of {name} shows an inertia of {fit.rotor:.2g} +- {fit.rotor_error:.1g} kg m2 "
            "that the description does not know: of the motor's rotor, seen through the gear? "
            "Touchline calibrate finds rotor_inertia"
        )
    biased = limit
    if joint.torque == "motor":  # friction seen in one sense looks like an offset
        both = np.isfinite(fit.rubbing_error)
        biased = max(limit, UNEVEN * fit.rubbing) if both else np.inf
    if abs(fit.offset) > biased and fit.offset_error < 0.3 * abs(fit.offset):
        findings.find(
            f"torque of {name} has an offset of {fit.offset:+.2f} Nm that the description does "
            f"not know, more than its contact threshold {limit:.2f}: set bias"
        )
        findings.mend("joints", name, bias=round(joint.bias + fit.offset, 3))
    rubs = max(SURE * fit.rubbing_error, RUBBING * size, limit)
    if not coarse and fit.rubbing > rubs and max(fit.coulomb, fit.viscous) > 0.0:
        findings.find(
            f"torque of {name} follows the sign and the size of its speed: friction of about "
            f"{max(fit.coulomb, 0.0):.2f} Nm and {max(fit.viscous, 0.0):.2f} Nm s/rad that the "
            "description does not know, as a motor's current shows it. Touchline calibrate finds "
            "friction (and torque: motor the rotor's inertia)"
        )


def _judge_delays(robot: Robot, fits: dict[int, TorqueFit], findings: Findings) -> None:
    known = [
        (fit.delay, fit.delay_error)
        for fit in fits.values()
        if fit.certain and abs(fit.factor - 1) < GAIN_OFF and np.isfinite(fit.delay)
    ]
    late = common_delay(known)
    if late is None:
        return
    findings.note("joint torques", f"  delay of the torques: {late.words}")
    if late.sure:
        findings.find(
            f"the torques come {late.words} late, beside the positions: "
            f"delay: {late.value:.4f} for each of joints"
        )
        for joint in robot.description.joints:
            if joint.measured:
                findings.mend("joints", joint.name, delay=round(joint.delay + late.value, 5))


def driving(windows: Windows, j: int) -> float:
    """How far a joint's torque works with its motion instead of against it [Nm]; 0 if not surely.

    Friction works against the motion. What works with it, and is most of a motor's torque, has the
    wrong sign: a light joint, whose load says nothing of the sign, has friction all the same.
    """
    qd, reading = windows.qd[:, j], windows.torque[:, j]
    expected, acceleration = windows.expected_torque[:, j], windows.acceleration[:, j]
    usable = np.isfinite(np.column_stack([qd, reading, expected, acceleration])).all(axis=1)
    qd, reading, expected, acceleration = (x[usable] for x in (qd, reading, expected, acceleration))
    if not len(qd) or min((qd > MOVED).mean(), (qd < -MOVED).mean()) <= BOTH_WAYS:
        return 0.0
    columns = [np.tanh(qd / MOVED), qd, acceleration, np.ones(len(qd))]
    size = float(np.std(reading))
    if float(np.std(expected)) > LIGHT * size:
        columns.append(expected)
    line = robust_line(np.column_stack(columns), reading)
    if line is None:
        return 0.0
    speed = float(np.quantile(np.abs(qd), 0.7))
    coulomb, viscous = line.coefficients[:2].tolist()
    error = float(np.hypot(line.errors[0], speed * line.errors[1]))
    with_motion = -(coulomb + speed * viscous)
    return with_motion if with_motion > max(SURE * error, MOSTLY * size, DRIVES) else 0.0
