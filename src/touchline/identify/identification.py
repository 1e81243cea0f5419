# SPDX-License-Identifier: Apache-2.0
"""From filtered equations to parameters that foretell data which played no part."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Mask
from touchline.errors import InputError
from touchline.identify.choice import Chooser, rms
from touchline.identify.evidence import Evidence
from touchline.identify.fit import Problem, Solution, applied
from touchline.identify.touches import STICTION, find_touches, stretches

LEAST_SECONDS = 2.0  # of settled, untouched data; less tells an offset at best
HELD_OUT = 3  # every third recording, or the last third of each
WORSE = 1.01  # a row that is left larger than this on data held out keeps what is described
MOST_TOUCHED = 0.7  # of the time; beyond it nobody can say which state is the usual one
ROUNDS = 3  # of fitting and finding touches


@dataclass(frozen=True)
class Identification:
    """What was identified, and what it is worth on data that played no part.

    Attributes:
        evidence: all instants.
        solution: from all untouched instants, with standard errors.
        touched: (N,) instants that were left out.
        before, after: (R,) RMS of the residuals on data held out, of the described model and of
            one that was fitted to the other data alone.
        parted: how the data were parted.
        train, test: (N,) the other data, and those held out.
        trained: the solution from `train` alone.
        ambiguous: rows whose bias a mass could be as well, with 1 sigma [N or Nm] of the bias then.
        growth: (R,) how much larger residuals are than `solution` leaves them, at least 1: on data
            held out, or where the arm was not while it was fitted.
        withheld: would freer inertias or a payload explain more, but be off in postures not shown?
    """

    evidence: Evidence
    solution: Solution
    touched: Mask
    before: Array
    after: Array
    parted: str
    train: Mask
    test: Mask
    trained: Solution
    ambiguous: dict[int, float]
    growth: Array
    withheld: bool = False

    @property
    def problem(self) -> Problem:
        """What was free."""
        return self.solution.problem

    @property
    def seconds(self) -> float:
        """Of untouched, settled data."""
        return duration(self.evidence, ~self.touched)

    def touches(self) -> list[tuple[int, float, float]]:
        """Recording, begin and end [s] of what was left out."""
        return stretches(self.evidence, self.touched)

    def left(self, evidence: Evidence | None = None) -> Array:
        """Residuals (N, R) after the fit: of all its own instants, or of other ones."""
        evidence = evidence or self.evidence
        return evidence.residual() + applied(evidence, self.solution)


def identify(evidence: Evidence, trust: bool = False) -> Identification:
    """Identifies as much of a robot as the data support.

    Args:
        evidence: of contact-free motion, or with touches that stand out.
        trust: nothing touched the robot: whatever stands out is its own doing.

    Raises:
        InputError: too short, or touched throughout.
    """
    if duration(evidence, np.ones(len(evidence), dtype=bool)) < LEAST_SECONDS:
        raise InputError(
            f"{LEAST_SECONDS:g} s of contact-free data are needed to identify anything, "
            "a minute of motion of all joints is better"
        )
    touched = np.zeros(len(evidence), dtype=bool) if trust else touched_instants(evidence)
    if touched.mean() > MOST_TOUCHED:
        raise InputError(
            f"something seems to touch the robot for {100 * touched.mean():.0f} % of the time: "
            "record a minute in which nothing touches it"
        )
    train, test, parted = _part(evidence, ~touched)
    chooser, whole = Chooser(evidence, train), Chooser(evidence, ~touched)
    chosen = chooser.choose()
    problem = whole.vouched(chosen)
    withheld = problem is not chosen
    held = evidence.part(test)
    start = held.residual()
    before = rms(start)
    trained = chooser.fit(problem)
    after = rms(start + applied(held, trained))
    while problem.columns or problem.bodies:
        worse = (after > WORSE * before) & evidence.used
        if not worse.any():
            break
        smaller = replace(problem, columns=tuple(c for c in problem.columns if not worse[c.row]))
        if smaller == problem:
            smaller = replace(problem, bodies=())
        problem = smaller
        trained = chooser.fit(problem)
        after = rms(start + applied(held, trained))
    if float(after.sum()) >= float(before.sum()):
        problem, after = Problem(), before
        trained = chooser.fit(problem)
    solution = whole.with_errors(whole.fit(problem))
    left = rms((whole.start + applied(evidence, solution))[~touched])
    later = after / np.maximum(left, 1e-9)
    return Identification(
        evidence,
        solution,
        touched,
        before,
        after,
        parted,
        train,
        test,
        trained,
        whole.ambiguous(),
        np.maximum(later, whole.growth_elsewhere(solution)),
        withheld,
    )


def identify_all(evidence: Evidence) -> Solution:
    """What all untouched instants tell, none being kept for a judgement: for short recordings."""
    chooser = Chooser(evidence, ~touched_instants(evidence))
    return chooser.with_errors(chooser.fit(chooser.choose()))


def touched_instants(evidence: Evidence) -> Mask:
    """Which instants (N,) a rich model cannot explain beside the others."""
    touched = np.zeros(len(evidence), dtype=bool)
    for _ in range(ROUNDS):
        chooser = Chooser(evidence, ~touched)
        found = chooser.fit(chooser.richest())
        laws = [joint.friction for joint in evidence.robot.description.joints]
        coulomb = [law.coulomb + found.value("coulomb", j) for j, law in enumerate(laws)]
        more = [law.stribeck + found.value("stribeck", j) for j, law in enumerate(laws)]
        held = np.maximum(STICTION * np.array(coulomb), np.add(coulomb, more))
        now = find_touches(evidence, evidence.residual() + applied(evidence, found), held)
        if (now == touched).all() or now.mean() > MOST_TOUCHED:
            return now
        touched = now
    return touched


def duration(evidence: Evidence, use: Mask) -> float:
    """Seconds that some of the instants stand for."""
    steps = np.diff(evidence.time)
    same = np.diff(evidence.recording) == 0
    typical = float(np.median(steps[same])) if same.any() else 0.0
    return typical * float(use.sum())


def _part(evidence: Evidence, use: Mask) -> tuple[NDArray, NDArray, str]:
    numbers = np.unique(evidence.recording)
    if len(numbers) >= HELD_OUT:
        out = evidence.recording % HELD_OUT == HELD_OUT - 1
        return use & ~out, use & out, f"every {HELD_OUT}rd recording held out"
    out = np.zeros(len(evidence), dtype=bool)
    for number in numbers:
        own = np.flatnonzero((evidence.recording == number) & use)
        out[own[len(own) - len(own) // HELD_OUT :]] = True
    how = "the last third held out" if len(numbers) == 1 else "the last third of each held out"
    return use & ~out, use & out, how
