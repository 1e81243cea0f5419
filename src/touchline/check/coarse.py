# SPDX-License-Identifier: Apache-2.0
"""What hides everything else in a recording, found and mended one after the other.

Units of time and of positions come first, then velocities, which the positions tell. Then come
units, order and signs of the torques and the sense of the positions, whichever leaves least. The
axes and units of force-torque sensors are last.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.check.findings import Findings
from touchline.check.fit import MOMENT_FACTORS, NEAR, factor_words, robust_line
from touchline.check.joints import (
    SURE,
    TAKEN_OUT,
    TELLING,
    TorqueFit,
    driving,
    fit_torque,
    judged_joints,
    torque_words,
    velocity_problems,
)
from touchline.check.loads import explain_weights
from touchline.check.mending import Mending
from touchline.check.misfit import mends, misfit, total_misfit
from touchline.check.order import joint_orders
from touchline.check.seen import Seen, windows_of
from touchline.check.windows import DRY_SPEED, Windows
from touchline.check.wrenches import check_wrenches
from touchline.model.robot import Robot
from touchline.observer.dynamics import gravity_loads

OFF = 0.35  # of a row's size: beyond it something coarse may be wrong with its sign or order
WEIGHTS_OFF = 0.05  # the same, of weights
RIGHTED = 0.2  # of what is off: no more is left once the joints are in their right order
LARGE = 5.0  # a factor beyond it, or below its inverse, is a unit, whatever else is wrong
UNIT_NEAR = 0.4  # relative, of the common factor of all torques, which loads may change
MOVED = 0.05  # rad or m; a joint that moved less tells nothing of the sense of its position
FOLLOWS = 0.3  # of its own size may be left of a reading that is a multiple of what is expected
MOST_BESIDE = 3  # changes that are tried beside wrong weights
SHARED = 0.6  # of the joints must show a common factor
SHOWN = 0.03  # of the weights; a compensation by a model that is as far off leaves less


@dataclass(frozen=True)
class Step:
    """One thing that is wrong, and the recording without it.

    Attributes:
        words: of the findings.
        mending: with that mended too.
        left: what is still off then, as `total_misfit` has it.
    """

    words: tuple[str, ...]
    mending: Mending
    left: float = 0.0


def next_step(robot: Robot, seen: Seen, mending: Mending) -> Step | None:
    """What is to be mended next; None where nothing hides the rest."""
    if not seen.stamps.credible:
        factor = seen.stamps.unit_factor
        words = (seen.stamps.incredible,)
        return None if factor is None else Step(words, replace(mending, time=mending.time * factor))
    if seen.table.looks_like_degrees(robot):
        return _degrees(robot, seen, mending)
    if not len(seen.windows):
        return None
    problems = velocity_problems(robot, seen.windows)
    if problems:
        velocity = mending.velocity.copy()
        for problem in problems:
            velocity[problem.joint] /= problem.factor
        names = [robot.joint_names[problem.joint] for problem in problems]
        words = [
            seen.table.dead_words("qd", name) or problem.words
            for name, problem in zip(names, problems, strict=True)
        ]
        return Step(tuple(words), replace(mending, velocity=velocity))
    return (
        _torques(robot, seen, mending)
        or _driven(robot, seen, mending)
        or _wrenches(robot, seen, mending)
    )


def _degrees(robot: Robot, seen: Seen, mending: Mending) -> Step:
    told = Findings()
    seen.table.report_limits(robot, told)
    factor = np.pi / 180
    turned = mending.scaled("position", _revolute(robot), factor)
    windows = windows_of(robot, seen, mending)
    moving = np.abs(windows.slope).max(axis=1, initial=0.0) > MOVED
    slope, qd = windows.slope[moving].ravel(), windows.qd[moving].ravel()
    known = np.isfinite(slope) & np.isfinite(qd)
    line = robust_line(slope[known, None], qd[known])
    # Velocities that follow from the positions have the same unit.
    if line is not None and abs(float(line.coefficients[0]) - 1.0) < 0.1:
        turned = turned.scaled("velocity", _revolute(robot), factor)
        told.find(
            "velocity of every revolute joint is in degrees per second, too: the same factor for qd"
        )
    return Step(tuple(told.findings), turned)


def _revolute(robot: Robot) -> list[int]:
    joints = robot.mechanism.joints
    return [j for j, name in enumerate(robot.joint_names) if joints[name].kind != "prismatic"]


def _torques(robot: Robot, seen: Seen, mending: Mending) -> Step | None:
    windows = seen.windows
    dead = {name for kind, name in seen.table.dead() if kind == "tau"}
    measured = judged_joints(robot, windows, dead)
    telling = telling_joints(robot, seen)
    orders = _orders(robot, seen, mending, measured, telling)
    best = min(orders.values(), key=lambda step: step.left, default=None)
    if best is not None and best is not orders.get("torque"):
        # Nothing else can be told before: no row means what it is taken for.
        if best.left < RIGHTED * total_misfit(robot, windows_of(robot, seen, mending), telling):
            return best
    units = _currents(robot, windows, telling, measured, mending)
    units = units or _units(robot, windows, telling, measured, mending)
    if units is not None:
        # What a swinging joint needs beside its weight can look like a part of all that it needs.
        left = total_misfit(robot, windows_of(robot, seen, units.mending), telling)
        light = list(_weightless(robot, windows, telling, mending))
        if not light or left <= light[0].left:
            return units
    change = _change(robot, seen, mending, orders.values(), telling)
    heard = [j for j in telling if _heard(windows, j)]
    if change is None and heard != telling:
        # Torques that nothing is in are off whatever else is mended.
        change = _change(robot, seen, mending, orders.values(), heard)
    return change


def _driven(robot: Robot, seen: Seen, mending: Mending) -> Step | None:
    """Torques that work with the motion: of opposite sign, where no load tells it.

    A driver may take off more friction than there is, so a torque that is no motor's is believed
    only where another one was found to have the wrong sign.
    """
    windows = seen.windows
    dead = {name for kind, name in seen.table.dead() if kind == "tau"}
    others = bool((mending.torque < 0.0).any())
    told, joints = [], []
    for j in judged_joints(robot, windows, dead):
        joint = robot.description.joints[j]
        known = joint.friction.coulomb or joint.friction.viscous
        if mending.torque[j] < 0.0 or known or not (others or joint.torque == "motor"):
            continue
        fit = fit_torque(windows, j)
        if j in telling_joints(robot, seen) and fit is not None and fit.certain:
            continue
        torque = driving(windows, j)
        if torque > 0.0:
            joints.append(j)
            told.append(
                f"torque of {joint.name} works with its motion ({torque:.2g} Nm) where friction "
                f"would work against it: opposite sign; set the other sign ({joint.name}: sign)"
            )
    return Step(tuple(told), mending.scaled("torque", joints, -1.0)) if joints else None


def _heard(windows: Windows, j: int) -> bool:
    """Is there anything in a torque, beside what is expected of it?"""
    reading, expected = windows.torque[:, j], windows.expected_torque[:, j]
    known = np.isfinite(reading) & np.isfinite(expected)
    read, needed = (float((x[known] ** 2).sum()) for x in (reading, expected))
    return read > TAKEN_OUT**2 * needed


def _change(
    robot: Robot, seen: Seen, mending: Mending, orders: Iterable[Step], telling: list[int]
) -> Step | None:
    """The change of order, of a sign or of a sensor's axes that explains most of what is off."""
    if not _far_off(robot, seen, telling):
        return None
    before = windows_of(robot, seen, mending)
    now = total_misfit(robot, before, telling)
    steps = [*orders, *_signs(before, robot, telling, mending)]
    wrenches = _wrenches(robot, seen, mending)
    if wrenches is not None:
        left = total_misfit(robot, windows_of(robot, seen, wrenches.mending), telling)
        steps.append(replace(wrenches, left=left))
    steps += _weightless(robot, before, telling, mending)
    steps += _positions(robot, seen, mending, telling)
    steps = sorted((step for step in steps if mends(step.left, now)), key=lambda step: step.left)
    if not steps:
        return None
    # Would a missing body, a surplus one or a tilted base leave no more than the best change?
    weights = _left_beside_weights(robot, seen, mending, telling)
    if weights > steps[0].left:
        return steps[0]
    for step in steps[:MOST_BESIDE]:
        if mends(_left_beside_weights(robot, seen, step.mending, telling), weights):
            return step
    return None


