# SPDX-License-Identifier: Apache-2.0
"""What a calibration found, as text."""

from touchline.calibrate.run import Calibration
from touchline.contact.limits import threshold
from touchline.model.values import METHODS


def summary_text(result: Calibration) -> str:
    """The figures that were written, and what they did on held-out data."""
    description = result.description
    head = (
        f"{len(result.logs)} recording{'s' * (len(result.logs) > 1)}, "
        f"{60 * description.hours:.1f} min at {1 / description.period:.0f} Hz"
    )
    lines = [head, "", *_noise_lines(result), "", *_threshold_lines(result)]
    return "\n".join([*lines, "", *_held_out_lines(result), "", f"written: {result.out}"])


def _noise_lines(result: Calibration) -> list[str]:
    noise = result.noise
    lines = ["noise, 1 sigma per sample", f"  qd   {_range(noise.qd)} rad/s"]
    if any(joint.torque in ("sensor", "motor") for joint in result.robot.description.joints):
        lines.append(f"  tau  {_range(noise.tau)} Nm")
    for name, six in noise.sensors.items():
        lines.append(f"  {name}: force {_range(six[:3])} N, moment {_range(six[3:])} Nm")
    return lines


def _range(values: tuple[float, ...]) -> str:
    low, high = f"{min(values):.2g}", f"{max(values):.2g}"
    return low if low == high else f"{low} to {high}"


def _threshold_lines(result: Calibration) -> list[str]:
    count = len(result.tails)
    share = result.rate / count
    lines = [
        f"thresholds for {result.rate:g} false alarms an hour of the whole robot",
        f"  {'segment':10} {'method':8} {'threshold':>9}  {'95 % interval':>17}  "
        f"{'peaks':>5} {'shape':>6}",
    ]
    extrapolated = False
    for segment, tails in result.tails.items():
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
            f"{result.description.hours:.3g} h. Record {needed:.3g} h to see it."
        )
    chosen = result.robot.description.detection.method
    lines.append(f"  in use: {', '.join(chosen)}; also allowed: {', '.join(METHODS)}")
    return lines


def _held_out_lines(result: Calibration) -> list[str]:
    hours = result.held_out[0].hours
    lines = [
        f"on held-out data ({result.split}, {60 * hours:.1f} min): alarms that came",
        f"  {'method':8} {'at 1/h':>7}  {'came':>5} {'expected':>9}  {'measured 1/h':>12}  95 %",
    ]
    for h in result.held_out:
        low, high = h.interval
        lines.append(
            f"  {h.method:8} {h.rate:7g}  {h.count:5d} {h.rate * hours:9.2f}  {h.measured:12.3g}  "
            f"{low:.3g} to {high:.3g}"
        )
    return lines
