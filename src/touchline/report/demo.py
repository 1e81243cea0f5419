# SPDX-License-Identifier: Apache-2.0
"""The recording that ships with Touchline, analyzed; the truth of its touches beside the events."""

import json
import tempfile
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from touchline.errors import InputError
from touchline.report.analysis import analyze
from touchline.report.summary import summary_text, table

ROBOT = "sara"
RECORDING = "sara_touched.parquet"


def run_demo(out: Path, duration: float | None = None) -> str:
    """Analyze the recording into a directory; returns what there is to print.

    Raises:
        InputError: a duration that is not positive, or a directory that cannot be written.
    """
    if duration is not None and not duration > 0:
        raise InputError(f"--duration {duration:g}: must be a positive number [s]")
    with as_file(files("touchline") / "recordings" / RECORDING) as path:
        if duration is None:
            analysis = analyze(path, ROBOT, out)
        else:
            with tempfile.TemporaryDirectory() as folder:
                cut = Path(folder) / RECORDING
                _cut(path, cut, duration)
                analysis = analyze(cut, ROBOT, out)
        touches = _touches(path, duration)
    truth = [["touch", "from", "to", "force"]]
    truth += [
        [t["link"], f"{t['begin']:.2f}", f"{t['begin'] + t['held']:.2f}", f"{t['force']:.1f}"]
        for t in touches
    ]
    lines = ["true touches (times in s, forces in N)", *table(truth)]
    return "\n".join([summary_text(analysis), "", *lines])


def _touches(path: Path, duration: float | None) -> list[dict[str, Any]]:
    import pyarrow.parquet as pq

    from touchline.logs.parquet import METADATA_KEY

    metadata = pq.read_schema(path).metadata or {}
    touches = json.loads(metadata[METADATA_KEY])["touches"]
    return [t for t in touches if duration is None or t["begin"] < duration]


def _cut(path: Path, target: Path, duration: float) -> None:
    """The first seconds of a table."""
    import pyarrow.parquet as pq

    recording = pq.read_table(path)
    time = recording["time"].to_numpy()
    pq.write_table(recording.slice(0, int((time <= time[0] + duration).sum())), target)
