# SPDX-License-Identifier: Apache-2.0
"""Errors put into simulated arms: how closely `calibrate` finds them after its planned motion.

Inertias are 1.5 % off the model, noise is typical, and a body that the model lacks is at the end of
the arm. Beside it one thing more is wrong: a sensor's frame, a bias, friction, a delay or gains of
currents. What is judged is the description that `touchline calibrate` writes.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.signal import butter, sosfiltfilt
from tqdm import tqdm

from touchline.arrays import Array
from touchline.bench.identify.bound import Bound, least_errors
from touchline.bench.identify.pushes import Detected, judged
from touchline.bench.tables import Row, aligned
from touchline.calibrate.plan import Plan, make_plan
from touchline.calibrate.run import Calibration, calibrate
from touchline.errors import InputError
from touchline.identify.gain import motor_joints
from touchline.logs import write_table
from touchline.model.description import JointDescription, SensorDescription
from touchline.model.robot import Robot, load_robot
from touchline.model.transforms import rotation_rpy
from touchline.observer.observer import Observer
from touchline.trials.arms import load_arm
from touchline.trials.free_motion import planned, random_trajectory
from touchline.trials.wrong_arm import KINDS, WrongArm, make_wrong_arm, record

NOISE = 1  # tier of the localization benchmark: 0.05 N, 0.01 Nm, 0.05 Nm
RATE = 200.0  # Hz
OTHERS, SECONDS = 3, 30.0  # recordings of other motion that judge the wrench, and their length [s]
FORCE = 10.0  # N, of pushes that are computed into one recording of other motion
CUT = 2.0  # Hz; what is slower than that is the model's part of an error
GOALS = {  # unit and what is required
    "force": ("N", 0.3),
    "moment": ("Nm", 0.05),
    "mass": ("g", 10.0),
    "centre": ("mm", 2.0),
    "turn": ("deg", 0.1),
    "shift": ("mm", 0.5),
    "bias": ("N", 0.1),
    "friction": ("%", 5.0),
    "stribeck": ("%", 10.0),
    "claimed": ("joints", 0.0),
    "gain": ("%", 5.0),
    "delay": ("ms", 0.2),
}


@dataclass(frozen=True)
class Figure:
    """How far off something is, in the unit of `GOALS`.

    Attributes:
        error: of what `calibrate` wrote.
        told: does it claim to know that?
        of: the sensor that was off, or "torques"; empty where it is no reading's.
    """

    error: float
    told: bool = True
    of: str = ""


@dataclass(frozen=True)
class Judgement:
    """Of an arm: errors of what `calibrate` wrote, and what is felt without it and with it."""

    figures: dict[str, Figure]
    felt: dict[str, Detected]


def judge(case: WrongArm, plan: Plan, rng: np.random.Generator, folder: Path) -> Judgement:
    """Calibrates an arm, and judges what was written."""
    log, out = folder / "log.parquet", folder / "robot.yaml"
    samples = record(case, planned(plan), float(plan.time[-1]), RATE, rng)
    write_table(log, samples, case.robot.description)
    off_gains = bool((case.gains != 1.0).any())
    result = calibrate([log], case.robot.description.path or "", out, gains=off_gains)
    found = load_robot(out)
    errors = _wrench_errors(case, found, rng)
    true, own = (robot.nodes[case.payload].inertia for robot in (case.real, found))
    told: dict[str, bool] = {}
    of: dict[str, str] = {}
    T = _to_link(case.real, case.payload), _to_link(found, case.payload)
    errors["mass"] = 1e3 * abs(own.mass - true.mass)
    centres = [(M @ np.append(b.com, 1.0))[:3] for M, b in zip(T, (true, own), strict=True)]
    errors["centre"] = 1e3 * float(np.linalg.norm(centres[1] - centres[0]))
    if case.turned >= 0:
        a, b = (r.description.sensors[case.turned] for r in (case.real, found))
        R = rotation_rpy(a.rpy).T @ rotation_rpy(b.rpy)
        off = {frame.name: frame for frame in result.frames}.get(a.name)
        turned = off is not None and off.turn_error.any()
        shifted = off is not None and off.shift_error.any()
        told |= {"turn": bool(turned), "shift": bool(shifted)}
        of |= {"turn": a.name, "shift": a.name}
        errors["turn"] = float(np.degrees(np.arccos(np.clip((np.trace(R) - 1.0) / 2.0, -1.0, 1.0))))
        errors["shift"] = 1e3 * float(np.linalg.norm(np.array(b.xyz) - a.xyz))
    if case.bias.any():
        found_bias = np.concatenate([s.bias for s in found.description.sensors])
        errors["bias"] = _bias_error(case, found_bias, result)
    falling = [j for j, law in case.friction.items() if law.stribeck]
    claimed = [j for j, joint in enumerate(found.description.joints) if joint.friction.stribeck]
    errors["claimed"] = float(len(set(claimed) - set(falling)))
    for j, law in ({} if off_gains else case.friction).items():
        friction = found.description.joints[j].friction
        if law.stribeck:
            told["stribeck"] = friction.stribeck > 0.0
            errors["stribeck"] = 100.0 * abs(friction.stribeck / law.stribeck - 1.0)
        else:
            errors["friction"] = 100.0 * abs(friction.coulomb / law.coulomb - 1.0)
    if off_gains:
        written = {gain.name for gain in result.gains or () if gain.plausible}
        pairs = zip(found.description.joints, case.real.description.joints, strict=True)
        told["gain"] = bool(written)
        errors["gain"] = max(
            100.0 * abs(own.gain / true.gain - 1.0)
            for own, true in pairs
            if own.name in written or not written
        )
    for name, late in case.late.items():
        delay = _delay(found.description.joints, found.description.sensors, name)
        errors["delay"] = 1e3 * abs(delay - late)
        told["delay"], of["delay"] = delay != 0.0, name
    figures = {
        name: Figure(error, told.get(name, True), of.get(name, ""))
        for name, error in errors.items()
    }
    other = record(case, random_trajectory(case.robot, rng), SECONDS, RATE, rng)
    kinds = {"before": case.robot, "after": found}
    felt = {name: judged(case.real, kind, other, FORCE, 1) for name, kind in kinds.items()}
    return Judgement(figures, felt)


def _bias_error(case: WrongArm, bias: Array, result: Calibration) -> float:
    """The largest error of a bias [N], of those that no mass could be."""
    assert result.identification is not None
    n = len(case.robot.joint_names)
    known = case.bias != 0.0
    known[[row - n for row in result.identification.ambiguous if row >= n]] = False
    return float(np.abs(bias - case.bias)[known].max(initial=0.0))


def _delay(
    joints: Sequence[JointDescription], sensors: Sequence[SensorDescription], name: str
) -> float:
    if name == "torques":
        return float(np.median([joint.delay for joint in joints if joint.measured]))
    return next(sensor.delay for sensor in sensors if sensor.name == name)


def _to_link(robot: Robot, node: int) -> Array:
    """From a node's frame to that of its first link: where a sensor is moves the first alone."""
    T_node_link = robot.places[robot.nodes[node].links[0]].T_node_link
    return np.asarray(np.linalg.inv(T_node_link), dtype=np.float64)


