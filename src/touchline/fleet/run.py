# SPDX-License-Identifier: Apache-2.0
"""Analyzes many recordings: plan, processes, manifest, and what came of it."""

import json
import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from touchline.errors import InputError
from touchline.extras import need
from touchline.fleet.cluster import Cluster
from touchline.fleet.figures import FIGURES, make_figures
from touchline.fleet.manifest import JOURNAL, Manifest, Row, configuration_hash
from touchline.fleet.page import write_page
from touchline.fleet.plan import Recording, briefly, make_plan, none_text
from touchline.fleet.pool import Pool
from touchline.fleet.tables import check_tables, table_rows, write_tables
from touchline.fleet.work import Job, blank
from touchline.folder import ResultsFolder
from touchline.numbers import counted, lasting

DONE = ("ok", "partial")


@dataclass(frozen=True)
class Limits:
    """What processes may take.

    Attributes:
        workers: number of processes; 0: one per core.
        seconds: for one recording, or None.
        megabytes: of memory for one process, or None.
        cluster: address of a dask scheduler whose workers take the place of processes, or None.
    """

    workers: int = 0
    seconds: float | None = None
    megabytes: float | None = None
    cluster: str | None = None

    def check(self) -> None:
        """Make sure that the limits make sense and that there is what they need.

        Raises:
            InputError: one makes no sense.
            ModuleNotFoundError: a cluster is named, but distributed is not installed.
        """
        if self.workers < 0:
            raise InputError(f"--workers {self.workers}: must not be negative")
        for name, value in (("time-limit", self.seconds), ("memory-limit", self.megabytes)):
            if value is not None and not value > 0:
                raise InputError(f"--{name} {value:g}: must be positive")
            if value is not None and self.cluster is not None:
                raise InputError(f"--{name}: not with --cluster: its workers have their own limits")
        if self.workers and self.cluster is not None:
            raise InputError("--workers: not with --cluster: it has as many as it has")
        if self.cluster is not None:
            need("distributed")  # told before anything is written

    def takers(self, jobs: int) -> Pool | Cluster:
        """Who analyzes so many recordings.

        Raises:
            InputError: the cluster cannot be reached.
        """
        if self.cluster is not None:
            return Cluster(self.cluster)
        memory = None if self.megabytes is None else int(self.megabytes * 2**20)
        workers = self.workers or os.cpu_count() or 1
        return Pool(min(workers, max(jobs, 1)), self.seconds, memory)


@dataclass
class Outcome:
    """What became of all recordings.

    Attributes:
        rows: one per recording, in the order of the plan.
        unchanged: names of those whose results stood already.
        stopped: whether it was interrupted.
        none: what was named and is no recording, with the reason.
    """

    rows: list[Row] = field(default_factory=list)
    unchanged: set[str] = field(default_factory=set)
    stopped: bool = False
    none: dict[str, str] = field(default_factory=dict)

    @property
    def status(self) -> int:
        """Exit status: 0 all ok, 3 some lost or partial, 1 nothing done, 130 interrupted."""
        if self.stopped:
            return 130
        told = Counter(row["status"] for row in self.rows)
        if not any(told[status] for status in DONE):
            return 1
        return 0 if told["ok"] == len(self.rows) else 3


def analyze_all(
    logs: Sequence[str],
    robot: str | None,
    out: Path,
    options: dict[str, Any],
    limits: Limits,
) -> Outcome:
    """Analyze recordings into folders below `out`; what is unchanged there is left alone.

    What they have in common goes into the folder `tables` and into `fleet.html`.

    Args:
        logs: as of `make_plan`.
        robot: of all, or None.
        out: folder of the results, the manifest and the log.
        options: of `touchline.report.analysis.analyze`.
        limits: of the processes.

    Raises:
        InputError: what was named cannot be used at all, or another process writes into `out`.
    """
    limits.check()
    plan = make_plan(logs, robot)
    # The lock of the folder: one such run at a time. Before anything is written there, the
    # cluster has answered.
    with limits.takers(len(plan)) as takers, ResultsFolder(out, ()) as folder:
        folder.draft.rmdir()
        manifest = Manifest(out)
        check_tables(out)
        with (out / JOURNAL).open("a", encoding="utf-8") as journal:
            outcome = _run(plan, manifest, journal, out, options, takers)
        manifest.close(recording.name for recording in plan)
        outcome.none = plan.none
        outcome.rows = [manifest.rows[r.name] for r in plan if r.name in manifest.rows]
        if not outcome.stopped:
            _tell(outcome.rows, out)
    return outcome


