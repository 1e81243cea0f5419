# SPDX-License-Identifier: Apache-2.0
"""Errors of estimated wrenches in a scenario, the best setting of each method, and who is best."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.bench.wrench.log import Log
from touchline.bench.wrench.methods import Method, Trial
from touchline.bench.wrench.scenarios import Scenario, Scene
from touchline.bench.wrench.stage import IMPACT, QUIET, START

Key = tuple[str, str, str]  # scene, segment, quantity; the scene of all logs together is ""

DEFAULT = 100.0  # bandwidth of ours as shipped, and the least where nothing touches [rad/s]
TIE = 1.1  # values within this ratio of the best are as good
MARGIN = 1.5  # a threshold over the largest force seen while nothing touches
AFTER = 0.2  # how long after an impact its trace is looked for [s]
QUANTITIES = {
    "force_rms": "force RMS [N]",
    "force_p999": "force 99.9 % [N]",
    "moment_rms": "moment RMS [Nm]",
    "moment_p999": "moment 99.9 % [Nm]",
}
IMPACT_QUANTITIES = {
    "peak_error": "peak error [%]",
    "peak_delay": "delay of peak [ms]",
    "detection": "detected after [ms]",
}


@dataclass(frozen=True)
class Score:
    """What one setting of a method achieves in a scenario.

    Attributes:
        method: name.
        bandwidth: [rad/s].
        setting: see `Trial`.
        values: by scene, segment and quantity; NaN where the method says nothing.
        cost: by which the best setting is chosen.
    """

    method: str
    bandwidth: float
    setting: str
    values: Mapping[Key, float]
    cost: float


@dataclass(frozen=True)
class Outcome:
    """A scenario and all scores in it.

    Attributes:
        scenario: that was run.
        segments: names.
        touched: by scene, the segment that is touched where it is one.
        scores: of all settings of all methods.
    """

    scenario: Scenario
    segments: tuple[str, ...]
    touched: Mapping[str, str]
    scores: Sequence[Score]

    def best(self, method: str) -> Score:
        """The best setting of a method; where nothing touches, of those at least at `DEFAULT`."""
        own = [s for s in self.scores if s.method == method]
        if not self.scenario.touched:
            own = [s for s in own if s.bandwidth >= DEFAULT]
        return min(own, key=lambda score: score.cost)

    def shipped(self) -> Score | None:
        """Ours as shipped; None where the log is too slow for it."""
        own = (s for s in self.scores if (s.method, s.bandwidth) == ("segment", DEFAULT))
        return next(own, None)


def run_scenario(
    scenario: Scenario, methods: Sequence[Method], tick: Callable[[str], None]
) -> Outcome:
    """Records a scenario's logs and judges all methods on them.

    Args:
        scenario: to run.
        methods: all of them installed.
        tick: called after each method, with its name.
    """
    scenes = scenario.scenes()
    scores: list[Score] = []
    for method in methods:
        trials = zip(*(method.trials(scene.log) for scene in scenes), strict=True)
        scores += [_score(method.name, scenario, scenes, group) for group in trials]
        tick(method.name)
    touched = {s.name: next(iter(s.log.touched)) for s in scenes if len(s.log.touched) == 1}
    return Outcome(scenario, scenes[0].log.robot.segment_names, touched, scores)


def _score(
    method: str, scenario: Scenario, scenes: Sequence[Scene], trials: Sequence[Trial]
) -> Score:
    """One setting on all logs of a scenario."""
    values: dict[Key, float] = {}
    if scenes[0].onsets:
        values |= impact_values(scenes[0], trials[0].wrench)
    else:
        errors = [
            window_errors(scene.log, trial.wrench, scenario.window)
            for scene, trial in zip(scenes, trials, strict=True)
        ]
        values |= error_values("", scenes[0].log, np.concatenate(errors))
        for scene, error in zip(scenes, errors, strict=True):
            values |= error_values(scene.name, scene.log, error) if scene.name else {}
    goals = ("peak_error", "force_rms" if scenario.touched else "force_p999")
    aims = [v for (scene, _, quantity), v in values.items() if not scene and quantity in goals]
    return Score(method, trials[0].bandwidth, trials[0].setting, values, float(np.nanmean(aims)))


def window_errors(log: Log, wrench: Array, window: tuple[float, float]) -> Array:
    """Norms (M, m, 2) of force and moment errors within a window [s], about each segment's sensor.

    Args:
        log: with the truth.
        wrench: (N, m, 6) estimated, world axes, about the world's origin.
        window: from when to when [s].
    """
    inside = (log.time >= window[0]) & (log.time < window[1])
    error = (wrench - log.truth)[inside]
    force = error[..., :3]
    moment = error[..., 3:] - np.cross(log.origins[inside], force)
    return np.stack([np.linalg.norm(x, axis=-1) for x in (force, moment)], axis=-1)


def error_values(scene: str, log: Log, errors: Array) -> dict[Key, float]:
    """RMS and 99.9 % level of errors (M, m, 2) by segment, for the force and the moment."""
    values: dict[Key, float] = {}
    for s, segment in enumerate(log.robot.segment_names):
        for p, part in enumerate(("force", "moment")):
            known = errors[:, s, p][np.isfinite(errors[:, s, p])]
            rms, high = np.nan, np.nan
            if len(known):
                rms, high = np.sqrt(np.mean(known**2)), np.quantile(known, 0.999)
            values[scene, segment, f"{part}_rms"] = float(rms)
            values[scene, segment, f"{part}_p999"] = float(high)
    return values


def impact_values(scene: Scene, wrench: Array) -> dict[Key, float]:
    """Means over the impacts on each segment; thresholds follow from the time without contact."""
    time, names = scene.log.time, scene.log.robot.segment_names
    values: dict[Key, float] = {}
    for s, segment in enumerate(names):
        force = np.linalg.norm(wrench[:, s, :3], axis=1)
        true = np.linalg.norm(scene.log.truth[:, s, :3], axis=1)
        threshold = MARGIN * force[(time >= START) & (time < QUIET - 0.05)].max()
        found = []
        for at, onset in scene.onsets:
            if at != segment:
                continue
            rows = np.flatnonzero((time >= onset) & (time < onset + AFTER))
            peak, over = rows[force[rows].argmax()], rows[force[rows] > threshold]
            first = 1e3 * (time[over[0]] - onset) if len(over) else np.nan
            late = 1e3 * (time[peak] - time[rows[true[rows].argmax()]])
            found.append((100 * abs(force[peak] - IMPACT) / IMPACT, late, first))
        error, late, first = np.array(found or [(np.nan,) * 3]).T
        values["", segment, "peak_error"] = float(error.mean())
        values["", segment, "peak_delay"] = float(late.mean())
        values["", segment, "detection"] = float(first.mean())  # NaN if one was missed
    return values


def leaders(values: Mapping[str, float]) -> list[str]:
    """Names of the lowest value and of all within `TIE` of it, best first; NaN takes no part."""
    known = {name: abs(value) for name, value in values.items() if np.isfinite(value)}
    if not known:
        return []
    least = min(known.values())
    return sorted((n for n, v in known.items() if v <= TIE * least), key=lambda n: known[n])