def _wrench_errors(case: WrongArm, found: Robot, rng: np.random.Generator) -> dict[str, float]:
    """RMS of the structure's wrench while nothing touches, slower than `CUT`; without noise."""
    quiet = replace(case, robot=_noiseless(case.robot), late={})
    names = found.segment_names
    structure = 0 if names[0] != "root" or len(names) == 1 else 1
    description = replace(
        found.description,
        joints=tuple(replace(j, delay=0.0) for j in found.description.joints),
    )
    observer_robot = Robot(description, found.mechanism)
    force, moment, count = 0.0, 0.0, 0
    sos = butter(2, CUT, fs=RATE, output="sos")
    for _ in range(OTHERS):
        s = record(quiet, random_trajectory(case.robot, rng), SECONDS, RATE, rng)
        estimate = Observer(observer_robot).run(s.time, s.q, s.qd, s.tau, s.wrench)
        inside = s.time > 1.0
        if not found.sensor_names:
            continue
        wrench = estimate.segment_wrench[inside, structure]
        slow = sosfiltfilt(sos, wrench, axis=0)
        force += float((slow[:, :3] ** 2).sum())
        moment += float((slow[:, 3:] ** 2).sum())
        count += len(slow)
    if not count:
        return {}
    return {"force": float(np.sqrt(force / count)), "moment": float(np.sqrt(moment / count))}