def _tell(rows: list[Row], out: Path) -> None:
    """Bring the figures of all recordings together."""
    figures = {row["name"]: _figures(out / row["name"], row) for row in rows if row["outputs"]}
    found = table_rows(figures)
    write_tables(out, found)
    write_page(out, rows, figures, found)


def _figures(folder: Path, row: Row) -> dict[str, Any]:
    path = folder / FIGURES
    if path.is_file():
        return json.loads(path.read_text(encoding="utf-8"))
    return make_figures(folder, row["robot"])  # results of an older version


def _run(
    plan: list[Recording],
    manifest: Manifest,
    journal: Any,
    out: Path,
    options: dict[str, Any],
    takers: Pool | Cluster,
) -> Outcome:
    outcome = Outcome()
    jobs, refused = _jobs(plan, manifest, out, options)
    for row in refused:
        manifest.add(row)
        _note(journal, row)
    try:
        with _bar(jobs) as bar:
            for row in takers.rows(jobs):
                if row.pop("unchanged", False):
                    outcome.unchanged.add(row["name"])
                else:
                    manifest.add(row)
                    _note(journal, row)
                bar.update(row["bytes"])
    except KeyboardInterrupt:
        outcome.stopped = True
    return outcome


def _jobs(
    plan: list[Recording], manifest: Manifest, out: Path, options: dict[str, Any]
) -> tuple[list[Job], list[Row]]:
    """What there is to do, the largest first so that no core waits at the end; and what is not."""
    hashes: dict[str, str] = {}
    problems: dict[str, str] = {}
    for robot in {recording.robot for recording in plan if not recording.problem}:
        try:
            hashes[robot] = configuration_hash(robot, options)
        except InputError as error:
            problems[robot] = error.problems[0]
    jobs, refused = [], []
    for recording in plan:
        known = manifest.rows.get(recording.name)
        job = Job(recording, out, hashes.get(recording.robot, ""), options, known)
        problem = recording.problem or problems.get(recording.robot, "")
        if problem:
            refused.append(blank(job, "skipped", problem))
        else:
            jobs.append(job)
    return sorted(jobs, key=lambda job: -job.recording.size), refused


def _note(journal: Any, row: Row) -> None:
    line = {"time": round(time.time(), 3)} | {k: row[k] for k in ("name", "status", "reason")}
    journal.write(json.dumps(line) + "\n")
    journal.flush()


def _bar(jobs: list[Job]) -> Any:
    from tqdm import tqdm

    total = sum(job.recording.size for job in jobs)
    form = "{desc} {percentage:3.0f} %|{bar}| {elapsed} (about {remaining} left)"
    return tqdm(total=total, desc="recordings", bar_format=form, disable=None, leave=False)


def outcome_text(outcome: Outcome, out: Path) -> str:
    """What became of the recordings: each that is not ok, and a line of sums."""
    lines = none_text(outcome.none) + [
        f"{row['status']:8} {row['name']}: {briefly(row['reason'], row['log'])}"
        for row in outcome.rows
        if row["status"] != "ok"
    ]
    told = Counter(row["status"] for row in outcome.rows)
    sums = ", ".join(f"{told[s]} {s}" for s in (*DONE, "failed", "skipped") if told[s])
    lasted = lasting(sum(row["duration"] for row in outcome.rows))
    events = sum(row["events"] for row in outcome.rows)
    if outcome.stopped:
        lines.append("stopped; the same command goes on")
    lines.append(
        f"{counted(len(outcome.rows), 'recording')} ({sums or 'none done'}), {lasted}, "
        f"{counted(events, 'event')}; "
        f"{len(outcome.unchanged)} unchanged; {out}/manifest.jsonl tells of each"
    )
    return "\n".join(lines)
