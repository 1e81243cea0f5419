# SPDX-License-Identifier: Apache-2.0
"""Reference outputs: what Touchline makes of recordings, as accepted.

Each recording has a JSON file beside this one. `make accept` writes them anew: what has changed
then stands in the commit. Simulated recordings follow from fixed seeds; those of real arms are read
from the folder TOUCHLINE_DATA.
"""

import json
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import touchline as tl
from touchline.observer.samples import Samples
from touchline.simulation import scenario
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scene import Run
from touchline.trials.real_recordings import read_free, read_touched
from touchline.trials.recordings import robot_named

FOLDER = Path(__file__).parent
DATA = Path(os.environ.get("TOUCHLINE_DATA", FOLDER.parents[2] / "shared" / "data"))
DIGITS = 9  # that are kept
ROUNDING = 1e-6  # of a number, by which it may differ: far above what processors differ by
SMALLEST = 1e-6  # N, Nm, m, s, below which a difference is none
PERCENTILES = (0, 5, 50, 95, 100)
REAL_SECONDS = 6.0  # of a real recording, from its beginning: twelve of them take some 20 s


@dataclass(frozen=True)
class Recording:
    """A recording and the robot that it is of."""

    robot: tl.Robot
    samples: Samples


class Absent(Exception):
    """A recording, or the model of its robot, is not on this machine."""


@cache
def robot(name: str) -> tl.Robot:
    """By the name of a robot that ships with Touchline, or "ur5", with sensors, or "panda"."""
    try:
        return robot_named(name)
    except tl.InputError as error:
        raise Absent(str(error)) from None


@cache
def simulated(name: str, arm: str, model_error: float = 0.0, **options: Any) -> Recording:
    """A scenario of `touchline simulate` with ordinary sensors, seed 0."""
    settings = Run(seed=0, noise=SensorNoise(), model_error=model_error)
    make = getattr(scenario, name)
    return Recording(robot(arm), make(robot(arm), settings=settings, **options).samples)


def without(recording: Recording, signal: str, column: int, rows: slice) -> Recording:
    """A channel or sensor is not there for a while."""
    values = getattr(recording.samples, signal).copy()
    values[rows, column] = np.nan
    return replace(recording, samples=replace(recording.samples, **{signal: values}))


def stuck(recording: Recording, joint: int, first: int) -> Recording:
    """A joint torque keeps its value."""
    tau = recording.samples.tau.copy()
    tau[first:, joint] = tau[first, joint]
    return replace(recording, samples=replace(recording.samples, tau=tau))


def interrupted(recording: Recording, first: int, seconds: float) -> Recording:
    """Samples are lost for so long."""
    s = recording.samples
    left = np.flatnonzero((s.time < s.time[first]) | (s.time >= s.time[first] + seconds))
    fields = ("time", "q", "qd", "tau", "wrench")
    samples = Samples(*(getattr(s, name)[left] for name in fields))
    return replace(recording, samples=samples)


def moving_touches(arm: str) -> Recording:
    return simulated("three_touches", arm, speed=0.5)


@cache
def free_recordings() -> dict[str, Recording]:
    """Real arms that nothing touches, by name."""
    with TemporaryDirectory() as scratch:
        return {r.name: Recording(r.robot, r.samples) for r in read_free(DATA, Path(scratch))}


def real_free(name: str) -> Recording:
    if name not in free_recordings():
        raise Absent(f"no recording '{name}' at {DATA}: set TOUCHLINE_DATA")
    return beginning(free_recordings()[name], 0.0)


def real_touched(name: str, start: float) -> Recording:
    path = DATA / f"{name}.csv.gz"
    if not path.exists():
        raise Absent(f"no recording {path}: set TOUCHLINE_DATA")
    with TemporaryDirectory() as scratch:
        read = read_touched(path, Path(scratch))
    return beginning(Recording(read.robot, read.samples), start)


def beginning(recording: Recording, start: float) -> Recording:
    s = recording.samples
    begin = s.time[0] + start
    rows = (s.time >= begin) & (s.time < begin + REAL_SECONDS)
    fields = ("time", "q", "qd", "tau", "wrench")
    return replace(recording, samples=Samples(*(getattr(s, name)[rows] for name in fields)))


