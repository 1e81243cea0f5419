# SPDX-License-Identifier: Apache-2.0
"""`touchline bench observer`: what a sample costs, beside the peers that are installed.

One run on one machine: all candidates are timed in turns on the same motion of the same robot, and
those that estimate the same quantity are compared number by number.
"""

import importlib.util
import json
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from touchline.bench.observer.discretization import DiscretizationError, discretization_errors
from touchline.bench.observer.tables import error_table, timing_table
from touchline.bench.observer.timing import Candidate, Timing, measure
from touchline.errors import InputError
from touchline.folder import check_file, replaced_file
from touchline.model.description import JointDescription, SensorDescription
from touchline.model.robot import Robot
from touchline.numbers import check_least
from touchline.observer.observer import Observer
from touchline.trials.fast_motion import Motion, fast_motion, pushed_link, two_sensor_arm

BANDWIDTH = 100.0  # [rad/s]
RUN_SAMPLES, SAMPLES = 8000, 250  # per round: of `run`, and of what takes one at a time
RUN, UPDATE, STEP = "Observer.run", "Observer.update", "native step, no result"
READ = "  the same, segment_wrench, tau_ext and health read"


@dataclass(frozen=True)
class Agreement:
    """Largest difference between two estimates of the same quantity."""

    name: str
    difference: float
    unit: str


@dataclass
class ObserverBenchmark:
    """Everything that one run found; `str()` is the table that is printed."""

    robot: str
    machine: str
    rounds: int
    timings: list[Timing] = field(default_factory=list)
    agreements: list[Agreement] = field(default_factory=list)
    errors: list[DiscretizationError] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def ratio(self, name: str, to: str = UPDATE) -> float:
        """Median time of one candidate over that of another."""
        medians = {timing.name: timing.median for timing in self.timings}
        return medians[name] / medians[to]

    def __str__(self) -> str:
        parts = [f"observer benchmark: {self.robot}; {self.machine}; {self.rounds} rounds in turns"]
        parts += [timing_table(self.timings, RUN, UPDATE)]
        parts += ["\n".join(f"{a.name}: {a.difference:.1e} {a.unit}" for a in self.agreements)]
        parts += [error_table(self.errors)] if self.errors else []
        parts += ["\n".join(self.notes)] if self.notes else []
        return "\n\n".join(part for part in parts if part)

    def write(self, path: Path) -> None:
        """Writes all results as JSON, or the timings as CSV, by the name's ending.

        Raises:
            InputError: for another ending.
        """
        if path.suffix == ".json":
            text = json.dumps(asdict(self), indent=2) + "\n"
        elif path.suffix == ".csv":
            rows = [f'"{t.name}",{t.median:.4f},{t.minimum:.4f}' for t in self.timings]
            text = "\n".join(["name,median_us,min_us", *rows]) + "\n"
        else:
            raise InputError(f"output is '{path}', allowed endings: .json, .csv")
        path.parent.mkdir(parents=True, exist_ok=True)
        with replaced_file(path) as draft:
            draft.write_text(text, encoding="utf-8")


def run_benchmark(
    robot: Robot | None = None, rounds: int = 40, accuracy: bool = True
) -> ObserverBenchmark:
    """Times the observer and its peers, and compares what they estimate.

    Args:
        robot: the robot; default: seven joints and two six-axis sensors, made in code. Its joints
            and sensors are taken as measured plainly, whatever its description says.
        rounds: how often each candidate is timed, at least 1.
        accuracy: also find what the discretizations cost.
    """
    robot = plain(robot or two_sensor_arm())
    result = ObserverBenchmark(_title(robot), _machine(), rounds)
    motion = fast_motion(robot, 1000.0, RUN_SAMPLES / 1000.0)
    candidates = own_candidates(robot, motion)
    for module, package, add in (
        ("pinocchio", "pin", _add_pinocchio),
        ("idyntree", "idyntree", _add_idyntree),
    ):
        if importlib.util.find_spec(module) is None:
            result.notes.append(f"{module} is not installed: pip install {package}")
        elif _has_mimics(robot):
            result.notes.append(f"{module} is left out: the robot has joints that mimic others")
        else:
            candidates += add(robot, motion, result)
    result.timings = measure(candidates, rounds)
    if accuracy:
        result.errors = discretization_errors(robot)
    return result


def own_candidates(robot: Robot, motion: Motion) -> list[Candidate]:
    """A recording at once, sample by sample, with its result read, and the native step alone."""
    whole, single, used, bare = (Observer(robot, bandwidth=BANDWIDTH) for _ in range(4))
    samples = _samples(motion)

    def run() -> object:
        whole.reset()
        return whole.run(*motion.signals())

    def each(reset: Callable[[], object], call: Callable[..., object]) -> Callable[[], object]:
        def work() -> None:
            reset()
            for sample in samples:
                call(*sample)

        return work

    def read() -> None:
        used.reset()
        for sample in samples:
            estimate = used.update(*sample)
            _ = estimate.segment_wrench, estimate.tau_ext, estimate.health

    return [
        Candidate(RUN, run, len(motion.time)),
        Candidate(UPDATE, each(single.reset, single.update), len(samples)),
        Candidate(READ, read, len(samples)),
        Candidate(STEP, each(bare.reset, bare.kernel.step), len(samples)),
    ]