def _noiseless(robot: Robot) -> Robot:
    noise = robot.description.noise
    nothing = (0.0,) * len(noise.tau)
    sensors = {name: (0.0,) * 6 for name in noise.sensors}
    silent = replace(noise, q=nothing, qd=nothing, tau=nothing, sensors=sensors)
    return Robot(replace(robot.description, noise=silent), robot.mechanism)


def main(arms: Sequence[str], kinds: Sequence[str], runs: int, seed: int) -> int:
    """Prints by arm how far off what was found is; 1 where a figure is missed."""
    head = "arm", "figure", "goal", "cases", "told", "median", "worst", "within", "RMS", "bound"
    lines: list[Row] = [head]
    pushes: list[Row] = [("arm", "", "pushes found", "false events", "in contact untouched")]
    refused: list[str] = []
    missed = False
    progress = tqdm(total=len(arms) * len(kinds) * runs, file=sys.stderr, leave=False, disable=None)
    for arm in arms:
        robot = load_arm(arm, NOISE)
        plan = make_plan(robot)
        bound = least_errors(robot, plan, RATE)
        figures: dict[str, list[Figure]] = {name: [] for name in GOALS}
        felt: dict[str, list[Detected]] = {"before": [], "after": []}
        for i, kind in enumerate(KINDS):
            if kind not in kinds or (kind == "gain" and not motor_joints(robot)):
                continue
            for run in range(runs):
                rng = np.random.default_rng((seed, i, run))
                with TemporaryDirectory() as folder:
                    case = make_wrong_arm(robot, kind, rng)
                    try:
                        judgement = judge(case, plan, rng, Path(folder))
                    except InputError as error:
                        refused.append(f"{arm}, {kind}: {error.problems[0].partition(': ')[2]}")
                        progress.update()
                        continue
                for name, figure in judgement.figures.items():
                    figures[name].append(figure)
                for name, one in judgement.felt.items():
                    felt[name].append(one)
                progress.update()
        for name, found in figures.items():
            if found:
                lines.append((arm, name, *_row(name, found, bound)))
                missed |= any(figure.error > GOALS[name][1] for figure in found)
        for name, of in felt.items():
            pushes.append((arm, name, *_felt_row(of)))
        missed |= _found(felt["after"]) < _found(felt["before"])
    progress.close()
    print(f"What calibrate finds after its planned motion, {runs} arms of each kind:")
    print(aligned(lines, (0, 1)))
    print("claimed: joints whose friction is said to fall with speed, but does not.")
    print("gain: of the joints whose gain is told, the worst; of all where none is.")
    print("bound: RMS that no estimator can fall below, were it told how far links are off.")
    print("told: calibrate claims to know it. Biases that it calls mass or bias are left out.")
    for line in refused:
        print(f"refused, so nothing was written: {line}")
    print(f"\nPushes of {FORCE:g} N, computed into other motion of these arms:")
    print(aligned(pushes, (0, 1)))
    return int(missed or len(refused) > 0)


def _row(name: str, found: Sequence[Figure], bound: Bound) -> tuple[str, ...]:
    unit, goal = GOALS[name]
    values = np.array([figure.error for figure in found])
    within, told = int((values <= goal).sum()), sum(figure.told for figure in found)
    middle, worst = f"{np.median(values):.2g}", f"{values.max():.2g}"
    least = _rms(np.array([bound.of(name, figure.of) for figure in found]))
    counts = f"{goal:g} {unit}", str(len(values)), str(told)
    told_least = "-" if np.isnan(least) else f"{least:.2g}"
    return *counts, middle, worst, str(within), f"{_rms(values):.2g}", told_least


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _found(felt: Sequence[Detected]) -> int:
    return sum(one.found for one in felt)


def _felt_row(felt: Sequence[Detected]) -> tuple[str, ...]:
    pushes, false = sum(one.pushes for one in felt), sum(one.false for one in felt)
    share = float(np.mean([one.share for one in felt]))
    return f"{_found(felt)} of {pushes}", str(false), f"{100 * share:.1f} %"
