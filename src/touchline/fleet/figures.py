# SPDX-License-Identifier: Apache-2.0
"""Figures of one recording by the hour: what a fleet is compared by. They add up."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Index, Mask
from touchline.folder import replaced_file
from touchline.health import Health
from touchline.report.outcome import EPOCH
from touchline.report.outputs import ESTIMATES, EVENTS

FIGURES = "figures.json"
HOUR = 3600.0  # s
SETTLES = 0.5  # s around an event that do not count as quiet: filters fade in and out
# Histogram of forces felt while nothing touches [N]: 50 steps a decade, so that a percentile of
# many recordings is known within 2.5 %.
EDGES = np.logspace(-3.0, 3.0, 301)
Figures = dict[str, Any]


def make_figures(folder: Path, robot: str) -> Figures:
    """Work out the figures of a recording from its results, and leave them beside these.

    Args:
        folder: with the results of an analysis.
        robot: name of the robot.
    """
    events = json.loads((folder / EVENTS).read_text(encoding="utf-8"))
    told = _of_estimates(folder / ESTIMATES, events)
    figures = {"robot": robot, "events": [_event(event) for event in events]} | told
    with replaced_file(folder / FIGURES) as draft:
        draft.write_text(json.dumps(figures, allow_nan=False) + "\n", encoding="utf-8")
    return figures


def percentile(counts: Index, share: float) -> float:
    """The force [N] below which a share of the samples lies; NaN without samples.

    Args:
        counts: (300 + 2,) in the steps of EDGES, below and above them.
        share: 0 to 1.
    """
    total = int(counts.sum())
    if not total:
        return float("nan")
    step = int(np.searchsorted(np.cumsum(counts), share * total))
    return float(EDGES[min(step, len(EDGES) - 1)])


def hour_of(time: float, first: float) -> int:
    """Number of the hour: since 1970 where stamps are dates, else since the first sample."""
    return int(np.floor((time if abs(first) > EPOCH else time - first) / HOUR))


def _event(event: dict[str, Any]) -> dict[str, Any]:
    keys = ("id", "segment", "link", "level", "status", "detected", "cleared", "force_peak")
    told = {key: event.get(key) for key in (*keys, "torque_peak", "joint", "clamped")}
    place = event.get("position") or (None, None, None)
    return told | dict(zip("xyz", place, strict=True))


def _of_estimates(path: Path, events: list[dict[str, Any]]) -> Figures:
    import pyarrow.parquet as pq

    first, hours = float("nan"), {}
    with pq.ParquetFile(path) as file:
        names = file.schema_arrow.names
        joints = [n for n in names if n.startswith("tau_ext.")]
        segments = [n.removesuffix(".seg.fx") for n in names if n.endswith(".seg.fx")]
        axes = [f"{s}.seg.{a}" for s in segments for a in ("fx", "fy", "fz")]
        for group in range(file.num_row_groups):
            table = file.read_row_group(group, columns=["time", "health", *joints, *axes])
            time = table["time"].to_numpy().astype(float)
            health = table["health"].to_numpy()
            stamps = time[np.isfinite(time)]
            if np.isnan(first) and len(stamps):
                first = float(stamps[0])
            quiet = _quiet(time, events) & (health == 0)
            base = 0.0 if abs(first) > EPOCH else first
            own = np.floor((np.nan_to_num(time, nan=first) - base) / HOUR).astype(int)
            torques = np.column_stack([_numbers(table[n]) for n in joints] or [np.zeros((0, 0))])
            forces = np.column_stack([_numbers(table[n]) for n in axes] or [np.zeros((0, 0))])
            for hour in np.unique(own):
                entry = hours.setdefault(int(hour), _empty(joints, segments))
                rows = own == hour
                _count(entry, health[rows], joints, torques[rows], quiet[rows])
                sizes = np.linalg.norm(forces[rows].reshape(rows.sum(), -1, 3), axis=2)
                _spread(entry, segments, sizes, quiet[rows])
    dated = bool(abs(first) > EPOCH)
    return {
        "first": None if np.isnan(first) else first,
        "dated": dated,
        "hours": {str(hour): entry for hour, entry in sorted(hours.items())},
    }


def _quiet(time: NDArray, events: list[dict[str, Any]]) -> Mask:
    quiet = np.isfinite(time)
    for event in events:
        end = np.inf if event["cleared"] is None else event["cleared"] + SETTLES
        quiet &= (time < event["detected"] - SETTLES) | (time > end)
    return quiet


def _numbers(column: Any) -> Array:
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=float)


def _empty(joints: list[str], segments: list[str]) -> dict[str, Any]:
    nothing = {"quiet": 0, "nan": 0, "sum": 0.0, "squares": 0.0, "largest": 0.0}
    return {
        "samples": 0,
        "healthy": 0,
        "health": {bit.name: 0 for bit in Health},
        "joints": {name.removeprefix("tau_ext."): dict(nothing) for name in joints},
        "segments": {name: {"nan": 0, "counts": [0] * (len(EDGES) + 1)} for name in segments},
    }


def _count(
    entry: dict[str, Any],
    health: NDArray,
    joints: list[str],
    torques: NDArray,
    quiet: Mask,
) -> None:
    entry["samples"] += len(health)
    entry["healthy"] += int((health == 0).sum())
    for bit in Health:
        entry["health"][bit.name] += int((health & np.uint32(bit) != 0).sum())
    for j, name in enumerate(joints):
        told, values = entry["joints"][name.removeprefix("tau_ext.")], torques[:, j]
        known = np.isfinite(values)
        clean = values[known & quiet]
        told["nan"] += int((~known).sum())
        told["quiet"] += len(clean)
        told["sum"] += float(clean.sum())
        told["squares"] += float((clean**2).sum())
        told["largest"] = max(told["largest"], float(np.abs(clean).max(initial=0.0)))


def _spread(entry: dict[str, Any], segments: list[str], sizes: NDArray, quiet: Mask) -> None:
    for g, name in enumerate(segments):
        told, values = entry["segments"][name], sizes[:, g]
        known = np.isfinite(values)
        steps = np.searchsorted(EDGES, values[known & quiet])
        counts = np.bincount(steps, minlength=len(EDGES) + 1)
        told["nan"] += int((~known).sum())
        told["counts"] = (np.array(told["counts"]) + counts).tolist()