def plain(robot: Robot) -> Robot:
    """The same mechanism with every joint and all six axes of every sensor measured plainly."""
    description = robot.description
    return Robot(
        replace(
            description,
            joints=tuple(JointDescription(joint.name) for joint in description.joints),
            sensors=tuple(
                SensorDescription(s.name, s.link, s.xyz, s.rpy) for s in description.sensors
            ),
        ),
        robot.mechanism,
    )


def _add_pinocchio(robot: Robot, motion: Motion, result: ObserverBenchmark) -> list[Candidate]:
    """The extended and the classical observer with Pinocchio, compared and to be timed."""
    from touchline.bench.pinocchio_peer import PinocchioObserver

    extended = PinocchioObserver(robot, BANDWIDTH)
    classical = PinocchioObserver(robot, BANDWIDTH, sensors=False)
    part = [signal[:1000] for signal in motion.signals()]
    ours = Observer(robot, bandwidth=BANDWIDTH, method="paper").run(*part)
    theirs = extended.run(*part)
    with_sensors = ours.segment_wrench[:, : theirs[2].shape[1]]  # without the root segment
    pairs = zip(theirs, (ours.tau_ext, ours.sensor_wrench, with_sensors), strict=True)
    for name, (a, b) in zip(("joint", "sensor", "segment"), pairs, strict=True):
        name = f"{name} residuals, ours and Pinocchio's, largest difference"
        result.agreements.append(
            Agreement(name, float(np.abs(a - b).max()), "Nm" if a.ndim == 2 else "N, Nm")
        )
    samples = _samples(motion)

    def work(peer: PinocchioObserver) -> Callable[[], None]:
        def update() -> None:
            peer.reset()
            for sample in samples:
                peer.update(*sample)

        return update

    def calls() -> None:
        for _, q, qd, _, _ in samples:
            extended.matrices(q, qd)

    return [
        Candidate("extended observer, Pinocchio in Python", work(extended), len(samples)),
        Candidate("  its three Pinocchio calls alone", calls, len(samples)),
        Candidate("classical joint observer, Pinocchio in Python", work(classical), len(samples)),
    ]


def _add_idyntree(robot: Robot, motion: Motion, result: ObserverBenchmark) -> list[Candidate]:
    """The estimator of iDynTree, given the exact accelerations and the links in contact."""
    from touchline.bench.idyntree_peer import IdyntreeEstimator

    peer = IdyntreeEstimator(robot)
    inputs = list(zip(motion.q, motion.qd, motion.qdd, motion.wrench, strict=True))
    samples = inputs[:SAMPLES]
    found = np.array([peer.update(*sample) for sample in inputs[:1000]])
    truth = motion.sensor_ext[:1000].copy()
    segment = robot.body_of(pushed_link(robot)).segment
    truth[:, [name != segment for name in robot.sensor_names]] = 0.0
    name = "iDynTree's wrenches with exact accelerations, largest difference from the push"
    result.agreements.append(Agreement(name, float(np.abs(found - truth).max()), "N, Nm"))
    converted = [peer.convert(*sample) for sample in samples]

    def update() -> None:
        for sample in samples:
            peer.update(*sample)

    def estimate() -> None:
        for sample in converted:
            peer.estimate(*sample)

    return [
        Candidate("wrench estimator, iDynTree, numpy in and out", update, len(samples)),
        Candidate("  its two calls alone", estimate, len(samples)),
    ]


def _samples(motion: Motion) -> list[tuple]:
    """The first samples, each as the arguments of `update`."""
    time, *rest = (signal[:SAMPLES] for signal in motion.signals())
    return list(zip(time.tolist(), *rest, strict=True))


def _has_mimics(robot: Robot) -> bool:
    moving = [node for node in robot.nodes if node.coordinate >= 0]
    return len(moving) > len(robot.joint_names) or any(
        (node.multiplier, node.offset) != (1.0, 0.0) for node in moving
    )


def _title(robot: Robot) -> str:
    n, k = len(robot.joint_names), len(robot.sensor_names)
    return f"{robot.name}, {n} joints, {k} six-axis sensors"


def _machine() -> str:
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    return f"{model}, Python {platform.python_version()}, numpy {np.__version__}"


def main(output: Path | None = None, rounds: int = 40, robot: Robot | None = None) -> int:
    """Prints the benchmark and optionally writes it to a .json or .csv file.

    Args:
        output: where to write the results as well.
        rounds: how often each candidate is timed.
        robot: what to observe; default: a seven-joint arm made in code.

    Raises:
        InputError: for an output that is neither .json nor .csv, or rounds below 1.
    """
    if output is not None and output.suffix not in (".json", ".csv"):
        raise InputError(f"output is '{output}', allowed endings: .json, .csv")
    check_least(1, rounds=rounds)
    if output is not None:
        check_file(output, "--output")
    result = run_benchmark(robot, rounds)
    print(result)
    if output is not None:
        result.write(output)
    return 0
