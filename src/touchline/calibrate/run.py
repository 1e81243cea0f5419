# SPDX-License-Identifier: Apache-2.0
"""`calibrate`: from recordings to parameters of the robot, noise figures and thresholds."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from touchline.calibrate.afterwards import (
    refuse_resting,
    refuse_touched,
    refuse_two_robots,
    refuse_unexplained,
)
from touchline.calibrate.beforehand import naming, refuse_one_pose, refuse_wrong_signals
from touchline.calibrate.blame import find_blame, often_off
from touchline.calibrate.causes import causes_told
from touchline.calibrate.held_out import HeldOut, judge, split
from touchline.calibrate.noise import measure_noise, noise_keys
from touchline.calibrate.one_moment import OneMoment, find_moments
from touchline.calibrate.quiet import LISTED, Suspicion, find_contacts
from touchline.calibrate.recordings import Recordings
from touchline.calibrate.short import METHOD, short_thresholds
from touchline.detector.calibration import (
    Statistics,
    collect_residuals,
    collect_statistics,
    describe,
    fit_rows,
    fit_tails,
    grown,
    with_methods,
)
from touchline.detector.tail import Tail
from touchline.detector.thresholds import make_thresholds, share_of_rate
from touchline.errors import InputError
from touchline.folder import check_file
from touchline.identify.choice import POSES
from touchline.identify.delay import Delay, find_delays, refined, with_delays
from touchline.identify.described import description_changes, identified_robot
from touchline.identify.evidence import filtered, gather
from touchline.identify.frame import FrameError, find_frames, frames_left, joined, with_frames
from touchline.identify.gain import Gain, find_gains, motor_joints, multiplied, with_gains
from touchline.identify.identification import Identification, identify
from touchline.identify.leaning import Lean, find_lean, with_lean
from touchline.identify.rest import Rest, grids_of, with_rest
from touchline.identify.rest import learn as learn_rest
from touchline.model.description import CalibrationDescription, Noise, RowCalibration
from touchline.model.learned_rest import write_rest
from touchline.model.robot import Robot, load_robot
from touchline.model.robot_file import write_description
from touchline.model.sources import given_keys
from touchline.model.values import METHODS

LEAST_SECONDS = 20.0  # shorter recordings have no tail
MOST_LEFT_OUT = 0.3  # of the time; where more seems touched nobody can tell what is usual
SHORT = (
    "written instead: what one residual of a hundred exceeds, and the tail of normal values beyond "
    "it; how often that is exceeded only a longer recording tells"
)
TURNS = 2  # times that gains and frames are looked for: the first time not all is found
ROUNDS = 4  # of leaving out what seems to be touched


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of detection, and what they are worth.

    Attributes:
        description: what stands under `detection.calibration`.
        tails: by segment and method.
        held_out: judgements on data that the thresholds had not seen.
        train, test: the parts of the data for that, as statistics of all methods.
        parted: how the data were parted.
        moments: single ones that set a threshold in use.
    """

    description: CalibrationDescription
    tails: dict[str, dict[str, Tail]]
    held_out: list[HeldOut]
    train: Statistics
    test: Statistics
    parted: str
    moments: list[OneMoment]


@dataclass(frozen=True)
class Calibration:
    """What came out.

    Attributes:
        robot: as it is now described, thresholds apart.
        out: the new description.
        logs: the recordings.
        seconds: of the recordings, without what was left out.
        period: of the samples [s].
        noise: the new noise figures.
        rate: false alarms per hour that are asked for.
        identification: parameters of the robot; None if they were not asked for.
        left_out: recording, begin and end [s] of what seemed to be touched.
        thresholds: None where the data are too short for them.
        lacking: why there are none, and what was taken instead.
        delays: that were found beside it.
        frames: of sensors that were found to be off.
        gains: of motor currents that were found to be off; None if that was not asked for.
        rest: what was learned of what is left; None if that was not asked for.
        losses: what is said of parts of the recordings that cannot be read.
        lean: of the base, that was found beside the described gravity.
    """

    robot: Robot
    out: Path
    logs: list[Path]
    seconds: float
    period: float
    noise: Noise
    rate: float
    identification: Identification | None
    left_out: list[tuple[int, float, float]]
    thresholds: Thresholds | None
    lacking: str = ""
    delays: tuple[Delay, ...] = ()
    frames: tuple[FrameError, ...] = ()
    gains: tuple[Gain, ...] | None = None
    rest: Rest | None = None
    losses: tuple[str, ...] = ()
    lean: Lean | None = None

    @property
    def share(self) -> float:
        """Of the rate, for each method in use on each segment [1/h]."""
        return share_of_rate(self.robot, make_thresholds(self.robot, self.period).rows)


