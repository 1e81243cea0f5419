# SPDX-License-Identifier: Apache-2.0
"""What stands on an arm without a touch, and how much more noise it has than was told."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from touchline.tuning import DEFAULTS

NOISIER = DEFAULTS["detector.noisier"]  # times told
MOST = 4  # of signals that a line names; the largest come first


@dataclass(frozen=True)
class Standing:
    """How far one signal of the detector has shown that the arm is not as told.

    Attributes:
        segment: segment that the signal belongs to.
        signal: "JOINT" for a joint's torque, "SENSOR.fx" for a wrench in that sensor's frame.
        unit: "N" or "Nm", of the next five values.
        threshold: what a touch must exceed.
        start: what stood there when observation began, and still a while later. It was a touch, an
            error of the model, or a bias. 0 where it did not exceed the threshold.
        now: what stands there now and does not change, since the start or since a touch. 0 where
            it does not exceed the threshold.
        drift: by how much that has changed since then, so slowly that no hand does it. Sensors that
            warm up drift so, and the detector follows. 0 where it does not exceed the threshold.
        seen: one sigma of the residual's noise, when it was largest against what was told.
        noise: ratio of that to the sigma that is told; 1 where nothing speaks against it.
    """

    segment: str
    signal: str
    unit: str
    threshold: float
    start: float
    now: float
    drift: float
    seen: float
    noise: float

    def to_dict(self) -> dict[str, Any]:
        """As in `analysis.json`."""
        return dict(vars(self))


def unlike_told(all_signals: Sequence[Standing]) -> list[Standing]:
    """Those that have shown anything."""
    return [s for s in all_signals if s.start or s.now or s.drift or s.noise > NOISIER]


def standing_lines(all_signals: Sequence[Standing]) -> list[str]:
    """What stands there and what is noisier than told, with what mends it, in sentences."""
    lines: list[str] = []
    began = [s for s in all_signals if s.start]
    if began:
        lines.append(
            f"offset since the start: {_amounts(began, 'start')}. Something touched the arm then, "
            "or its model or a bias is off. It counts as no touch. `touchline calibrate` takes it "
            "off"
        )
    stayed = [s for s in all_signals if s.now and not s.start]
    if stayed:
        lines.append(
            f"offset since a touch or a stop: {_amounts(stayed, 'now')} still stand there at the "
            "end and do not change, as friction does. `touchline calibrate` identifies it"
        )
    drifted = [s for s in all_signals if s.drift]
    if drifted:
        lines.append(
            f"slow drift: {_amounts(drifted, 'drift')}. Sensors drift so as they warm up. It "
            "counts as no touch, and contacts are judged without it. `Pipeline.tare` takes it off "
            "the estimate, too"
        )
    noisy = [s for s in all_signals if s.noise > NOISIER]
    if noisy:
        what = _largest([(s.noise, f"{s.signal} {s.noise:.2g} times") for s in noisy])
        lines.append(
            f"noise is larger than `noise` in the description tells: residual of {what}. "
            "Thresholds and places follow what is seen. `touchline calibrate` measures it"
        )
    return lines


def doubtful_offset(taken: Sequence[Standing]) -> str:
    """That a tare took off as much as a touch makes; empty where it took off less."""
    if not taken:
        return ""
    return (
        f"{_amounts(taken, 'now')} stood there since observation began, a reset or a touch. That "
        "is an offset, or something that rests on the arm all the time: these read the same"
    )


def _amounts(signals: Sequence[Standing], key: Literal["start", "now", "drift"]) -> str:
    """One of the offsets of each signal; those that are largest in thresholds come first."""
    named: list[tuple[float, str]] = []
    for s in signals:
        value: float = getattr(s, key)
        told = f"{s.signal} {value:+.2f} {s.unit} (threshold {s.threshold:.2g})"
        named.append((abs(value) / s.threshold, told))
    return _largest(named)


def _largest(named: list[tuple[float, str]]) -> str:
    words = [text for _, text in sorted(named, reverse=True)[:MOST]]
    more = [f"{len(named) - MOST} more"] if len(named) > MOST else []
    return ", ".join([*words, *more])
