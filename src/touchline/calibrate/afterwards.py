# SPDX-License-Identifier: Apache-2.0
"""Identifications that must not be written: of touched arms, of another robot, of two at once."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from touchline.calibrate.beforehand import named
from touchline.calibrate.resting import PIECE, find_changing, find_resting
from touchline.errors import InputError
from touchline.identify.choice import Chooser
from touchline.identify.fit import applied
from touchline.identify.identification import Identification, duration, rms
from touchline.identify.touches import jumps

# Jumps (see `jumps`) of what counts as untouched. Normal noise has 2.4. Free recordings of real
# arms with friction have up to 10.2, and at most 1 % of them seem touched. Simulated arms that are
# touched for more than 60 % of the time have at least 17 where little of that was found, at least 6
# where much was. Of those that are touched half of the time and found well none has more than 4.
MUCH = 0.3  # of the time seems touched
MOST_JUMPS, MOST_JUMPS_BESIDE_MUCH = 13.0, 5.0
UNEXPLAINED = 0.3  # of what is read; of real arms 0.03 to 0.09 is left, of another robot's log 1.3
# An offset may take the mean of another robot's readings: then little is left of what is read, but
# 0.9 of its spread. Of real arms 0.05 of that is left. Friction of an arm that hardly moves can be
# most of the spread, but not a tenth of what is read.
UNMOVED, BESIDE_READ = 0.5, 0.1
LEAST = 2.0  # N or Nm, sums over joints or sensors; less is noise on unloaded sensors
APART = 20.0  # times as much left in a row as by a fit to itself; parts of real recordings: 5
LEAST_APART, LEAST_SHARE = 1.0, 0.05  # N or Nm, or of what is read; less is a bias that drifts
MOVED = 0.5  # rad; of a recording in which no joint moves more, a fit to itself tells nothing
SECONDS = 5.0  # of one recording at least, for a fit to itself
WHOLE = 0.95  # of a recording seems touched: the others tell what is usual, and it is otherwise
KEPT = "nothing written; --trust takes the recordings as they are"


def refuse_two_robots(found: Identification, logs: list[Path]) -> None:
    """Refuses recordings that each fit a robot, but not the same one.

    Raises:
        InputError: which recording stands out, and what to do.
    """
    if len(logs) < 2:
        return
    told = ""
    for number, log in enumerate(logs):
        own = found.touched[found.evidence.recording == number]
        if len(own) and own.mean() > WHOLE:
            told = f"nothing in {log} is as in the others"
    for number, log in enumerate(logs):
        told = told or _apart(found, number, log)
    if told:
        raise InputError(
            f"{named(logs)}: do not show one robot: {told}. Another arm, tool or payload, a sensor "
            "tared in between, or touches throughout? Calibrate by the recordings of each alone; "
            f"{KEPT}"
        )


def refuse_unexplained(found: Identification, logs: list[Path]) -> None:
    """Refuses recordings of which the robot's model explains hardly anything.

    Raises:
        InputError: how little, and what to do.
    """
    e = found.evidence
    reading = e.reading[~found.touched]
    size, spread = rms(reading), reading.std(axis=0)
    rows = np.flatnonzero(e.used)
    joints = rows[rows < e.joints]
    forces = rows[(rows >= e.joints) & ((rows - e.joints) % 6 < 3)]
    for own, unit in ((joints, "Nm of joint torques"), (forces, "N of forces")):
        left, read, varied = (float(x[own].sum()) for x in (found.after, size, spread))
        told = ""
        if left > max(LEAST, UNEXPLAINED * read):
            told = f"{left:.3g} {unit} are left of {read:.3g}"
        elif left > max(LEAST, UNMOVED * varied, BESIDE_READ * read):
            told = f"{left:.3g} {unit} are left where readings vary by {varied:.3g}"
        if told:
            raise InputError(
                f"{named(logs)}: does not fit {e.robot.description.name}: {told}, whatever is "
                "identified. Is it another robot's recording, or are columns swapped or dead "
                f"(touchline check ROBOT LOG)? {KEPT}"
            )
    _refuse_far_offsets(found, joints, logs)


def _refuse_far_offsets(found: Identification, joints: NDArray, logs: list[Path]) -> None:
    """Refuses offsets of joints beyond every torque that the model expects of the arm."""
    e = found.evidence
    untouched = ~found.touched
    reading = e.reading[np.ix_(untouched, joints)]
    expected = float(np.abs(e.load[np.ix_(untouched, joints)]).max(initial=0.0))
    # An arm with vertical axes alone has no weight in its torques, but what moves it.
    moving = float(np.abs(reading - reading.mean(axis=0)).max(initial=0.0)) if len(reading) else 0.0
    for j in joints:
        offset = found.solution.value("bias", j)
        if abs(offset) > max(LEAST, expected, moving):
            raise InputError(
                f"{named(logs)}: does not fit {e.robot.description.name}: {e.rows.names[j]} would "
                f"have an offset of {offset:+.3g} Nm, where the model expects {expected:.3g} Nm "
                "at most of any joint. Is it another robot's recording, a wrong unit or column, "
                f"or does the description lack a load (touchline check ROBOT LOG)? {KEPT}"
            )


def refuse_touched(found: Identification, logs: list[Path]) -> None:
    """Refuses recordings of which no part can be trusted to be untouched.

    What seems untouched of a robot that is touched most of the time holds touches too.

    Raises:
        InputError: what to record instead.
    """
    share = float(found.touched.mean())
    row, size = jumps(found.evidence, found.left(), ~found.touched)
    if size > (MOST_JUMPS_BESIDE_MUCH if share > MUCH else MOST_JUMPS):
        raise InputError(
            f"{named(logs)}: something seems to touch the robot most of the time: "
            f"{found.evidence.rows.names[row]} jumps again and again where nothing should. Record "
            "a minute of motion of all joints in which nothing touches the robot, or cut the "
            f"touches out; {KEPT}"
        )


def refuse_resting(found: Identification, logs: list[Path]) -> None:
    """Refuses recordings in which a force rests on the arm throughout: parameters would take it.

    Raises:
        InputError: how large it is, where, and what to record instead.
    """
    force = find_resting(found)
    if force is None or not force.there:
        _refuse_changing(found, logs)
        return
    where = f"frame of {force.frame}" if force.frame else "world"
    raise InputError(
        f"{named(logs)}: something seems to rest on the arm throughout: a force of about "
        f"{force.size:.2g} N at {force.link}, constant in the {where}, explains "
        f"{100 * force.explained:.0f} % of what is left without it. No payload, offset or friction "
        "does. Record a minute of motion of all joints in which nothing touches the arm: no hand, "
        f"no table, no cable that pulls; {KEPT}"
    )


def _refuse_changing(found: Identification, logs: list[Path]) -> None:
    """Refuses recordings whose touches are so long that few of them begin or end."""
    changing = find_changing(found)
    if changing is not None and changing.there:
        raise InputError(
            f"{named(logs)}: something seems to touch the robot most of the time: forces of about "
            f"{changing.force:.2g} N, one for every {PIECE:g} s, explain "
            f"{100 * changing.explained:.0f} % of what is left. Record a minute of motion of all "
            f"joints in which nothing touches the robot, or cut the touches out; {KEPT}"
        )


def _apart(found: Identification, number: int, log: Path) -> str:
    """In which row the fit to all leaves far more of a recording than one to its first part."""
    e = found.evidence
    own = np.flatnonzero((e.recording == number) & ~found.touched)
    train, test = np.zeros(len(e), dtype=bool), np.zeros(len(e), dtype=bool)
    later = len(own) - len(own) // 3
    train[own[:later]], test[own[later:]] = True, True
    if duration(e, train) < SECONDS or np.ptp(e.q[train], axis=0).max(initial=0.0) < MOVED:
        return ""
    alone = Chooser(e, train)
    held = e.part(test)
    own_fit = alone.fit(alone.richest())
    common, itself = (
        rms(held.residual() + applied(held, solution)) for solution in (found.solution, own_fit)
    )
    much = np.maximum(LEAST_APART, LEAST_SHARE * rms(held.reading))
    far = np.where(e.used & (common > much), common / np.maximum(itself, 1e-9), 0.0)
    row = int(np.argmax(far))
    if far[row] < APART:
        return ""
    return (
        f"in {e.rows.names[row]} of {log} a fit to all leaves {far[row]:.0f} times what one to "
        "itself does"
    )