def telling_joints(robot: Robot, seen: Seen) -> list[int]:
    """Joints whose torque says something, as large as the model expects it."""
    dead = {name for kind, name in seen.table.dead() if kind == "tau"}
    size = np.nanmax(np.abs(seen.windows.expected_torque), axis=0, initial=0.0)
    return [j for j in judged_joints(robot, seen.windows, dead) if size[j] > TELLING]


def is_off(robot: Robot, seen: Seen) -> bool:
    """Is some row farther off than weights that are right would leave it?"""
    if not len(seen.windows):
        return False
    rows = misfit(robot, seen.windows, telling_joints(robot, seen))
    return max(rows, default=0.0) > WEIGHTS_OFF


def _units(
    robot: Robot, windows: Windows, telling: list[int], measured: list[int], mending: Mending
) -> Step | None:
    """A unit that all measured torques share as far as they tell, or those of single joints."""
    ratios = {}
    for j in telling:
        e, r = windows.expected_torque[:, j], windows.torque[:, j]
        known = np.isfinite(e) & np.isfinite(r)
        if known.any() and np.abs(e[known]).max() > TELLING:
            size = float(np.sqrt(np.mean(e[known] ** 2)))
            fit = fit_torque(windows, j)
            shown = float(np.sqrt(np.mean(r[known] ** 2))) / size
            ratios[j] = shown, fit is not None and fit.certain and _follows(fit, e[known], shown)
    if not ratios:
        return None
    common = float(np.exp(np.median([np.log(max(x, 1e-12)) for x, _ in ratios.values()])))
    found = factor_words(common, LARGE_FACTORS, UNIT_NEAR)
    follow = [j for j, (_, follows) in ratios.items() if follows]
    if found is not None and len(follow) >= SHARED * len(ratios) and len(ratios) > 1:
        factor, words = found
        start = f"torque of every joint is about {common:.3g} times what the model expects"
        changed = mending.scaled("torque", measured, 1.0 / factor)
        return Step((f"{start}: in {words} (or gain)",), changed)
    told, changed = [], mending
    for j in follow:
        fit = fit_torque(windows, j)
        own = None if fit is None else factor_words(abs(fit.factor), LARGE_FACTORS)
        if fit is not None and own is not None:
            told += torque_words(robot.joint_names[j], fit)
            changed = changed.scaled("torque", [j], np.sign(fit.factor) / own[0])
    return Step(tuple(told), changed) if told else None