def calibrate(
    logs: list[Path],
    robot: str | Path,
    out: Path,
    methods: tuple[str, ...] = (),
    false_alarms: float | None = None,
    trust: bool = False,
    identification: bool = True,
    learn: bool = False,
    gains: bool = False,
) -> Calibration:
    """Calibrates a robot and writes its new description.

    Args:
        logs: recordings of motion without contact; stretches with contact are left out.
        robot: path of its `robot.yaml`, or the name of a robot that ships with Touchline.
        out: the new description.
        methods: of detection, to be written; default: the description's.
        false_alarms: per hour of the whole robot, to be written; default: the description's.
        trust: what stands out is the robot's own doing, not a contact.
        identification: of biases, friction and inertias; False takes them as described.
        learn: tables of what is left of joint torques over the joints' own motion, too.
        gains: those of motor currents, too; loads count as described unless a sensor weighs them.

    Raises:
        InputError: something cannot be read or written, is too short, or shows contacts throughout.
    """
    model = load_robot(robot)
    _check(logs, out, false_alarms)
    if learn and not identification:
        raise InputError("--learn: it learns what identification leaves: leave --no-identify out")
    if gains and not identification:
        raise InputError("--gains: they are identified: leave --no-identify out")
    if gains and not motor_joints(model):
        raise InputError(f"--gains: {robot} has no joint with torque: motor")
    had_rest = any(joint.rest is not None for joint in model.description.joints)
    if learn:
        model = with_rest(model, {})
    source = model.description.path
    if source is None:
        raise InputError(f"{robot}: has no file to start from")
    rate = false_alarms or model.description.detection.false_alarms
    chosen = methods or model.description.detection.method
    given = given_keys(source).get("detection") or {}
    hold = model.description.detection.min_duration if "min_duration" in given else 0.0
    recordings = Recordings(model, logs)
    losses = recordings.losses
    if identification and not trust:
        refuse_wrong_signals(model, recordings, logs)
    changes: dict[str, Any] = {}
    found: Identification | None = None
    left_out: list[tuple[int, float, float]] = []
    delays: list[Delay] = []
    factors: list[Gain] = []
    frames: list[FrameError] = []
    lean: Lean | None = None
    rest: Rest | None = None
    if identification:
        with threadpool_limits(1, "blas"):  # of small matrices: threads would wait for each other
            described = model
            with naming(logs, recordings):
                evidence = gather(model, recordings.all("equations"))
                refuse_one_pose(evidence, logs)
            for _ in range(TURNS if gains else 0):
                wrong = find_gains(evidence)
                factors = multiplied(factors, wrong)
                if not any(gain.plausible for gain in wrong):
                    break
                model = with_gains(model, wrong)
                recordings = Recordings(model, logs)
                evidence = gather(model, recordings.all("equations"))
            delays = find_delays(evidence)
            if delays:
                prompt = with_delays(model, delays)
                evidence = gather(prompt, Recordings(prompt, logs).all("equations"))
                delays = refined(delays, evidence)
                model = with_delays(model, delays)
                recordings = Recordings(model, logs)
                evidence = gather(model, recordings.all("equations"))
            lean = find_lean(evidence)
            if lean is not None:
                model = with_lean(model, lean)
                recordings = Recordings(model, logs)
                evidence = gather(model, recordings.all("equations"))
            for look in (*(find_frames,) * TURNS, frames_left):
                off = look(evidence, frames)
                if not off:
                    break
                frames = joined(frames, off)
                model = with_frames(model, off)
                recordings = Recordings(model, logs)
                evidence = gather(model, recordings.all("equations"))
            with naming(logs, recordings):
                found = identify(evidence, trust)
            if not trust:
                refuse_two_robots(found, logs)
                with causes_told(described, logs):
                    refuse_unexplained(found, logs)
                refuse_touched(found, logs)
                refuse_resting(found, logs)
            left_out = found.touches()
            if learn:
                grids = grids_of(evidence)
                hats = filtered(evidence.robot, recordings.all("what is left"), grids.hats)
                rest = learn_rest(found, grids, hats)
            recordings.leave_out(left_out)
            model = identified_robot(found)
            changes = description_changes(described, model)
            if rest is not None and (rest.tables or had_rest):
                model = with_rest(model, rest.tables)
                changes["learned_rest"] = f"{out.stem}_rest.csv"
    model = with_methods(model, *chosen, min_duration=hold, calibration=None, false_alarms=rate)
    noise = measure_noise(model, recordings.all("noise"))
    changes["noise"] = {key: _plain(value) for key, value in noise_keys(model, noise).items()}
    quiet = Robot(replace(model.description, noise=noise), model.mechanism)
    thresholds, lacking = None, ""
    try:
        more_elsewhere = {} if found is None else growth(found, rest)
        thresholds, more = _find_thresholds(
            quiet, recordings, logs, chosen, rate, trust, more_elsewhere
        )
        left_out += more
    except StandsStill as error:
        lacking = str(error)
    except NoThresholds as error:
        if found is None or not found.problem.columns + found.problem.bodies:
            with naming(logs, recordings):
                raise
        lacking = str(error)
        if chosen == (METHOD,):
            short = short_thresholds(
                quiet,
                recordings.period,
                recordings.seconds,
                recordings.all("residuals"),
                growth(found, rest),
            )
            if short is not None:
                lacking += f"\n{SHORT}"
                changes["detection"] = {"method": list(chosen), "false_alarms": rate}
                changes["detection"] |= {"min_duration": hold, "calibration": _plain(short)}
    if thresholds is not None:
        detection: dict[str, Any] = {"method": list(chosen), "false_alarms": rate}
        detection |= {"min_duration": hold, "calibration": _plain(thresholds.description)}
        changes["detection"] = detection
    if "learned_rest" in changes and rest is not None:
        write_rest(out.parent / changes["learned_rest"], rest.tables)
    write_description(source, out, changes)
    return Calibration(
        quiet,
        out,
        logs,
        recordings.seconds,
        recordings.period,
        noise,
        rate,
        found,
        sorted(left_out),
        thresholds,
        lacking,
        tuple(delays),
        tuple(frames),
        tuple(factors) if gains else None,
        rest,
        tuple(losses),
        lean,
    )


