# SPDX-License-Identifier: Apache-2.0
"""Observer, detection, localization, classification and the record of events in one object."""

from collections import deque
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.detector.detector import Detection
from touchline.detector.thresholds import Thresholds, expect_drift, make_thresholds
from touchline.localizer.localizer import (
    MODEL_ERROR,
    TORQUE_ERROR,
    WRENCH_ERROR,
    expected_pushes,
    require_rule,
)
from touchline.localizer.region import Region
from touchline.localizer.skin import Skin
from touchline.model.corrections import load_inertia, with_loads, with_offsets
from touchline.model.description import AXES, Load
from touchline.model.plausibility import COMPUTED, inertia_problem, load_problem
from touchline.model.robot import Robot, load_robot
from touchline.native import core
from touchline.observer.observer import Estimate, Observer, require_seconds
from touchline.pipeline.native_robot import native_robot, write_robot
from touchline.pipeline.result import Layout, Result
from touchline.pipeline.stand_ins import StandIns
from touchline.pipeline.table import ContactTable
from touchline.result.event import Event
from touchline.result.fault import FaultChange, changes_of, channel_names
from touchline.result.native import Names
from touchline.result.reset import ResetChange, estimate_names, resets_in
from touchline.result.standing import Standing, doubtful_offset
from touchline.suggest import unknown
from touchline.tuning import DEFAULTS, Tuning, native_tuning

REST = DEFAULTS["observer.rest_window"]  # s that an arm must have stood still before a tare


@dataclass(frozen=True)
class Tare:
    """What a tare took off.

    Attributes:
        time: of the last sample before [s].
        torque: (n,) felt at each joint [Nm]; NaN where none is measured.
        wrench: (k, 6) felt outboard of each sensor [N, Nm], in its frame, at its origin.
        beyond: what stood on signals of the detector and exceeds the threshold of a touch.
    """

    time: float
    torque: Array
    wrench: Array
    beyond: tuple[Standing, ...] = ()

    @property
    def doubt(self) -> str:
        """That it may have been a touch, in a sentence; empty where nothing speaks for one."""
        return doubtful_offset(self.beyond)