def _follows(fit: TorqueFit, expected: Array, shown: float) -> bool:
    """Is the reading a multiple of what is expected, whatever else is in it?"""
    size = abs(fit.factor) * float(np.std(expected))
    return abs(fit.factor) > 0.5 * shown and fit.scatter < FOLLOWS * size


LARGE_FACTORS = {f: w for f, w in MOMENT_FACTORS.items() if not 1 / LARGE < f < LARGE}


def _orders(
    robot: Robot, seen: Seen, mending: Mending, measured: list[int], telling: list[int]
) -> dict[str, Step]:
    """Columns of joints in another order, by what of them; nothing where all rows fit."""
    if not _far_off(robot, seen, telling):
        return {}
    steps = {}
    own = np.arange(len(robot.joint_names))
    for signals, found in joint_orders(robot, seen.windows, measured).items():
        order = np.array(found.order)
        joints = own if signals == "torque" else order
        torques = own if signals == "motion" else order
        changed = mending.ordered(joints, torques, not found.complete)
        left = total_misfit(robot, windows_of(robot, seen, changed), telling)
        steps[signals] = Step((found.words(robot.joint_names),), changed, left)
    return steps


def _far_off(robot: Robot, seen: Seen, telling: list[int]) -> bool:
    """Is something off that an order, a sign or a sensor's axes could be the cause of?"""
    rows = misfit(robot, seen.windows, telling)
    return max(rows, default=0.0) >= OFF or bool(seen.table.outside_limits(robot))


def _signs(windows: Windows, robot: Robot, telling: list[int], mending: Mending) -> Iterator[Step]:
    """Torques of opposite sign."""
    fits = [(j, fit_torque(windows, j)) for j in telling]
    negative = {j: fit for j, fit in fits if fit is not None and fit.certain and fit.factor < 0}
    groups = [[j] for j in negative] + ([list(negative)] if len(negative) > 1 else [])
    for group in groups:
        torque = windows.torque.copy()
        torque[:, group] *= -1.0
        left = total_misfit(robot, replace(windows, torque=torque), telling)
        told = [line for j in group for line in torque_words(robot.joint_names[j], negative[j])]
        yield Step(tuple(told), mending.scaled("torque", group, -1.0), left)