def growth(found: Identification, rest: Rest | None = None) -> dict[str, float]:
    """By row, how much larger residuals are on data that played no part in the fit, at least 1."""
    ratios = found.growth.copy()
    names = found.evidence.rows.names
    for j, name in enumerate(names[: found.evidence.joints]):
        if rest is not None and name in rest.tables:
            elsewhere = max(rest.after[j], rest.region_after[j])
            ratios[j] = max(elsewhere / max(rest.inside[j], 1e-9), 1.0)
    return {names[r]: float(ratios[r]) for r in np.flatnonzero(found.evidence.used)}


class NoThresholds(InputError):
    """The recordings are no good for thresholds."""


class StandsStill(NoThresholds):
    """What an arm that stands in one pose shows is its noise, and for too short a time for more."""


def _find_thresholds(
    robot: Robot,
    recordings: Recordings,
    logs: list[Path],
    chosen: tuple[str, ...],
    rate: float,
    trust: bool,
    more_elsewhere: dict[str, float],
) -> tuple[Thresholds, list[tuple[int, float, float]]]:
    """Thresholds, and what was left out for them because it seems to be touched."""
    left_out: list[tuple[int, float, float]] = []
    suspicions: list[Suspicion] = []
    rows: dict[str, RowCalibration] = {}
    for _ in range(ROUNDS):
        if recordings.seconds < LEAST_SECONDS:
            raise NoThresholds(
                f"{recordings.seconds:.3g} s without contact: at least {LEAST_SECONDS:g} s are "
                "needed for thresholds, half an hour is better"
            )
        found, rows = _watch(robot, recordings, trust)
        suspicions = [] if trust else find_contacts(found, METHODS)
        if not suspicions:
            share = share_of_rate(robot, make_thresholds(robot, recordings.period).rows)
            if robot.joint_names and recordings.travel < POSES and share * found.hours < 1.0:
                raise StandsStill(
                    f"no joint moves by more than {recordings.travel:.2g} rad, and "
                    f"{3600 * found.hours:.3g} s without contact show no alarm that comes "
                    f"{rate:g} times an hour.\n"
                    "They follow from the noise figures, in each posture, if none were calibrated."
                )
            train, test, parted = split(found, len(logs))
            held_out = judge(robot, train, test, rate)
            tails = fit_tails(robot, found)
            _check_tails(robot, tails, chosen, found.hours)
            rows = grown(rows, more_elsewhere)
            description = describe(found.hours, recordings.period, rows, tails)
            moments = find_moments(found, robot.segment_names, tails, chosen, share)
            return Thresholds(description, tails, held_out, train, test, parted, moments), left_out
        new = [(s.recording, s.start, s.end) for s in suspicions]
        if _long(left_out + new) > MOST_LEFT_OUT * recordings.seconds:
            break
        left_out += new
        recordings.leave_out(new)
    raise NoThresholds(_told(robot, recordings, rows, logs, suspicions))


