# SPDX-License-Identifier: Apache-2.0
"""Tables of the detection benchmark as CSV files, which grow setting by setting."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from touchline.bench.detection.outcome import Outcome, percentile
from touchline.bench.detection.work import LAYOUTS, description
from touchline.detector.tail import poisson_interval

RATES = np.geomspace(0.1, 100.0, 31)  # per hour, of the curves; 1 and 10 are among them
SETTING = ("observer", "rate_hz", "velocity_noise")
ROC = (
    *SETTING,
    "method",
    "force_n",
    "alarms_wanted_per_hour",
    "alarms_measured_per_hour",
    "low",
    "high",
    "hours",
    "found_within_goal",
    "found",
    "delay_median_s",
    "delay_p95_s",
)
TAILS = (
    *SETTING,
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
)


def write(o: Outcome, out: Path) -> None:
    """Adds a setting to roc.csv (by method, force and rate) and tails.csv in a folder.

    What stands there of other settings stays; what stands there of this one is replaced.
    """
    _merge(out / "roc.csv", ROC, list(_roc(o)))
    _merge(out / "tails.csv", TAILS, list(_tails(o)))


def read(path: Path) -> list[dict[str, str]]:
    """The lines of a table; none where there is no file."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _merge(path: Path, names: Sequence[str], rows: list[tuple[str, ...]]) -> None:
    new = {row[: len(SETTING)] for row in rows}
    old = [tuple(row.get(name) or "" for name in names) for row in read(path)]
    part = path.with_name(path.name + ".part")
    with part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([row for row in old if row[: len(SETTING)] not in new])
        writer.writerows(rows)
    part.replace(path)


def _setting(o: Outcome) -> tuple[str, ...]:
    s = o.setting
    return LAYOUTS[s.layout], f"{s.rate:g}", f"{s.velocity:g}"


def _roc(o: Outcome) -> Iterator[tuple[str, ...]]:
    hours, limit = o.tested.hours, o.goal[1]
    for method in o.methods:
        for rate in RATES:
            count = o.alarms(method, rate)
            alarms = (rate, *(x / hours for x in (count, *poisson_interval(count))), hours)
            for force in sorted(o.pushes):
                d = o.delays(method, force, rate)
                yield (
                    *_setting(o),
                    method,
                    f"{force:g}",
                    *(f"{x:.4g}" for x in alarms),
                    f"{np.mean(d <= limit):.4f}",
                    f"{np.mean(np.isfinite(d)):.4f}",
                    f"{np.median(d):.6f}",
                    f"{percentile(d):.6f}",
                )


def _tails(o: Outcome) -> Iterator[tuple[str, ...]]:
    share = 1.0 / len(description(o.setting.layout, o.setting.velocity).segment_names)
    for segment, tails in o.tails.items():
        for method, t in tails.items():
            numbers = (t.level, t.per_hour, t.scale, t.shape, t.count, t.hours)
            limits = (t.threshold(share), *t.interval(share))
            yield (
                *_setting(o),
                segment,
                method,
                *(f"{x:.5g}" for x in (*numbers, *limits)),
                str(t.extrapolates(share)),
            )
