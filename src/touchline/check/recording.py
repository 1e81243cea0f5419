# SPDX-License-Identifier: Apache-2.0
"""A recording beside the description: one pass, then one judgement after another."""

from pathlib import Path

import numpy as np

from touchline.check.findings import Findings
from touchline.check.joints import check_torques, check_velocities
from touchline.check.signals import SignalTable
from touchline.check.stamps import Stamps
from touchline.check.windows import WindowMaker
from touchline.check.wrenches import check_wrenches
from touchline.detector.thresholds import make_thresholds
from touchline.errors import InputError
from touchline.logs import open_log
from touchline.logs.period import typical_period
from touchline.model.robot import Robot
from touchline.report.facts import bandwidth_warnings, bandwidths

STILL = 0.01  # rad/s or m/s


GROSS = (  # words of findings that must be mended before weights mean anything
    "opposite",
    "swapped",
    "use factor",
    "look like degrees",
    "polarity:",
    "frame:",
    "compensated:",
    "always",
    "no value",
    "milliseconds",
    "saturated",
    "infinite",
)


def check_recording(robot: Robot, path: Path, findings: Findings) -> None:
    """Judges a log.

    Where weights are off and nothing coarser is wrong, what would explain them (a hand, a tilted
    base) is found first, and the rest is judged as if that were mended.

    Raises:
        InputError: the log cannot be read, or holds no samples.
    """
    from touchline.check.loads import explain_weights

    plain = Findings()
    _judge_recording(robot, path, plain)
    coarse = _coarse(plain)
    explained, mended = Findings(), robot
    # A weight that is wrong makes a light joint's torque look compensated, turned or scaled.
    if all(line.startswith("torque of ") and " times what " in line for line in coarse):
        with open_log(path, robot.description) as log:
            mended = explain_weights(robot, log.chunks(1 << 15), explained)
    if mended is not robot:
        again = Findings()
        _judge_recording(mended, path, again)
        if _coarse(again):
            explained = Findings()
        else:
            plain = again
    findings.fixes.update(explained.fixes)
    for line in (*explained.findings, *plain.findings):
        findings.find(line)
    for section, lines in plain.notes.items():
        findings.note(section, *lines)


def _coarse(findings: Findings) -> list[str]:
    """The findings that must be mended before weights mean anything."""
    return [line for line in findings.findings if any(word in line for word in GROSS)]


def _judge_recording(robot: Robot, path: Path, findings: Findings) -> None:
    """Reads a log once and judges it by the robot as it is."""
    table = SignalTable(robot)
    stamps = maker = None
    with open_log(path, robot.description) as log:
        for part in log.chunks(1 << 15):
            if stamps is None or maker is None:
                period = typical_period(part.time)
                stamps, maker = Stamps(period), WindowMaker(robot, period)
            stamps.add(part.time)
            table.add(part)
            maker.add(part)
        findings.note("recording", *(f"  {line}" for line in log.warnings))
    if stamps is None or maker is None or not stamps.samples:
        raise InputError(f"{path}: holds no samples")
    stamps.report(findings)
    table.report(robot, findings)
    if stamps.credible:
        for warning in bandwidth_warnings(bandwidths(robot, None), stamps.period):
            if "> 1)" in warning:
                findings.find(warning)
            else:
                findings.note("time stamps", f"  {warning}")
    _compare(robot, maker, stamps, table, findings)


def _compare(
    robot: Robot, maker: WindowMaker, stamps: Stamps, table: SignalTable, findings: Findings
) -> None:
    """What needs positions and times that can be believed."""
    if not stamps.credible or table.looks_like_degrees(robot):
        findings.note("recording", "  signs, units and weights are compared once this is mended")
        return
    windows = maker.windows()
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
    rows = make_thresholds(robot, stamps.period).rows
    names = robot.segment_names
    joints = {row.joint: row.contact for row in rows if row.joint >= 0}
    components = {(names[r.segment], r.component): r.contact for r in rows if r.component >= 0}
    dead = {kind: {name for k, name in table.dead() if k == kind} for kind in ("tau", "wrench")}
    check_velocities(robot, windows, findings)
    check_torques(robot, windows, dead["tau"], joints, findings)
    check_wrenches(robot, windows, dead["wrench"], components, findings)
