# SPDX-License-Identifier: Apache-2.0
"""The results of an analysis in memory."""

import json
import tempfile
from dataclasses import dataclass, fields
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from touchline.model.robot import Robot
from touchline.report.analysis import analyze as analyze_files
from touchline.report.outputs import CONTACTS, ESTIMATES, EVENTS
from touchline.result.event import Event
from touchline.result.native import EVENT

MOST_SHOWN, MOST_ROWS = 3, 20  # events in a line, and in a notebook
# Titles of a notebook's columns, and what stands in them.
SHOWN = {
    "event": "id",
    "detected [s]": "detected",
    "cleared [s]": "cleared",
    "level": "level",
    "segment": "segment",
    "link": "link",
    "probability": "body_probability",
    "largest force [N]": "force_peak",
    "status": "status",
}


@dataclass(frozen=True, repr=False)
class Results:
    """What came out of a recording, with the columns and keys of the files.

    Attributes:
        estimates: Arrow table, a row per sample.
        contacts: Arrow table, a row per contact and sample.
        events: all events, in the order of detection.
        warnings: what the user should know.
    """

    estimates: Any
    contacts: Any
    events: list[Event]
    warnings: list[str]

    def __repr__(self) -> str:
        collisions = sum(event.level == "collision" for event in self.events)
        events = "; ".join(_line(event) for event in self.events[:MOST_SHOWN])
        more = len(self.events) - MOST_SHOWN
        return (
            f"<Results: {self.estimates.num_rows} samples, {len(self.events)} events, {collisions} "
            f"of them collisions{': ' if events else ''}{events}"
            f"{f'; {more} more' if more > 0 else ''}>"
        )

    def _repr_html_(self) -> str:
        """The events as a notebook shows them."""
        head = "".join(f"<th>{escape(title)}</th>" for title in SHOWN)
        rows = "".join(
            "<tr>"
            + "".join(f"<td>{escape(_told(getattr(event, key)))}</td>" for key in SHOWN.values())
            + "</tr>"
            for event in self.events[:MOST_ROWS]
        )
        more = len(self.events) - MOST_ROWS
        caption = f"{self.estimates.num_rows} samples, {len(self.events)} events"
        caption += f", the first {MOST_ROWS}" if more > 0 else ""
        return f"<table><caption>{caption}</caption><tr>{head}</tr>{rows}</table>"

    def to_arrow(self) -> dict[str, Any]:
        """The tables `estimates`, `contacts` and `events`, as Arrow tables."""
        import pyarrow as pa

        kinds = {"number": pa.float64(), "count": pa.int64(), "flag": pa.bool_()}
        kinds |= {"vector": (vector := pa.list_(pa.float64()))}
        candidate = [("link", pa.string()), ("body", pa.string()), ("probability", pa.float64())]
        candidate += [("position", vector), ("radius", pa.float64())]
        kinds["candidates"] = pa.list_(pa.struct(candidate))
        kind_of = {field.name: field.kind for field in EVENT}
        schema = [(f.name, kinds.get(kind_of.get(f.name, ""), pa.string())) for f in fields(Event)]
        events = pa.Table.from_pylist([e.as_json() for e in self.events], pa.schema(schema))
        return {"estimates": self.estimates, "contacts": self.contacts, "events": events}

    def to_pandas(self) -> dict[str, Any]:
        """The tables `estimates`, `contacts` and `events`, as frames of pandas.

        Raises:
            ModuleNotFoundError: pandas is not installed.
        """
        if find_spec("pandas") is None:
            raise ModuleNotFoundError("pandas is not installed: pip install pandas", name="pandas")
        return {name: table.to_pandas() for name, table in self.to_arrow().items()}


def _line(event: Event) -> str:
    where = event.link or event.segment
    if event.status != "located":
        where += f" ({event.status.replace('_', ' ')})"
    return f"{event.id}: {event.level} at {event.detected:.3f} s on {where}"


def _told(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def analyze(
    log: Path | str,
    robot: Robot | Path | str,
    out: Path | str | None = None,
    bandwidth: float | None = None,
    method: str = "segment",
) -> Results:
    """Analyze a recording: estimates, contacts and events.

    Args:
        log: the recording.
        robot: the robot, or what `load_robot` takes.
        out: directory that keeps the files of `touchline analyze`; default: none.
        bandwidth: K [rad/s] of all rows; default: the description's.
        method: of the observer, "segment" or "paper".

    Raises:
        InputError: an input cannot be used.
    """
    if out is None:
        with tempfile.TemporaryDirectory(prefix="touchline-") as folder:
            return analyze(log, robot, Path(folder) / "results", bandwidth, method)
    import pyarrow.parquet as pq

    analysis = analyze_files(log, robot, out, bandwidth, method, "none")
    folder = Path(out)
    # Not mapped into memory: the files may be gone before the tables.
    estimates = pq.read_table(folder / ESTIMATES, memory_map=False)
    contacts = pq.read_table(folder / CONTACTS, memory_map=False)
    events = json.loads((folder / EVENTS).read_text(encoding="utf-8"))
    return Results(estimates, contacts, [Event.from_json(e) for e in events], analysis.warnings)