def _weightless(
    robot: Robot, windows: Windows, measured: list[int], mending: Mending
) -> Iterator[Step]:
    """Torques of all joints from which their driver has taken the weights."""
    joints = robot.description.joints
    if mending.weights is not None or any(joints[j].compensated != "none" for j in measured):
        return
    if _weights_shown(robot, windows, measured):
        return
    expected = windows.expected_torque - gravity_loads(robot, windows.q).torque
    left = total_misfit(robot, replace(windows, expected_torque=expected), measured)
    words = (
        "torque of every joint fits the model without weights: gravity seems taken out already; "
        "compensated: gravity"
    )
    yield Step((words,), replace(mending, weights=robot), left)


def _weights_shown(robot: Robot, windows: Windows, measured: list[int]) -> dict[int, float]:
    """By what factor torques follow the weights, of the joints whose torque surely does.

    However small it is: a current in amperes may be a tenth of the torque. Nothing where too few
    joints do.
    """
    gravity = gravity_loads(robot, windows.q).torque
    found = {}
    for j in measured:
        moving = windows.expected_torque[:, j] - gravity[:, j]
        qd = windows.qd[:, j]
        columns = [gravity[:, j], moving, np.tanh(qd / DRY_SPEED), qd, np.ones(len(qd))]
        X, y = np.column_stack(columns), windows.torque[:, j]
        known = np.isfinite(X).all(axis=1) & np.isfinite(y)
        line = robust_line(X[known], y[known]) if known.any() else None
        if line is not None and line.coefficients[0] > max(SURE * line.errors[0], SHOWN):
            found[j] = float(line.coefficients[0])
    return found if len(found) >= max(2, SHARED * len(measured)) else {}


def _currents(
    robot: Robot, windows: Windows, telling: list[int], measured: list[int], mending: Mending
) -> Step | None:
    """Motors' torques that follow the weights by a factor that no load can make: of their gains."""
    joints = robot.description.joints
    if any(joints[j].torque != "motor" for j in measured):
        return None
    factors = _weights_shown(robot, windows, telling)
    common = float(np.median(list(factors.values()))) if factors else 1.0
    if 1.0 / LARGE < common < LARGE:
        return None
    # A unit is the same for all joints, however wrong the loads of some of them are.
    unit = factor_words(common, LARGE_FACTORS, UNIT_NEAR)
    if unit is not None:
        same = sum(abs(factor / unit[0] - 1.0) < NEAR for factor in factors.values())
        if 2 * same > len(factors):
            return None
    changed = mending.scaled("torque", measured, 1.0 / common)
    for j, factor in factors.items():
        changed = changed.scaled("torque", [j], common / factor)
    gains = ", ".join(f"{1.0 / f:.3g} ({joints[j].name})" for j, f in factors.items())
    words = (
        f"torques follow the weights, but are about {common:.2g} times what the model expects: "
        f"motors' currents in amperes? gain: about {gains}"
    )
    return Step((words,), changed)


def _positions(robot: Robot, seen: Seen, mending: Mending, measured: list[int]) -> Iterator[Step]:
    """Positions, with their velocities, of opposite sign."""
    for j in np.flatnonzero(np.ptp(seen.windows.q, axis=0) > MOVED).tolist():
        changed = mending.scaled("position", [j], -1.0).scaled("velocity", [j], -1.0)
        left = total_misfit(robot, windows_of(robot, seen, changed), measured)
        name = robot.joint_names[j]
        words = (
            f"position of {name} seems of opposite sign, and so its velocity: the readings fit the "
            "model once they are turned; use factor -1 in log: q and qd"
        )
        yield Step((words,), changed, left)


def _left_beside_weights(robot: Robot, seen: Seen, mending: Mending, measured: list[int]) -> float:
    """What is off once weights are explained; infinite where nothing explains them."""
    mended = explain_weights(robot, mending.apply(seen.first), Findings())
    if mended is robot:
        return np.inf
    return total_misfit(robot, windows_of(mended, seen, mending), measured)


def _wrenches(robot: Robot, seen: Seen, mending: Mending) -> Step | None:
    dead = {name for kind, name in seen.table.dead() if kind == "wrench"}
    found = check_wrenches(robot, seen.windows, dead, {}, Findings())
    if not found:
        return None
    wrench = mending.wrench.copy()
    for mend in found:
        wrench[mend.sensor] = mend.matrix @ wrench[mend.sensor]
    words = tuple(line for mend in found for line in mend.words)
    return Step(words, replace(mending, wrench=wrench))