class Pipeline:
    """From samples to contacts, one sample at a time or part by part of a recording.

    The native pipeline for Python: `core/include/touchline/pipeline.hpp`. Two threads that use one
    pipeline wait for each other; `run` lets other Python threads go on.

    Args:
        robot: the robot, or what `load_robot` takes.
        bandwidth: of the observer [rad/s]; default: the description's.
        method: of the observer, "segment" or "paper".
        period: time between samples [s], for thresholds and weights that follow from the noise.
            Where the stamps of 64 samples differ from it by a fifth, `health` has `Health.PERIOD`.
        rule: of the localizer, "likelihood" or "paper" (the first entry of the line).
        wrench_error: of the gains of six-axis sensors, as a part of the load, for the localizer's
            weights; default: `WRENCH_ERROR` where the robot is calibrated, and while any wrench
            stands off before it is touched. Elsewhere none.
        torque_error: the same of joint torques.
        skin: the robot's surfaces, if already at hand.
        friction: coefficient of the cone in which pushes are looked for; default: that of the
            description's `pushes`.
        model_error: 1 sigma of the relative error of the model's masses and inertias, for the
            localizer's weights where the robot is not calibrated; 0: the model is right.
        thresholds: of the detector; default: those of the robot's description.
        tuning: the numbers that the estimation is tuned with, if some shall not be the default.

    Attributes:
        robot: the robot.
        thresholds: of the detector.
        skin: the robot's surfaces.
        tuning: all numbers that the estimation is tuned with.
        contacts: of the last `run`, a row for each contact and sample.
        watch: (N, m) of the last `run`: can a touch of each segment be felt (`tl.Watch`, by number:
            0 watched, 1 degraded, 2 blind)?
        faults: of channels, that began, changed or ended in the last `run`.
        resets: of estimates, in the last `run`, with the jump that each made.

    Raises:
        ValueError: an option is not among those allowed, or the surfaces are another robot's.
    """

    def __init__(
        self,
        robot: Robot | str | Path,
        bandwidth: float | None = None,
        method: str = "segment",
        period: float = 1e-3,
        rule: str = "likelihood",
        wrench_error: float | None = None,
        torque_error: float = TORQUE_ERROR,
        skin: Skin | None = None,
        friction: float | None = None,
        model_error: float = MODEL_ERROR,
        thresholds: Thresholds | None = None,
        tuning: Mapping[str, float] | None = None,
    ) -> None:
        if not (np.isfinite(period) and period > 0.0):
            raise ValueError(f"period is {period}, but must be a positive number [s]")
        robot = robot if isinstance(robot, Robot) else load_robot(robot)
        self.robot = robot
        self._observer = Observer(robot, bandwidth, method)  # names and checks, no samples
        if thresholds is None:
            thresholds = expect_drift(robot, make_thresholds(robot, period), model_error)
        self.thresholds = thresholds
        self.skin = skin or Skin(robot)
        self.skin.check_robot(robot)
        require_rule(rule)
        self.tuning = Tuning(tuning)
        native = native_tuning(self.tuning, rule)
        native.method = getattr(core.Method, method)
        pushes = expected_pushes(robot, friction)
        wrench_error_off = WRENCH_ERROR if wrench_error is None else wrench_error
        if wrench_error is None:
            calibrated = robot.description.detection.calibration is not None
            wrench_error = WRENCH_ERROR if calibrated else 0.0
        self._method = method
        errors = wrench_error, torque_error, wrench_error_off
        self._weights = period, bandwidth, *errors, pushes, self.tuning
        self._model_error = model_error
        self._made = self._native()
        self._native_tuning = native
        self._begin()

    def _begin(self) -> None:
        robot = self.robot
        self._core = core.Pipeline(self._made, self._native_tuning)
        names = Names.of(
            robot.segment_names,
            robot.joint_names,
            [patch.link for patch in self.skin.patches],
            [patch.body for patch in self.skin.patches],
        )
        slices = {name: slice(*ends) for name, ends in self._observer.kernel.slices.items()}
        self._channels = channel_names(robot.joint_names, robot.sensor_names)
        self._estimates = estimate_names(robot.joint_names, robot.segment_names)
        self._layout = Layout(self._core, slices, names, self._channels, self._estimates)
        self._making: Any = core.Resulting(self._core, Result, self._layout)
        self.contacts = ContactTable.empty(names)
        self.watch = np.empty((0, len(robot.segment_names)), np.int8)
        self.faults: tuple[FaultChange, ...] = ()
        self.resets: tuple[ResetChange, ...] = ()
        self._ended: deque[Event] = deque()
        self._seen = 0  # events that have ended and were asked for
        self._loads: dict[str, Load] = {}  # by link, of `set_load`

    def __repr__(self) -> str:
        period, bandwidth = self._weights[:2]
        named = "described bandwidth" if bandwidth is None else f"bandwidth {bandwidth:g} rad/s"
        return (
            f"<Pipeline of {self.robot.name}: method {self._method}, {named}, "
            f"{1.0 / period:g} Hz, {len(self.events)} events>"
        )

    @property
    def events(self) -> list[Event]:
        """All events so far, in the order of detection; one that lasts has `cleared` None.

        After `keep_events`: those that last, and the latest of those that are over.
        """
        ended, lasting, self._seen = self._core.events(self._seen)
        names = self._layout.names
        self._ended.extend(Event.of(row, names) for row in ended)
        events = [*self._ended, *(Event.of(row, names) for row in lasting)]
        return sorted(events, key=lambda event: event.id)

    def keep_events(self, most: int) -> None:
        """From now on at most so many events that are over are kept: a robot runs for months."""
        self._core.keep(most)
        self._ended = deque(self._ended, maxlen=most)

    def update(
        self,
        time: float,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> Result:
        """Takes one sample, as `Observer.update`; a bad one is reported in `health`.

        Raises:
            ValueError: for a wrong shape, or integer nanoseconds as `time`.
        """
        if not isinstance(time, float):
            require_seconds(time)
        result: Result = self._making.update(*self._observer.sample(time, q, qd, tau, wrench))
        return result

    def run(
        self,
        time: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> tuple[Estimate, Detection]:
        """Takes a recording or the next part of one; gives the numbers of `update`.

        Afterwards `contacts` holds a row for each contact and sample of this part, and `events`
        tells what was found so far.

        Raises:
            ValueError: for a wrong shape.
        """
        stamps, signals = self._observer.recording(time, q, qd, tau, wrench)
        numbers = self._core.run(stamps, *signals)
        rows, levels, normalized, drift, quiet, watch, contacts, faults, resets = numbers
        sample = contacts[:, 0].astype(np.int64)
        self.contacts = ContactTable(sample, contacts[:, 1:], self._layout.names)
        self.watch = watch.astype(np.int8)
        self.faults = changes_of(faults, self._channels)
        self.resets = resets_in(resets, self._estimates)
        detection = Detection(levels, normalized, drift, quiet)
        return Estimate(rows, self._layout.estimate), detection

    def export(self, path: Path | str) -> None:
        """Writes the robot as this pipeline knows it, for `touchline::read_robot` in C++.

        Method, rule and friction are no part of a robot: in C++ they stand in a `Tuning`.

        Raises:
            InputError: another kind of file is there.
            OSError: the file cannot be written.
        """
        write_robot(Path(path), self._made)

    def afresh(self) -> "Pipeline":
        """Another pipeline that begins with what this one knows of the robot, and has felt nothing.

        It takes a part of the time of a new one, and says what a new one would say.
        """
        other = copy(self)
        other._begin()
        other._loads = dict(self._loads)
        return other

    def reset(self) -> None:
        """Forgets the past, as after a long gap; events that last end, their numbers go on."""
        self._core.restart(self._made, same=True)

    def tare(self) -> Tare:
        """Takes what is felt now for the sensors' and joints' offsets: nothing may touch the arm.

        The mean of the last half second of rest goes into the biases of `robot`; the estimate
        starts anew. It holds for this posture: what gravity puts on a wrong model is no offset.
        What has touched the arm since observation began, or since a `reset`, is no event. Such a
        touch reads as an offset does: `Tare.doubt` says where one is as large as a touch.

        Raises:
            ValueError: something touches the arm, or it has not been at rest and untouched, with
                all signals there, for half a second.
        """
        touch = next((event for event in self.events if event.cleared is None), None)
        if touch is not None:
            raise ValueError(
                f"tare would take a touch for an offset: {_lasting(touch)}. Let go and tare half a "
                "second later. If nothing touches the arm, `reset` first: what stands then counts "
                "as an offset"
            )
        seconds, torque, wrench = self._core.rest()
        if seconds < REST:
            raise ValueError(
                f"tare needs {REST:g} s of rest without a touch and with all signals there; "
                f"it was {seconds:.2f} s"
            )
        beyond = tuple(x for x in self.standing if x.now)
        torque, wrench = np.array(torque), np.array(wrench).reshape(-1, 6)
        before, time = self.robot, self._core.time
        description = with_offsets(before.description, torque, wrench)
        self._go_on_with(Robot(description, before.mechanism, before.assumed))
        return Tare(time, torque, wrench, beyond)

    def set_load(
        self,
        link: str,
        mass: float,
        com: ArrayLike = (0.0, 0.0, 0.0),
        inertia: ArrayLike = (0.0,) * 6,
    ) -> str:
        """From now on the arm carries a body there, as when a gripper has closed on something.

        It replaces what an earlier call gave that link; a mass of 0 takes it off. The estimate
        starts anew. Events that last end: what the body does not explain of them counts as an
        offset from then on, not as a touch.

        Args:
            link: that carries it.
            mass: [kg].
            com: (3,) its centre in the link's frame [m].
            inertia: (6,) ixx ixy ixz iyy iyz izz about its centre [kg m2], in the link's axes.

        Returns:
            That something else may touch the arm, in a sentence; empty where no event lasted, or
            the body's weight explains its force.

        Raises:
            ValueError: there is no such link, or no body is so, or no arm carries it.
        """
        load = Load(link, float(mass), _numbers(com, 3, "com"), _numbers(inertia, 6, "inertia"))
        if link not in self.robot.mechanism.links:
            links = [name for name, body in self.robot.mechanism.links.items() if not body.virtual]
            raise ValueError(unknown(link, "link", links))
        if not 0.0 <= load.mass < np.inf:
            raise ValueError(f"mass is {mass}, but must be at least 0 kg")
        if not np.all(np.isfinite([*load.com, *load.inertia])):
            raise ValueError("com and inertia must be finite numbers [m, kg m2]")
        robot = self.robot
        problem = inertia_problem(load_inertia(load), COMPUTED)
        if problem:
            raise ValueError(f"inertia {list(load.inertia)} kg m2: {problem}")
        problem = load_problem(load, robot.mechanism, robot.description.loads)
        if problem:
            raise ValueError(problem)
        set_before = self._loads.get(link)
        kept = tuple(x for x in robot.description.loads if x is not set_before)
        loads = (*kept, load) if load.mass > 0.0 else kept
        more = load.mass - (0.0 if set_before is None else set_before.mass)
        doubt = self._unexplained(more)
        changed = with_loads(robot.mechanism, robot.description, loads)
        self._go_on_with(Robot(*changed, robot.assumed))
        self._loads[link] = load
        return doubt

    def _unexplained(self, mass: float) -> str:
        """What touches the arm beside the weight of so much more [kg], in a sentence."""
        for event in self.events:
            if event.cleared is not None:
                continue
            weight = mass * self.robot.gravity
            number = self.robot.segment_names.index(event.segment)
            rows = [r for r in self.thresholds.rows if r.segment == number]
            limit = max((r.contact for r in rows if 0 <= r.component < 3), default=0.0)
            if event.force is not None and np.linalg.norm(event.force - weight) <= limit:
                continue
            return (
                f"while it was set {_lasting(event)}, and the weight of {mass:.3g} kg more is "
                f"{np.linalg.norm(weight):.1f} N. What is left of it counts as an offset from now "
                "on, not as a touch: let go, and set it again"
            )
        return ""

    def _go_on_with(self, robot: Robot) -> None:
        before, self.robot = self.robot, robot
        try:
            made = self._native()
            self._core.restart(made)
            self._made = made
        except BaseException:
            self.robot = before
            raise

    def _native(self) -> core.Robot:
        """All that the core knows of the robot, and what carries on where its sensors are lost."""
        whole = self.robot, self.thresholds, self.skin
        made = native_robot(*whole, *self._weights)
        made.stand_ins = StandIns(*whole, self._model_error, self._weights).all()
        return made

    @property
    def lost(self) -> list[str]:
        """Sensors that are done without: they have been absent for longer than 5 / bandwidth."""
        return [self.robot.sensor_names[s] for s in self._core.lost]

    @property
    def standing(self) -> tuple[Standing, ...]:
        """What stands on each signal of the detector without a touch, and its noise so far.

        Where any of it exceeds a threshold, `health` has `Health.OFFSET`; where noise is over 1.5
        times what was told, `Health.NOISY`.
        """
        robot = self.robot
        return tuple(
            Standing(
                segment := robot.segment_names[row.segment],
                robot.joint_names[row.joint]
                if row.joint >= 0
                else f"{segment}.{AXES[row.component]}",
                "N" if 0 <= row.component < 3 else "Nm",
                row.contact,
                *numbers,
            )
            for row, numbers in zip(
                self.thresholds.rows, self._core.standing().tolist(), strict=True
            )
        )

    def beside(self, slots: int) -> core.Runner:
        """A native thread that takes samples for this pipeline; it gives what `result` reads.

        Args:
            slots: samples and results that may wait.
        """
        return core.Runner(self._core, slots)

    def writer(
        self, make: Callable[[core.Robot], core.TopicWriter] | None
    ) -> core.TopicWriter | None:
        """Publishes what is felt from the thread that feels, before Python sees it.

        Args:
            make: what publishes, of the core's robot; None: nobody publishes any more.
        """
        made = None if make is None else make(self._made)
        core.publish_with(self._core, made)
        return made

    def result(self, numbers: Array) -> Result:
        """What one sample brought, of the numbers that a native thread left."""
        return Result.of(numbers, self._layout)

    def region(self) -> Region:
        """The posterior over links and surfaces of the only contact of the last sample.

        Takes milliseconds: worked out when asked for.

        Raises:
            ValueError: there are several contacts, or none whose place follows from that sample
                alone; a `Contact` has `candidates` and `covariance` in any case.
        """
        return Region.of(self.skin, self._core.region())


core.Resulting.take_over(Pipeline)  # arrays of float64 need none of `Pipeline.update`


def _lasting(event: Event) -> str:
    """Where something touches the arm, and since when."""
    where = event.link or f"segment {event.segment}"
    if event.force is None:
        size = "" if event.torque_peak is None else f", up to {event.torque_peak:.1f} Nm"
    else:
        size = f", with {np.linalg.norm(event.force):.1f} N"
    return f"something has touched {where} since {event.detected:.2f} s{size}"


def _numbers(values: ArrayLike, count: int, name: str) -> tuple[float, ...]:
    array = np.asarray(values, dtype=float)
    if array.shape != (count,):
        raise ValueError(f"{name} needs {count} numbers, not an array of shape {array.shape}")
    return tuple(array.tolist())
