# SPDX-License-Identifier: Apache-2.0
"""The wrench benchmark in words: rows with every method side by side, and files of them."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from touchline.bench.tables import aligned
from touchline.bench.wrench.methods import METHODS, Method
from touchline.bench.wrench.scores import (
    IMPACT_QUANTITIES,
    QUANTITIES,
    TIE,
    Key,
    Outcome,
    leaders,
)

EQUIVALENT = (
    "With a low-pass on its result, iDynTree's estimator is the segment observer in other words:\n"
    "against the best of the peers ours can tie or lose."
)
OURS, SHIPPED = "segment", "shipped"
ALL_QUANTITIES = QUANTITIES | IMPACT_QUANTITIES


def row_keys(outcome: Outcome, scenes: bool = True) -> list[Key]:
    """Scene, segment and quantity of all rows, in the order of the tables.

    Args:
        outcome: of a scenario.
        scenes: also those of single logs.
    """
    known = outcome.scores[0].values
    names = dict.fromkeys(scene for scene, _, _ in known if scenes or not scene)
    return [
        (scene, segment, quantity)
        for scene in names
        for segment in outcome.segments
        for quantity in ALL_QUANTITIES
        if (scene, segment, quantity) in known
    ]


def values(outcome: Outcome, methods: Sequence[Method], key: Key) -> dict[str, float]:
    """One row: the value of each method at its best setting."""
    return {m.name: outcome.best(m.name).values[key] for m in methods}


def best(row: dict[str, float]) -> list[str]:
    """The lowest of the methods that a robot has all for, and those within `TIE` of it."""
    real = {m.name for m in METHODS if m.real}
    return leaders({name: value for name, value in row.items() if name in real})


def verdict(row: dict[str, float], peer: str | None = None) -> str:
    """`win`, `tie` or `loss` of ours against a peer, or against the best of all.

    Empty where either says nothing.
    """
    real = [m.name for m in METHODS if m.real and not m.own]
    rivals = [row[name] for name in row if name in ([peer] if peer else real)]
    rivals = [abs(value) for value in rivals if np.isfinite(value)]
    ours = abs(row[OURS])
    if not rivals or not np.isfinite(ours):
        return ""
    rival = min(rivals)
    if ours <= TIE * rival and rival <= TIE * ours:
        return "tie"
    return "win" if ours < rival else "loss"


def scenario_table(outcome: Outcome, methods: Sequence[Method]) -> str:
    """A scenario: one row per segment and quantity, one column per method, who is best."""
    head = ("", "", SHIPPED, *(m.name for m in methods), "best", "verdict")
    rows: list[tuple[str, ...]] = [head]
    shipped = outcome.shipped()
    for _, segment, quantity in row_keys(outcome, scenes=False):
        key = ("", segment, quantity)
        row = values(outcome, methods, key)
        default = shipped.values[key] if shipped else np.nan
        cells = [number(value) for value in (default, *row.values())]
        rows.append((segment, ALL_QUANTITIES[quantity], *cells, few(best(row)), verdict(row)))
    text = len(head) - 2, len(head) - 1
    scenario = outcome.scenario
    title = f"{scenario.name}: {scenario.says}"
    return f"{title}\n{aligned(rows, (0, 1, *text))}\n{_settings(outcome, methods)}"


def _settings(outcome: Outcome, methods: Sequence[Method]) -> str:
    chosen = [outcome.best(m.name) for m in methods]
    words = [f"{s.method} {_setting(s.bandwidth, s.setting)}" for s in chosen]
    return f"bandwidths [rad/s]: {', '.join(words)}"


def _setting(bandwidth: float, setting: str) -> str:
    size = f"{bandwidth:g}" if np.isfinite(bandwidth) else "none"
    return f"{size} ({setting})" if setting else size


def link_table(outcome: Outcome, methods: Sequence[Method]) -> str:
    """RMS of the force on the pushed segment by pushed link, for a sweep."""
    touched = {
        scene: segment
        for scene, segment, _ in row_keys(outcome)
        if scene and outcome.touched.get(scene) == segment
    }
    rows: list[tuple[str, ...]] = [("pushed", *(m.name for m in methods), "best", "verdict")]
    for scene, segment in touched.items():
        row = values(outcome, methods, (scene, segment, "force_rms"))
        cells = [number(value) for value in row.values()]
        rows.append((scene, *cells, few(best(row)), verdict(row)))
    head = "force RMS [N] on the pushed segment, by pushed link"
    return f"{head}\n{aligned(rows, (0, len(rows[0]) - 2, len(rows[0]) - 1))}"


def tally(outcomes: Sequence[Outcome], methods: Sequence[Method]) -> str:
    """How often ours wins, ties and loses against each peer, over all rows."""
    rows: list[tuple[str, ...]] = [("ours against", "win", "tie", "loss")]
    table = [
        values(outcome, methods, key)
        for outcome in outcomes
        for key in row_keys(outcome, scenes=False)
    ]
    for method in methods:
        if method.name != OURS:
            found = [verdict(row, method.name) for row in table]
            rows.append((method.name, *(str(found.count(x)) for x in ("win", "tie", "loss"))))
    found = [verdict(row) for row in table]
    rows.append(("the best of the peers", *(str(found.count(x)) for x in ("win", "tie", "loss"))))
    return f"{aligned(rows)}\n{EQUIVALENT}"


def few(names: Sequence[str]) -> str:
    """The first two names, and how many there are more."""
    more = f" +{len(names) - 2}" if len(names) > 2 else ""
    return ", ".join(names[:2]) + more


def number(value: float) -> str:
    """Three significant digits; a dash for what is not known."""
    if not np.isfinite(value):
        return "-"
    return f"{value:.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.0e}"


def write_tables(folder: Path, outcomes: Sequence[Outcome], methods: Sequence[Method]) -> None:
    """Writes wrench.csv (best settings), wrench_settings.csv and wrench_all.csv (all settings)."""
    where = ("scene", "part", "quantity")  # a part is a segment, which is also a method's name
    head = ("scenario", *where, SHIPPED, *(m.name for m in methods), "best", "verdict")
    _write(folder / "wrench.csv", head, _wide(outcomes, methods))
    head = ("scenario", "method", "bandwidth", "setting", *where, "value")
    _write(folder / "wrench_all.csv", head, _long(outcomes))
    chosen = (
        (o.scenario.name, m.name, o.best(m.name).bandwidth, o.best(m.name).setting)
        for o in outcomes
        for m in methods
    )
    _write(folder / "wrench_settings.csv", ("scenario", "method", "bandwidth", "setting"), chosen)


def _wide(outcomes: Sequence[Outcome], methods: Sequence[Method]) -> Iterator[tuple]:
    for outcome in outcomes:
        shipped = outcome.shipped()
        for key in row_keys(outcome):
            row = values(outcome, methods, key)
            default = shipped.values[key] if shipped else np.nan
            names = " ".join(best(row))
            yield outcome.scenario.name, *key, default, *row.values(), names, verdict(row)


def _long(outcomes: Sequence[Outcome]) -> Iterator[tuple]:
    for outcome in outcomes:
        for s in outcome.scores:
            for key, value in s.values.items():
                yield outcome.scenario.name, s.method, s.bandwidth, s.setting, *key, value


def _write(path: Path, head: Sequence[str], rows: Iterator[tuple]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        for row in rows:
            writer.writerow([_cell(x) for x in row])


def _cell(value: object) -> object:
    if not isinstance(value, float):
        return value
    return "" if np.isnan(value) else f"{value:.6g}"