SIMULATED: dict[str, Callable[[], Recording]] = {
    "sara_free": lambda: simulated("free_motion", "sara", seconds=2.0),
    "sara_touches": lambda: simulated("three_touches", "sara"),
    "sara_moving": lambda: moving_touches("sara"),
    "sara_base": lambda: simulated("base_touch", "sara"),
    "sara_singular": lambda: simulated("singular_push", "sara"),
    "sara_pushers": lambda: simulated("colliding_pushers", "sara"),
    "sara_model_error": lambda: simulated("three_touches", "sara", 0.02, speed=0.5),
    "sara_stuck": lambda: stuck(moving_touches("sara"), 3, 500),
    "sara_gaps": lambda: interrupted(interrupted(moving_touches("sara"), 300, 0.01), 600, 0.2),
    "sara_full_moving": lambda: moving_touches("sara-full"),
    "sara_full_lost": lambda: without(moving_touches("sara-full"), "wrench", -1, slice(400, 700)),
    "sara_full_no_torque": lambda: without(moving_touches("sara-full"), "tau", 1, slice(100, 800)),
    "ur5_moving": lambda: moving_touches("ur5"),
    "panda_moving": lambda: moving_touches("panda"),
}
REAL: dict[str, Callable[[], Recording]] = {
    "real_panda_a4": lambda: real_touched("panda_touches/a4", 0.0),
    "real_panda_d3": lambda: real_touched("panda_touches/d3", 0.0),
    "real_panda_f3": lambda: real_touched("panda_touches_more/f3", 0.0),
    "real_ur10": lambda: real_free("UR10, motor currents"),
    "real_panda_free": lambda: real_free("Panda"),
    "real_kuka": lambda: real_free("KUKA LWR4+, first"),
    "real_kinova": lambda: real_free("Kinova Gen3, tool, first"),
}
RECORDINGS = {**SIMULATED, **REAL}


def changed(name: str, answer: dict[str, Any]) -> list[str]:
    """What of a recording's outputs is not as accepted."""
    return differences(accepted(name), answer)


def outputs(recording: Recording) -> dict[str, Any]:
    """What is made of a recording: events, spread of the estimates, health, faults, resets."""
    s = recording.samples
    pipeline = tl.Pipeline(recording.robot, period=float(np.median(np.diff(s.time))))
    estimate, _ = pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    columns = {
        f"tau_ext.{name}": estimate.tau_ext[:, j]
        for j, name in enumerate(pipeline.robot.joint_names)
    }
    for g, name in enumerate(pipeline.robot.segment_names):
        for i, axis in enumerate(("fx", "fy", "fz", "mx", "my", "mz")):
            columns[f"{name}.seg.{axis}"] = estimate.segment_wrench[:, g, i]
    health = Counter(bit.name for value in estimate.health for bit in tl.Health(int(value)))
    answer = {
        "samples": len(s.time),
        "events": [event_outputs(event) for event in pipeline.events],
        "contacts": len(pipeline.contacts),
        "percentiles": {
            name: np.percentile(values[np.isfinite(values)], PERCENTILES).tolist()
            for name, values in columns.items()
            if np.isfinite(values).any()
        },
        "health": dict(sorted(health.items())),
        "faults": [f"{f.sample} {f.channel} {f.fault}" for f in pipeline.faults],
        "resets": [f"{r.sample} {r.name} {r.count}" for r in pipeline.resets],
    }
    return json.loads(json.dumps(shortened(answer)))


def event_outputs(event: tl.Event) -> dict[str, Any]:
    told = event.as_json()
    told["candidates"] = [
        {key: c[key] for key in ("link", "probability", "position")} for c in told["candidates"][:2]
    ]
    return told


def shortened(value: Any) -> Any:
    """With so many digits as are kept."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {key: shortened(x) for key, x in value.items()}
    if isinstance(value, list | tuple):
        return [shortened(x) for x in value]
    return value


def differences(old: Any, new: Any, at: str = "") -> list[str]:
    """What has changed by more than rounding, each with its place."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [*old, *(key for key in new if key not in old)]
        return [
            line
            for key in keys
            for line in differences(old.get(key), new.get(key), f"{at}.{key}".lstrip("."))
        ]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True))
        return [line for i, (x, y) in pairs for line in differences(x, y, f"{at}[{i}]")]
    numbers = isinstance(old, float | int) and isinstance(new, float | int)
    if numbers and abs(old - new) <= SMALLEST + ROUNDING * max(abs(old), abs(new)):
        return []
    return [] if old == new and type(old) is type(new) else [f"{at}: {new}, accepted was {old}"]


def accepted(name: str) -> dict[str, Any]:
    """The accepted outputs of a recording; none where it is new."""
    path = FOLDER / f"{name}.json"
    return json.loads(path.read_text()) if path.exists() else {}


def accept(name: str, answer: dict[str, Any]) -> None:
    """One line for each output: a change is easily read in a commit."""
    lines = ",\n".join(_lines(key, value) for key, value in answer.items())
    (FOLDER / f"{name}.json").write_text(f"{{\n{lines}\n}}\n")


def _lines(key: str, value: Any) -> str:
    if isinstance(value, dict) and value:
        inner = ",\n".join(f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in value.items())
        return f" {json.dumps(key)}: {{\n{inner}\n }}"
    if isinstance(value, list) and value:
        inner = ",\n".join(f"  {json.dumps(v)}" for v in value)
        return f" {json.dumps(key)}: [\n{inner}\n ]"
    return f" {json.dumps(key)}: {json.dumps(value)}"
