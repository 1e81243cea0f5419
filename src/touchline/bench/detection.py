# SPDX-License-Identifier: Apache-2.0
"""`touchline bench detection`: how soon pushes are found, at which rate of false alarms.

Prescribed motion up to 3 rad/s of an arm whose inertias are 2 % off, ordinary sensor noise, no
physics engine. Thresholds are calibrated on some trajectories; false alarms are counted on others,
and sudden pushes on the structure are found or not on others again.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from touchline.bench import detection_classical, detection_work
from touchline.bench.detection_work import (
    CALIBRATED,
    SECONDS,
    TESTED,
    Pool,
    Setting,
    description,
    joined,
    pieces,
)
from touchline.bench.request import check_least, check_positive, prepare_results
from touchline.bench.tables import Row, aligned
from touchline.contact.calibration import Statistics, count_alarms, fit_tails
from touchline.contact.tail import Tail, poisson_interval

Array = NDArray[np.float64]

SETTINGS = tuple(
    Setting(layout, rate, velocity)
    for layout in ("sara", "joints", "classical")
    for rate in (1000.0, 8000.0)
    for velocity in (1e-3, 2e-4)
)
FORCES = (2.0, 5.0, 10.0, 20.0, 50.0)  # N
ALARMS = (100.0, 10.0, 1.0)  # per hour
GOALS = {
    (1000.0, 1e-3): (20.0, 6e-3),
    (8000.0, 1e-3): (20.0, 4e-3),
    (1000.0, 2e-4): (5.0, 15e-3),
    (8000.0, 2e-4): (5.0, 10e-3),
}
RATES = np.geomspace(0.3, 300.0, 31)  # per hour, of the curves
TRIALS = 200  # pushes of each force
FIGURES = 10  # recordings that the row figures come from
PIECE = 10  # recordings, or pushes times five, that a process takes at a time
LAYOUTS = {"sara": "extended", "joints": "joint torques", "classical": "classical"}


@dataclass(frozen=True)
class Outcome:
    """What was measured in one setting.

    Attributes:
        setting: what was simulated.
        methods: of detection, in the order of the statistics.
        tails: by segment and method, from the calibration.
        tested: statistics on other trajectories.
        pushes: force -> statistics (trials, samples, methods) on the structure from its onset on.
        hours: of calibration.
    """

    setting: Setting
    methods: tuple[str, ...]
    tails: dict[str, dict[str, Tail]]
    tested: Statistics
    pushes: dict[float, Array]
    hours: float

    def limits(self, method: str, rate: float) -> Array:
        """Thresholds of the segments for a false-alarm rate of the whole robot."""
        robot = description(self.setting.layout, self.setting.velocity)
        share = rate / len(robot.segment_names)
        tails = [self.tails.get(name, {}).get(method) for name in robot.segment_names]
        return np.array([tail.threshold(share) if tail else np.inf for tail in tails])

    def alarms(self, method: str, rate: float) -> int:
        """Alarms in the tested hours."""
        return count_alarms(self.tested, self.limits(method, rate), self.methods.index(method))

    def delays(self, method: str, force: float, rate: float) -> Array:
        """Time (trials,) from the onset to the detection [s]; infinite where it never came."""
        over = self.pushes[force][:, :, self.methods.index(method)] > self.limits(method, rate)[0]
        over &= ~over[:, :1]  # an alarm before the onset finds nothing
        first = (np.argmax(over, axis=1) - 0.5) / self.setting.rate
        return np.where(over.any(axis=1), first, np.inf)


def measure(setting: Setting, hours: float, trials: int, pool: Pool) -> Outcome:
    """Calibrates, counts false alarms for `hours`, and pushes `trials` times with each force."""
    work = detection_classical if setting.layout == "classical" else detection_work
    name = f"{LAYOUTS[setting.layout]}, {setting.rate / 1000:g} kHz, {setting.velocity:g} rad/s"
    count = max(1, round(hours * 3600 / SECONDS))
    (rows,) = pool.map(f"{name}: rows", work.row_figures, [(setting, min(FIGURES, count))])
    parts = [
        joined(
            pool.map(
                f"{name}: {what}",
                work.statistics,
                [(setting, rows, which, numbers) for numbers in pieces(count, PIECE)],
            )
        )
        for what, which in (("calibration", CALIBRATED), ("false alarms", TESTED))
    ]
    tails = fit_tails(description(setting.layout, setting.velocity), parts[0], work.METHODS)
    pushes = {}
    for force in FORCES:
        jobs = [(setting, rows, force, numbers) for numbers in pieces(trials, 5 * PIECE)]
        pushes[force] = np.concatenate(pool.map(f"{name}: {force:g} N", work.push_statistics, jobs))
    return Outcome(setting, work.METHODS, tails, parts[1], pushes, parts[0].hours)


def alarm_table(outcomes: list[Outcome]) -> str:
    """False alarms per hour that were asked for and that came, on other trajectories."""
    head: Row = (
        "observer",
        "kHz",
        "rad/s",
        "method",
        "hours",
        *(f"at {rate:g}/h" for rate in ALARMS),
        "ratio at 10/h",
    )
    rows: list[Row] = [head]
    for o in outcomes:
        for method in o.methods:
            cells = []
            for rate in ALARMS:
                count, hours = o.alarms(method, rate), o.tested.hours
                low, high = (x / hours for x in poisson_interval(count))
                cells.append(f"{count / hours:.3g} [{low:.2g}, {high:.2g}]")
            ratio = o.alarms(method, 10.0) / o.tested.hours / 10.0
            rows.append((*_names(o), method, f"{o.tested.hours:.3g}", *cells, f"{ratio:.2f}"))
    return aligned(rows, text_columns=(0, 3))


def delay_table(outcomes: list[Outcome], rate: float = 1.0) -> str:
    """Time in which 95 % of the pushes are found [ms], and the goal where there is one."""
    rows: list[Row] = [
        (
            "observer",
            "kHz",
            "rad/s",
            "method",
            *(f"{f:g} N" for f in FORCES),
            "goal",
            "found within",
        )
    ]
    for o in outcomes:
        force, limit = GOALS[o.setting.rate, o.setting.velocity]
        for method in o.methods:
            delays = [_percentile(o.delays(method, f, rate)) for f in FORCES]
            share = float(np.mean(o.delays(method, force, rate) <= limit))
            rows.append(
                (
                    *_names(o),
                    method,
                    *(f"{1e3 * d:.2f}" if np.isfinite(d) else "-" for d in delays),
                    f"{force:g} N, {1e3 * limit:g} ms",
                    f"{100 * share:.1f} %",
                )
            )
    return aligned(rows, text_columns=(0, 3))


def _percentile(delays: Array) -> float:
    return float(np.sort(delays)[int(np.ceil(0.95 * len(delays))) - 1])


def _names(o: Outcome) -> Row:
    s = o.setting
    return LAYOUTS[s.layout], f"{s.rate / 1000:g}", f"{s.velocity:g}"


def write_tables(outcomes: list[Outcome], out: Path) -> None:
    """Writes roc.csv (one line per setting, method, force and rate) and tails.csv."""
    with (out / "roc.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            [
                "observer",
                "rate_hz",
                "velocity_noise",
                "method",
                "force_n",
                "alarms_wanted_per_hour",
                "alarms_measured_per_hour",
                "hours",
                "found_within_goal",
                "found",
                "delay_median_s",
                "delay_p95_s",
            ]
        )
        for o in outcomes:
            limit = GOALS[o.setting.rate, o.setting.velocity][1]
            for method in o.methods:
                for rate in RATES:
                    measured = o.alarms(method, rate) / o.tested.hours
                    for force in FORCES:
                        d = o.delays(method, force, rate)
                        writer.writerow(
                            [
                                LAYOUTS[o.setting.layout],
                                f"{o.setting.rate:g}",
                                f"{o.setting.velocity:g}",
                                method,
                                f"{force:g}",
                                f"{rate:.4g}",
                                f"{measured:.4g}",
                                f"{o.tested.hours:.4g}",
                                f"{np.mean(d <= limit):.4f}",
                                f"{np.mean(np.isfinite(d)):.4f}",
                                f"{np.median(d):.6f}",
                                f"{_percentile(d):.6f}",
                            ]
                        )
    with (out / "tails.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            [
                "observer",
                "rate_hz",
                "velocity_noise",
                "segment",
                "method",
                "level",
                "per_hour",
                "scale",
                "shape",
                "peaks",
                "hours",
                "at_1_per_hour",
                "low",
                "high",
                "extrapolated",
            ]
        )
        for o in outcomes:
            share = 1.0 / len(description(o.setting.layout, o.setting.velocity).segment_names)
            for segment, tails in o.tails.items():
                for method, t in tails.items():
                    numbers = (
                        t.level,
                        t.per_hour,
                        t.scale,
                        t.shape,
                        t.count,
                        t.hours,
                        t.threshold(share),
                        *t.interval(share),
                    )
                    writer.writerow(
                        [
                            LAYOUTS[o.setting.layout],
                            f"{o.setting.rate:g}",
                            f"{o.setting.velocity:g}",
                            segment,
                            method,
                            *(f"{x:.5g}" for x in numbers),
                            t.extrapolates(share),
                        ]
                    )


def main(hours: float = 1.0, trials: int = TRIALS, out: Path | None = None) -> None:
    """Prints the tables.

    Args:
        hours: of motion for calibration and as many for the count of false alarms, at 1 kHz; at
            8 kHz an eighth of it, since that is as many samples.
        trials: pushes of each force.
        out: folder for roc.csv, tails.csv and figures.
    """
    check_positive(hours=hours)
    check_least(1, pushes=trials)
    prepare_results(out)
    outcomes = []
    with Pool() as pool:
        for setting in SETTINGS:
            share = hours * 1000.0 / setting.rate * (1.0 if setting.layout == "sara" else 0.5)
            outcomes.append(measure(setting, share, trials, pool))
    print(f"detection benchmark: sara, inertias 2 % off, up to 3 rad/s, {trials} pushes a force")
    print("\nfalse alarms per hour of the whole robot, on other trajectories than calibrated on")
    print("(95 % Poisson interval)\n")
    print(alarm_table(outcomes))
    print("\ndelay in which 95 % of sudden pushes on the structure are found [ms], at one false")
    print("alarm per hour; -: fewer are found within 50 ms\n")
    print(delay_table(outcomes))
    if out is not None:
        from touchline.bench.detection_drawing import draw

        write_tables(outcomes, out)
        draw(outcomes, RATES, GOALS, LAYOUTS, out)
        print(f"\n{out}: roc.csv, tails.csv, figures")
