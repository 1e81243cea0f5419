# SPDX-License-Identifier: Apache-2.0
"""`calibrate`: from recordings without contact to noise figures and thresholds."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.calibrate.noise import measure_noise, noise_keys
from touchline.calibrate.quiet import LISTED, Suspicion, find_contacts
from touchline.calibrate.robot_file import write_description
from touchline.contact.calibration import (
    Statistics,
    collect_residuals,
    collect_statistics,
    count_alarms,
    describe,
    fit_rows,
    fit_tails,
    with_methods,
)
from touchline.contact.tail import Tail, poisson_interval
from touchline.contact.thresholds import PERIOD_RATIO
from touchline.errors import InputError
from touchline.estimation.samples import Samples
from touchline.logs import open_log
from touchline.model.description import CalibrationDescription, Noise, RowCalibration
from touchline.model.robot import Robot, load_robot
from touchline.model.values import METHODS
from touchline.model.yaml_file import read_yaml
from touchline.report.analysis import typical_period

Array = NDArray[np.float64]

CHUNK = 1 << 15  # samples
LEAST_SECONDS = 30.0
HELD_OUT = 3  # every third recording, or the last third of a single one
RATES = (100.0, 10.0)  # per hour, at which held-out data are judged beside the wanted rate


@dataclass(frozen=True)
class HeldOut:
    """What a method's thresholds, from the other data, did on the data held out.

    Attributes:
        method: of detection.
        rate: false alarms per hour that the thresholds are for.
        count: alarms that came.
        hours: in which they came.
    """

    method: str
    rate: float
    count: int
    hours: float

    @property
    def measured(self) -> float:
        """Alarms per hour."""
        return self.count / self.hours

    @property
    def interval(self) -> tuple[float, float]:
        """95 % Poisson interval of the rate [1/h]."""
        low, high = poisson_interval(self.count)
        return low / self.hours, high / self.hours


@dataclass(frozen=True)
class Calibration:
    """What came out.

    Attributes:
        robot: as it was described.
        out: the new description.
        logs: the recordings.
        noise: the new noise figures.
        description: what stands under `detection.calibration`.
        tails: by segment and method.
        held_out: judgements on data that the thresholds had not seen.
        split: how the data were parted.
        rate: false alarms per hour that are asked for.
    """

    robot: Robot
    out: Path
    logs: list[Path]
    noise: Noise
    description: CalibrationDescription
    tails: dict[str, dict[str, Tail]]
    held_out: list[HeldOut]
    split: str
    rate: float


def calibrate(
    logs: list[Path],
    robot: str | Path,
    out: Path,
    methods: tuple[str, ...] = (),
    false_alarms: float | None = None,
) -> Calibration:
    """Calibrates a robot and writes its new description.

    Args:
        logs: recordings of motion without contact.
        robot: path of its `robot.yaml`, or the name of a robot that ships with Touchline.
        out: the new description.
        methods: of detection, to be written; default: the description's.
        false_alarms: per hour of the whole robot, to be written; default: the description's.

    Raises:
        InputError: something cannot be read or written, is too short, or shows contacts.
    """
    model = load_robot(robot)
    _check(logs, out, false_alarms)
    source = model.description.path
    if source is None:
        raise InputError(f"{robot}: has no file to start from")
    rate = false_alarms or model.description.detection.false_alarms
    chosen = methods or model.description.detection.method
    given = read_yaml(source).get("detection") or {}
    hold = model.description.detection.min_duration if "min_duration" in given else 0.0
    model = with_methods(model, *chosen, min_duration=hold, calibration=None, false_alarms=rate)
    recordings = _Recordings(model, logs)
    noise = measure_noise(model, recordings.all("noise"))
    quiet = Robot(replace(model.description, noise=noise), model.mechanism)
    found, rows = _watch(quiet, recordings)
    _refuse_contacts(model, logs, find_contacts(found, METHODS))
    train, test, split = _parts(found, len(logs))
    held_out = _judge(quiet, fit_tails(quiet, train), test, rate)
    tails = fit_tails(quiet, found)
    if not tails:
        raise InputError(f"{', '.join(map(str, logs))}: too short: too few peaks for a tail")
    description = describe(found.hours, recordings.period, rows, tails)
    detection: dict[str, Any] = {"method": list(chosen), "false_alarms": rate, "min_duration": hold}
    detection["calibration"] = _plain(description)
    figures = {key: _plain(value) for key, value in noise_keys(model, noise).items()}
    write_description(source, out, {"noise": figures, "detection": detection})
    return Calibration(model, out, logs, noise, description, tails, held_out, split, rate)


def _check(logs: list[Path], out: Path, false_alarms: float | None) -> None:
    if not logs:
        raise InputError("LOG: name at least one recording")
    if false_alarms is not None and not 0 < false_alarms < 1e4:
        raise InputError(f"--false-alarms {false_alarms:g}: allowed: above 0, below 10000 per hour")
    if out.suffix not in (".yaml", ".yml"):
        raise InputError(f"--out {out}: a robot description ends in .yaml")
    if out.is_dir():
        raise InputError(f"--out {out}: is a folder")
    seen: set[Path] = set()
    for log in logs:
        if log.resolve() in seen:
            raise InputError(f"{log}: named twice")
        seen.add(log.resolve())


class _Recordings:
    """The logs, to be read as often as needed."""

    def __init__(self, robot: Robot, logs: list[Path]) -> None:
        self._robot, self._logs = robot, logs
        self.period = float("nan")
        seconds = 0.0
        for log in logs:
            period, length = self._look_at(log)
            if not np.isfinite(self.period):
                self.period = period
            if not 1 / PERIOD_RATIO < period / self.period < PERIOD_RATIO:
                raise InputError(
                    f"{log}: has {1 / period:g} samples a second, {logs[0]} has "
                    f"{1 / self.period:g}: thresholds hold for one rate"
                )
            seconds += length
        if seconds < LEAST_SECONDS:
            raise InputError(
                f"{', '.join(map(str, logs))}: {seconds:.3g} s of samples; at least "
                f"{LEAST_SECONDS:g} s are needed, an hour is better"
            )

    def _look_at(self, log: Path) -> tuple[float, float]:
        period, samples = float("nan"), 0
        with open_log(log, self._robot.description) as recording:
            for part in recording.chunks(CHUNK):
                if not np.isfinite(period):
                    period = typical_period(part.time)
                samples += len(part.time)
        if not samples:
            raise InputError(f"{log}: holds no samples")
        return period, samples * period

    def all(self, what: str) -> Iterator[Iterator[Samples]]:
        """Every recording, in parts."""
        from tqdm import tqdm

        for log in tqdm(self._logs, desc=what, disable=None, leave=False):
            yield self._parts(log)

    def _parts(self, log: Path) -> Iterator[Samples]:
        with open_log(log, self._robot.description) as recording:
            yield from recording.chunks(CHUNK)


def _watch(robot: Robot, recordings: _Recordings) -> tuple[Statistics, dict[str, RowCalibration]]:
    """Both passes over the recordings."""
    period = recordings.period
    residuals = collect_residuals(robot, period, recordings.all("residuals"))
    rows = fit_rows(robot, period, residuals)
    if not rows:
        raise InputError("no residual settles: is a signal missing? (touchline check)")
    return collect_statistics(robot, period, rows, recordings.all("statistics")), rows


def _refuse_contacts(robot: Robot, logs: list[Path], found: list[Suspicion]) -> None:
    if not found:
        return
    lines = [
        f"{logs[s.recording]}: from {s.start:.2f} to {s.end:.2f} s something seems to touch "
        f"segment {robot.segment_names[s.segment]} ({s.factor:.1f} times what is plausible)"
        for s in found[:LISTED]
    ]
    if len(found) > LISTED:
        lines.append(f"... and {len(found) - LISTED} more")
    lines.append("calibration needs motion without contact: cut these parts out, or record anew")
    raise InputError(lines)


def _parts(found: Statistics, logs: int) -> tuple[Statistics, Statistics, str]:
    """What thresholds are made from, and what they are judged on."""
    if logs >= HELD_OUT:
        out = found.recording % HELD_OUT == HELD_OUT - 1
        split = f"every {HELD_OUT}rd recording held out"
    else:
        length = np.zeros(logs)
        for i in range(logs):
            length[i] = np.count_nonzero(found.recording == i)
        place = np.concatenate([np.arange(n) / n for n in length])
        out = place >= 1.0 - 1.0 / HELD_OUT
        split = "the last third of each recording held out"
    return found.part(~out), found.part(out), split


def _judge(
    robot: Robot, tails: dict[str, dict[str, Tail]], test: Statistics, wanted: float
) -> list[HeldOut]:
    names = [name for name in robot.segment_names if name in tails]
    judged = []
    for t, method in enumerate(METHODS):
        for rate in dict.fromkeys((*RATES, wanted)):
            of = [tails.get(name, {}).get(method) for name in robot.segment_names]
            limits = np.array([x.threshold(rate / len(names)) if x else np.inf for x in of])
            judged.append(HeldOut(method, rate, count_alarms(test, limits, t), test.hours))
    return judged


def _plain(value):
    """Dataclasses and tuples as YAML has them."""
    if hasattr(value, "__dataclass_fields__"):
        value = asdict(value)
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value
