# SPDX-License-Identifier: Apache-2.0
"""A recording beside the description: one pass, then one judgement after another."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from touchline.arrays import Mask
from touchline.check.coarse import is_off, next_step
from touchline.check.findings import COARSE, Findings, Kind
from touchline.check.joints import CHECK_GAIN, check_torques, velocity_problems
from touchline.check.loads import explain_weights, possible_load
from touchline.check.mending import Mending
from touchline.check.noise import check_noise
from touchline.check.order import SIGNALS, log_keys, mend_words
from touchline.check.seen import Seen, look
from touchline.check.wrenches import check_wrenches
from touchline.detector.thresholds import make_thresholds
from touchline.logs import open_log
from touchline.logs.log import is_bag
from touchline.logs.presence import Presence
from touchline.model.robot import Robot
from touchline.model.robot_file import flow
from touchline.observer.bandwidths import bandwidth_warnings, bandwidths
from touchline.observer.samples import Samples

STILL = 0.01  # rad/s or m/s
CHUNK = 1 << 15  # samples that are read at once
MOST_STEPS = 8  # things that hide each other
MOMENT = 0.2  # s before and after what was felt: a touch begins unfelt, and filters forget it late
LEAST_UNTOUCHED = 0.2  # of the samples: a recording of touches has pauses


@threadpool_limits.wrap(limits=1, user_api="blas")  # small matrices: threads would wait
def check_recording(robot: Robot, path: Path, findings: Findings) -> None:
    """Judges a log.

    What hides the rest (units, order, signs) is found first, one thing after the other, and what
    follows is judged as if it were mended. Where weights are off and nothing coarser is wrong, what
    would explain them (a hand, a link, a tilted base) is found, and the rest is judged without it.

    Raises:
        InputError: the log cannot be read, or holds nothing that could be judged.
    """

    def read() -> Iterator[Samples]:
        with open_log(path, robot.description) as log:
            yield from log.chunks(CHUNK)

    present = Presence()
    with open_log(path, robot.description) as log:
        for part in log.chunks(CHUNK):
            present.add(part)
        findings.note("recording", *(f"  {line}" for line in log.warnings))
    present.refuse_void(path)
    mending, seen = _mend(robot, read, findings)
    assert seen is not None  # there are samples
    plain = Findings()
    _judge(robot, seen, plain)
    # A weight that is wrong makes a light joint's torque look compensated, turned or scaled.
    if all(finding.kind is Kind.TORQUE for finding in plain.of(*COARSE)):
        explained = Findings()
        mended = explain_weights(robot, mending.apply(read()), explained)
        again = None if mended is robot else look(mended, read(), mending)
        if again is not None:
            better = Findings()
            _judge(mended, again, better)
            if not better.of(*COARSE):
                plain = better
                findings.take(explained)
        elif again is None:
            _tell_load(robot, seen, mending, read, plain)
    findings.take(plain)
    _mend_order(robot, path, mending, findings)
    _mend_description(robot, mending, findings)


def _tell_load(
    robot: Robot,
    seen: Seen,
    mending: Mending,
    read: Callable[[], Iterator[Samples]],
    plain: Findings,
) -> None:
    """Where gains of motors are off: would one load at the end of the arm do the same?"""
    motors = {joint.name for joint in robot.description.joints if joint.torque == "motor"}
    gains = [finding for finding in plain.of(Kind.GAIN) if finding.about in motors]
    found = possible_load(robot, mending.apply(read())) if gains else None
    again = None if found is None else look(found[1], read(), mending)
    if found is None or again is None:
        return
    loaded = Findings()
    _judge(found[1], again, loaded)
    joints = {finding.about for finding in gains}
    if any(finding.about in joints for finding in loaded.of(Kind.TORQUE, Kind.GAIN)):
        return
    either = f"load or gain{'s' * (len(gains) > 1)}? {found[0]} would do the same; {CHECK_GAIN}"
    plain.all = [
        replace(x, line=x.line.replace(CHECK_GAIN, either)) if x in gains else x for x in plain.all
    ]


def _mend_order(robot: Robot, path: Path, mending: Mending, findings: Findings) -> None:
    """Where joints stand in other columns: the keys of `log` that name these."""
    if not mending.reordered:
        return
    bag = is_bag(path)
    keys = log_keys(robot.description, mending.joints, mending.order, bag)
    entries = ", ".join(f"{key}: {flow(value)}" for key, value in keys.items())
    line = f"log: {{{entries}}}"
    if not keys:
        line = "no key of robot.yaml says it: have the messages name each value's joint"
    elif mending.guessed:
        line = f"record more motion, or try {line}"
    else:
        findings.fixes["log"] = keys
    for words in map(mend_words, SIGNALS):
        findings.all = [replace(x, line=x.line.replace(words, line)) for x in findings.all]


def _mend_description(robot: Robot, mending: Mending, findings: Findings) -> None:
    """What a description can say of a recording that had to be mended; the log's keys cannot."""
    description = robot.description
    for joint, factor in zip(description.joints, mending.torque, strict=True):
        if factor != 1.0 and ("log" in findings.fixes or not mending.reordered):
            gain = float(f"{joint.gain * abs(factor):.6g}")
            findings.mend("joints", joint.name, gain=gain, sign=joint.sign * np.sign(factor).item())
        if mending.weights is not None and joint.measured:
            findings.mend("joints", joint.name, compensated="gravity")
    for sensor, matrix in zip(description.sensors, mending.wrench, strict=True):
        if np.array_equal(matrix, -np.eye(6)):
            other = "inboard" if sensor.polarity == "outboard" else "outboard"
            findings.mend("force_torque_sensors", sensor.name, polarity=other)


