# SPDX-License-Identifier: Apache-2.0
"""Tables of the detection benchmark, for reading."""

import numpy as np

from touchline.bench.detection.outcome import Outcome, percentile
from touchline.bench.detection.work import LAYOUTS
from touchline.bench.tables import Row, aligned
from touchline.detector.tail import poisson_interval

ALARMS = (100.0, 10.0, 1.0)  # per hour


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
    forces = sorted(outcomes[0].pushes)
    rows: list[Row] = [
        (
            "observer",
            "kHz",
            "rad/s",
            "method",
            *(f"{f:g} N" for f in forces),
            "goal",
            "found within",
        )
    ]
    for o in outcomes:
        force, limit = o.goal
        for method in o.methods:
            delays = [percentile(o.delays(method, f, rate)) for f in forces]
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


def _names(o: Outcome) -> Row:
    s = o.setting
    return LAYOUTS[s.layout], f"{s.rate / 1000:g}", f"{s.velocity:g}"