def _long(stretches: list[tuple[int, float, float]]) -> float:
    return sum(end - start for _, start, end in stretches)


def _check(logs: list[Path], out: Path, false_alarms: float | None) -> None:
    if not logs:
        raise InputError("LOG: name at least one recording")
    if false_alarms is not None and not 0 < false_alarms < 1e4:
        raise InputError(f"--false-alarms {false_alarms:g}: allowed: above 0, below 10000 per hour")
    if out.suffix not in (".yaml", ".yml"):
        raise InputError(f"--out {out}: a robot description ends in .yaml")
    if out.is_dir():
        raise InputError(f"--out {out}: is a folder")
    check_file(out, "--out")
    seen: set[Path] = set()
    for log in logs:
        if log.resolve() in seen:
            raise InputError(f"{log}: named twice")
        seen.add(log.resolve())


def _check_tails(
    robot: Robot, tails: dict[str, dict[str, Tail]], chosen: tuple[str, ...], hours: float
) -> None:
    """A test without a tail would never fire."""
    missing = [
        f"{method} (segment {name})"
        for name in robot.segment_names
        for method in chosen
        if method not in tails.get(name, {}) and name in robot.joint_segments + robot.sensor_names
    ]
    if missing:
        able = [m for m in METHODS if all(m in of for of in tails.values())] if tails else []
        raise NoThresholds(
            f"{3600 * hours:.3g} s without contact show too few excursions of {', '.join(missing)} "
            "for a threshold: record several minutes in motion"
            + (f"; there are enough for --method {' '.join(able)}" if able else "")
        )


def _watch(
    robot: Robot, recordings: Recordings, trust: bool
) -> tuple[Statistics, dict[str, RowCalibration]]:
    """Both passes over the recordings."""
    period = recordings.period
    residuals = collect_residuals(robot, period, recordings.all("residuals"))
    rows = fit_rows(robot, period, residuals)
    if not rows:
        raise NoThresholds("no residual settles: is a signal missing? (touchline check)")
    often = [] if trust else often_off(robot, period, residuals)
    if often:
        raise NoThresholds(
            [
                *often[:LISTED],
                "as if something touched the robot again and again: record motion without contact, "
                "or describe its friction and payload; --trust takes it for the robot's own doing",
            ]
        )
    return collect_statistics(robot, period, rows, recordings.all("statistics")), rows


def _told(
    robot: Robot,
    recordings: Recordings,
    rows: dict[str, RowCalibration],
    logs: list[Path],
    found: list[Suspicion],
) -> list[str]:
    """Why recordings are refused, and what can be done."""
    lines = []
    for s in found[:LISTED]:
        blame = find_blame(robot, recordings.period, rows, recordings.of(s.recording), s)
        lines.append(
            f"{logs[s.recording]}: from {s.start:.2f} to {s.end:.2f} s something seems to touch "
            f"segment {robot.segment_names[s.segment]} ({s.factor:.1f} times what is plausible)"
            + (f": {blame}" if blame else "")
        )
    if len(found) > LISTED:
        lines.append(f"... and {len(found) - LISTED} more")
    lines.append(
        "calibration needs motion without contact: cut these parts out, or record anew; if nothing "
        "touched the robot (friction, a cable), --trust takes them for its own doing"
    )
    return lines


def _plain(value):
    """Dataclasses and tuples as YAML has them."""
    if hasattr(value, "__dataclass_fields__"):
        value = asdict(value)
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value
