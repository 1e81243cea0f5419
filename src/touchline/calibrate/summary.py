# SPDX-License-Identifier: Apache-2.0
"""What a calibration found, as text."""

from dataclasses import replace

import numpy as np

from touchline.calibrate.lasting import lasting_lines
from touchline.calibrate.run import Calibration, Thresholds
from touchline.detector.limits import threshold
from touchline.detector.residual_noise import residual_noise
from touchline.detector.thresholds import make_thresholds, row_name
from touchline.identify.frame import FrameError
from touchline.identify.gain import LEAST, Gain
from touchline.identify.leaning import Lean
from touchline.identify.summary import identification_lines, rest_lines
from touchline.model.robot import Robot
from touchline.model.values import METHODS

LISTED = 5
ERRORS = 5.0  # times the noise; residuals above it come from the model, or from contacts


def summary_text(result: Calibration) -> str:
    """The figures that were written, and what they did on held-out data."""
    head = (
        f"{len(result.logs)} recording{'s' * (len(result.logs) > 1)}, "
        f"{result.seconds / 60:.1f} min at {1 / result.period:.0f} Hz"
    )
    parts = [[head, *(f"  {loss}" for loss in result.losses)], _left_out_lines(result)]
    if result.identification is not None:
        late = [
            f"  {x.name}: {1e3 * abs(x.value):.2f} +- {1e3 * x.error:.2g} ms "
            + ("later" if x.value > 0.0 else "earlier")
            + " than the positions"
            for x in result.delays
        ]
        late += _lean_lines(result.lean)
        off = [line for frame in result.frames for line in _frame_lines(frame)]
        gains = [] if result.gains is None else _gain_lines(result.gains)
        parts.append(identification_lines(result.identification, gains + late + off))
        parts.append(lasting_lines(result.identification))
    if result.rest is not None:
        parts.append(rest_lines(result.rest, result.robot.joint_names))
    parts.append(_noise_lines(result))
    if result.thresholds is None:
        lines = result.lacking.splitlines()
        parts.append(["thresholds", *(f"  {line}" for line in lines)])
    else:
        parts += [_row_lines(result), _threshold_lines(result), _held_out_lines(result)]
    parts.append([f"written: {result.out}"])
    return "\n\n".join("\n".join(lines) for lines in parts if lines)


def _gain_lines(gains: tuple[Gain, ...]) -> list[str]:
    """Gains of motor currents that are off."""
    if not gains:
        return [f"  gains: none is off by {100 * LEAST:g} % or more, as far as the data can tell"]
    lines = []
    for gain in gains:
        if gain.plausible:
            told = f"{gain.factor:.3f} +- {gain.error:.2g} times the described one"
        else:
            told = (
                f"left as described: {gain.factor:.3g} times that would fit best, which no gain "
                "is; is a load missing in the description?"
            )
        lines.append(f"  {gain.name}: gain {told}")
    return lines


def _lean_lines(lean: Lean | None) -> list[str]:
    """How far the base leans otherwise than described."""
    if lean is None:
        return []
    angle, error = np.degrees(lean.angle), np.degrees(np.linalg.norm(lean.error))
    return [f"  the base leans by {angle:.2f} +- {error:.2g} degrees more than described: gravity"]


def _frame_lines(frame: FrameError) -> list[str]:
    """How far a sensor's frame is off, in its own axes."""
    lines = []
    for what, values, errors, unit in (
        ("turned by", np.degrees(frame.turn), np.degrees(frame.turn_error), "degrees"),
        ("shifted by", 1e3 * frame.shift, 1e3 * frame.shift_error, "mm"),
    ):
        if errors.any():
            told = ", ".join(f"{x:.2f}" for x in values)
            lines.append(f"  {frame.name}: {what} [{told}] +- {errors.max():.2g} {unit}: pose")
    return lines


def _left_out_lines(result: Calibration) -> list[str]:
    """What seemed to be touched, and was left out."""
    if not result.left_out:
        return []
    total = sum(end - start for _, start, end in result.left_out)
    lines = [f"left out, because something seems to touch the robot: {total:.1f} s"]
    for number, start, end in result.left_out[:LISTED]:
        lines.append(f"  {result.logs[number]}: from {start:.2f} to {end:.2f} s")
    if len(result.left_out) > LISTED:
        lines.append(f"  ... and {len(result.left_out) - LISTED} more")
    return lines


def _noise_lines(result: Calibration) -> list[str]:
    noise = result.noise
    lines = ["noise, 1 sigma per sample"]
    if noise.qd:
        lines.append(f"  qd   {_range(noise.qd)} rad/s")
    if any(joint.measured for joint in result.robot.description.joints):
        lines.append(f"  tau  {_range(noise.tau)} Nm")
    for name, six in noise.sensors.items():
        lines.append(f"  {name}: force {_range(six[:3])} N, moment {_range(six[3:])} Nm")
    return lines


def _range(values: tuple[float, ...]) -> str:
    low, high = f"{min(values):.2g}", f"{max(values):.2g}"
    return low if low == high else f"{low} to {high}"