def glance(robot: Robot, parts: list[Samples], felt: list[Mask], off: bool) -> list[str]:
    """What a short look at a recording tells: units, order, signs, weights, noise, dead signals.

    It may hold touches: what these look like (offsets, gains, delays) is not judged, and what the
    detector felt is left out. Where hardly anything else is left, weights are judged only if the
    arm was off from the first moments on: a wrong description is, a touch comes later.

    Args:
        robot: as described.
        parts: some samples, in order.
        felt: of each part, (N,): did the detector feel something then?
        off: did more stand there than thresholds allow when observation began?
    """
    found = Findings()
    untouched = list(_untouched(parts, felt))
    enough = sum(map(len, untouched)) >= LEAST_UNTOUCHED * sum(map(len, parts))
    judged = untouched if enough else parts if off else []
    mending, seen = _mend(robot, lambda: iter(judged), found)
    whole = look(robot, parts, mending)
    if whole is None or not whole.stamps.credible:
        return found.findings
    for line in whole.table.dead_lines():
        found.find(line)
    check_noise(robot, whole, found)
    if seen is not None and is_off(robot, seen):
        explain_weights(robot, mending.apply(judged), found)
    return found.findings


def _untouched(parts: list[Samples], felt: list[Mask]) -> Iterator[Samples]:
    """The pieces in which nothing was felt, nor a moment before or after."""
    times = [part.time[mask] for part, mask in zip(parts, felt, strict=True)]
    touched = np.sort(np.concatenate(times)) if times else np.empty(0)
    for part in parts:
        before = np.searchsorted(touched, part.time - MOMENT)
        free = before == np.searchsorted(touched, part.time + MOMENT, side="right")
        edges = np.flatnonzero(np.diff(free)) + 1
        for piece in np.split(np.arange(len(part)), edges):
            if len(piece) and free[piece[0]]:
                yield part.where(piece)


def _mend(
    robot: Robot, read: Callable[[], Iterator[Samples]], findings: Findings
) -> tuple[Mending, Seen | None]:
    """Finds what hides the rest; the recording without it."""
    mending = Mending.none(robot)
    seen = look(robot, read(), mending)
    for _ in range(MOST_STEPS):
        step = None if seen is None else next_step(robot, seen, mending)
        if step is None:
            break
        for line in step.words:
            findings.find(line)
        mending = step.mending
        seen = look(robot, read(), mending)
    return mending, seen


def _judge(robot: Robot, seen: Seen, findings: Findings) -> None:
    """Judges a recording by the robot as it is."""
    seen.stamps.report(findings)
    seen.table.report(robot, findings)
    seen.repeats.report(findings)
    if seen.stamps.credible:
        for warning in bandwidth_warnings(bandwidths(robot, None), seen.stamps.period):
            if "> 1)" in warning:
                findings.find(warning)
            else:
                findings.note("time stamps", f"  {warning}")
    check_noise(robot, seen, findings)
    _compare(robot, seen, findings)


def _compare(robot: Robot, seen: Seen, findings: Findings) -> None:
    """What needs positions and times that can be believed."""
    if not seen.stamps.credible or seen.table.looks_like_degrees(robot):
        findings.note("recording", "  signs, units and weights are compared once this is mended")
        return
    windows = seen.windows
    if not len(windows):
        line = "  too short, or too many gaps, to compare readings with the model"
        findings.note("recording", line)
        return
    still = np.abs(windows.slope).max(axis=1, initial=0.0) < STILL
    findings.note(
        "recording",
        f"  {len(windows)} pieces compared with the model, the arm at rest in {int(still.sum())} "
        "of them",
        "  taken as untouched: a contact looks like a wrong gain, load or bias",
    )
    rows = make_thresholds(robot, seen.stamps.period).rows
    names = robot.segment_names
    joints = {row.joint: row.contact for row in rows if row.joint >= 0}
    components = {(names[r.segment], r.component): r.contact for r in rows if r.component >= 0}
    dead = {
        kind: {name for k, name in seen.table.dead() if k == kind} for kind in ("tau", "wrench")
    }
    for kind, names_dead in dead.items():  # a part that is stuck fits no load
        names_dead |= seen.table.held_names(kind, stuck=True)
    for problem in velocity_problems(robot, windows):
        findings.find(problem.words, Kind.SIGNAL)
    clipped = seen.table.held_names("tau", stuck=False)
    check_torques(robot, windows, dead["tau"], joints, findings, clipped)
    check_wrenches(robot, windows, dead["wrench"], components, findings)
