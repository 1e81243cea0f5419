# SPDX-License-Identifier: Apache-2.0
"""What was identified, as text."""

from collections.abc import Sequence

import numpy as np

from touchline.identify.fit import main_links
from touchline.identify.identification import Identification
from touchline.identify.payload import payload_link
from touchline.identify.rest import Rest

UNITS = {
    "bias": "Nm",
    "viscous": "Nm s/rad",
    "coulomb": "Nm",
    "stribeck": "Nm",
    "rotor": "kg m2",
}
WORDS = {
    "bias": "offset",
    "viscous": "viscous friction",
    "coulomb": "Coulomb friction",
    "stribeck": "more of it at slow speeds (Stribeck)",
    "rotor": "rotor inertia",
}
SHORT = 20.0  # s; less is told to be little


def identification_lines(found: Identification, beside: list[str] | None = None) -> list[str]:
    """What was found and what it is worth; `beside` are lines on what was found before it."""
    lines = ["identified, with 1 sigma", *(beside or [])]
    lines += _column_lines(found) + _body_lines(found)
    if len(lines) == 1:
        lines.append("  nothing that foretells data held out better than the description does")
    lines += _ambiguous_lines(found)
    if found.withheld:
        lines.append(
            "  freer inertias or a payload would explain more, but these postures do not vouch for "
            "what they do in others; a minute of motion of all joints tells them"
        )
    if found.seconds < SHORT:
        lines.append(
            f"  from {found.seconds:.1f} s: offsets may be worth it, inertias and friction of "
            "joints that hardly moved are not; a minute of motion of all joints tells them"
        )
    return [*lines, "", *_residual_lines(found)]


def rest_lines(rest: Rest, joints: Sequence[str]) -> list[str]:
    """What was learned of what is left, and what it is worth where it has not been."""
    lines = ["learned beside it, by joint, over its own position and velocity"]
    if not rest.tables:
        return [*lines, "  nothing that foretells parts of time and space which it has not seen"]
    head = f"  {'joint':20} {'up to':>8}  {'held out':>16}  {'elsewhere':>16}"
    lines.append(f"{head}  (RMS before and after)")
    for j, name in enumerate(joints):
        if name not in rest.tables:
            continue
        pairs = (rest.before[j], rest.after[j]), (rest.region_before[j], rest.region_after[j])
        told = "  ".join(f"{a:8.3g}{b:8.3g}" for a, b in pairs)
        lines.append(f"  {name:20} {rest.tables[name].largest:8.3g}  {told} Nm")
    told = "elsewhere: in parts of the workspace that played no part; off where nothing was seen"
    return [*lines, f"  {told}"]


def _column_lines(found: Identification) -> list[str]:
    names, solution = found.evidence.rows.names, found.solution
    lines = []
    rows = sorted({column.row for column in found.problem.columns})
    for row in rows:
        told = []
        for column, value, error in zip(
            found.problem.columns, solution.values, solution.errors, strict=True
        ):
            if column.row != row:
                continue
            unit = UNITS[column.kind]
            if column.kind == "bias":
                unit = _unit(found, row)
            what = f"{WORDS[column.kind]} {value:+.3g} +- {error:.2g} {unit}".rstrip()
            if column.kind == "coulomb":
                what += f" (within {column.width:g} rad/s)"
            if column.kind == "stribeck":
                what += f" (falls with {column.speed:g} rad/s)"
            told.append(what)
        lines.append(f"  {names[row]}: {', '.join(told)}")
    return lines


def _ambiguous_lines(found: Identification) -> list[str]:
    """Biases that could be masses."""
    names = found.evidence.rows.names
    return [
        f"  {names[row]}: mass or bias? this motion does not tell them apart; the bias is known to "
        f"+- {sigma:.2g} {_unit(found, row)} alone, the sum of both is what is written"
        for row, sigma in found.ambiguous.items()
    ]


def _unit(found: Identification, row: int) -> str:
    """Of a bias."""
    is_joint = row < found.evidence.joints
    return "N" if not is_joint and found.evidence.rows.names[row][-2] == "f" else "Nm"


def _body_lines(found: Identification) -> list[str]:
    problem, lines = found.problem, []
    own = [body for body in problem.bodies if not body.added]
    for body, change, error in zip(
        problem.bodies, found.solution.changes(), found.solution.body_errors, strict=True
    ):
        if body.added:
            centre = ", ".join(f"{x:.3f}" for x in change[1:4] / change[0])
            name = payload_link(found.evidence.robot, body.node)
            lines.append(f"  payload at {name}: {change[0]:.3f} +- {error[0]:.2g} kg, centre at")
            lines[-1] += f" [{centre}] m in the axes of its joint"
            lines.append(
                "    or something that rested on it, or pressed down on it, all through the "
                "recording: these read the same. If nothing is mounted there, record again"
            )
    if not own:
        return lines
    links = main_links(found.evidence.robot)
    sigma = own[0].sigma
    lines += [
        f"  inertias drawn to the model's (1 sigma {100 * sigma:g} % of their square root): mass"
    ]
    for body, change, error in zip(
        problem.bodies, found.solution.changes(), found.solution.body_errors, strict=True
    ):
        if body.added:
            continue
        mass = body.model[0]
        lines.append(
            f"    {links[body.node][0]}: {mass:.3f} kg {change[0]:+.3f} +- {error[0]:.2g} kg"
        )
    lines.append("    single masses are worth little: only sums that a joint or sensor feels are")
    return lines


def _residual_lines(found: Identification) -> list[str]:
    """RMS of the residuals before and after, on data that played no part."""
    used = np.flatnonzero(found.evidence.used)
    lines = [
        f"residuals at K = {found.evidence.bandwidth:g} rad/s on data that played no part "
        f"({found.parted}), RMS",
        f"  {'row':20} {'before':>8} {'after':>8}         elsewhere",
    ]
    for row in used:
        name, is_joint = found.evidence.rows.names[row], row < found.evidence.joints
        unit = "N" if not is_joint and name.endswith(("fx", "fy", "fz")) else "Nm"
        told = f"{found.before[row]:8.3g} {found.after[row]:8.3g} {unit:2}"
        lines.append(f"  {name:20} {told} {found.growth[row]:8.2f} times")
    joints = used[used < found.evidence.joints]
    if len(joints):
        before, after = float(found.before[joints].sum()), float(found.after[joints].sum())
        share = f" ({100 * after / before:.0f} %)" if before > 0 else ""
        lines.append(f"  {'sum over joints':20} {before:8.3g} {after:8.3g} Nm{share}")
    return [*lines, *_posture_lines(found)]


def _posture_lines(found: Identification) -> list[str]:
    """What of its postures the arm has shown."""
    robot = found.evidence.robot
    lines = ["  elsewhere: how much larger they are later, or in postures that a fit left out"]
    if not robot.joint_names:
        return lines
    low, high = robot.ranges
    seen = np.ptp(found.evidence.q[~found.touched], axis=0)
    shares = 100.0 * seen / np.maximum(high - low, 1e-9)
    least = int(np.argmin(shares))
    return [
        *lines,
        f"  joints moved over {shares.min():.0f} to {shares.max():.0f} % of their ranges, least "
        f"{robot.joint_names[least]}; beyond that the model may err more",
    ]