def _row_lines(result: Calibration) -> list[str]:
    """What is usual in every row, beside noise, and what `rows` would take for a contact."""
    robot, rows = result.robot, _of(result).description.rows
    used = robot.description.detection.method
    methods = used if "rows" in used else (*used[1:], "rows")  # as many as share the rate
    detection = replace(
        robot.description.detection, method=methods, calibration=_of(result).description
    )
    calibrated = Robot(replace(robot.description, detection=detection), robot.mechanism)
    period = _of(result).description.period
    joint_noise, segment_noise = residual_noise(robot, period)
    lines = ["residuals without contact, 1 sigma, and the thresholds of rows for that rate"]
    lines.append(f"  {'row':20} {'noise':>8} {'in all':>8} {'threshold':>10}")
    ratios: dict[str, float] = {}
    for row in make_thresholds(calibrated, period).rows:
        name = row_name(robot, row)
        if name not in rows:
            continue
        segment = robot.segment_names[row.segment]
        is_joint = row.component < 0
        noise = joint_noise[row.joint] if is_joint else segment_noise[segment][row.component]
        unit = "N" if 0 <= row.component < 3 else "Nm"
        usual = rows[name].typical
        ratios[name] = usual / max(noise, 1e-12)
        lines.append(f"  {name:20} {noise:8.2g} {usual:8.2g} {row.contact:10.3g} {unit}")
    worst = max(ratios, key=lambda name: ratios[name])
    if ratios[worst] > ERRORS:
        lines.append(
            f"  {worst} shows {ratios[worst]:.0f} times what its noise explains: inertias, payload "
            "or friction\n  are not as described (touchline check), or something touched the robot "
            "throughout"
        )
    given = robot.description.detection.contact
    kinds = [k for k in ("torque", "force", "moment") if getattr(given, k) is not None]
    if kinds:
        keys = ", ".join(f"detection.contact.{kind}" for kind in kinds)
        lines.append(f"  {keys} of the description stay in force, and have no rate: take them out")
    return lines


def _threshold_lines(result: Calibration) -> list[str]:
    share, used = result.share, len(result.robot.description.detection.method)
    lines = [
        f"thresholds for {result.rate:g} an hour of the whole robot"
        f"{f', shared by {used} methods' * (used > 1)}",
        f"  {'segment':10} {'method':8} {'threshold':>9}  {'95 % interval':>17}  "
        f"{'peaks':>5} {'shape':>6}",
    ]
    extrapolated = False
    for segment, tails in _of(result).tails.items():
        for method, tail in tails.items():
            low, high = tail.interval(share)
            beyond = tail.extrapolates(share)
            extrapolated |= beyond
            value = threshold(tail.description(), share)
            lines.append(
                f"  {segment:10} {method:8} {value:9.3g}  {f'{low:.3g} to {high:.3g}':>17}  "
                f"{tail.count:5d} {tail.shape:6.2f}{'  *' * beyond}"
            )
    if extrapolated:
        needed = 1.0 / share
        lines.append(
            f"  * extrapolated: one alarm in {needed:.3g} h of a segment, from "
            f"{_of(result).description.hours:.3g} h. Record {needed:.3g} h to see it."
        )
    lines += _moment_lines(result)
    chosen = result.robot.description.detection.method
    lines.append(f"  in use: {', '.join(chosen)}; also allowed: {', '.join(METHODS)}")
    return lines


def _moment_lines(result: Calibration) -> list[str]:
    """Single moments that set a threshold."""
    moments = _of(result).moments
    lines = [
        f"  one moment sets {x.method} of {x.segment}: {result.logs[x.recording]} at "
        f"{x.time:.2f} s; without it {x.without:.3g}, not {x.threshold:.3g}"
        for x in moments
    ]
    if lines:
        lines.append(
            "  a hard stop, or a touch? If it is no part of the work, cut it out and calibrate "
            "again:\n  touches as weak as this moment are not felt otherwise"
        )
    return lines


def _held_out_lines(result: Calibration) -> list[str]:
    hours = _of(result).test.hours
    if not _of(result).held_out:
        return ["too short for a check on held-out data"]
    lines = [
        f"on held-out data ({_of(result).parted}, {60 * hours:.1f} min): alarms that came",
        f"  {'method':8} {'at 1/h':>7}  {'came':>5} {'expected':>9}  {'measured 1/h':>12}  95 %",
    ]
    for h in _of(result).held_out:
        low, high = h.interval
        lines.append(
            f"  {h.method:8} {h.rate:7g}  {h.count:5d} {h.rate * hours:9.2f}  {h.measured:12.3g}  "
            f"{low:.3g} to {high:.3g}"
        )
    expected = result.rate * hours
    if expected < 1.0:
        lines.append(
            f"  too short to tell whether {result.rate:g} an hour hold: one alarm takes "
            f"{1.0 / result.rate:.3g} h of held-out data"
        )
    return lines


def _of(result: Calibration) -> Thresholds:
    """The thresholds of a calibration that has some."""
    assert result.thresholds is not None
    return result.thresholds
