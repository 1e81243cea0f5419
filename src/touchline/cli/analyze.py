# SPDX-License-Identifier: Apache-2.0
"""`touchline analyze`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg

from touchline.errors import InputError


def analyze(
    logs: Annotated[Positional[tuple[str, ...]], arg(metavar="LOG [LOG ...]")],
    /,
    out: Annotated[Path, arg(metavar="DIR")],
    robot: Annotated[str | None, arg(metavar="ROBOT")] = None,
    bandwidth: Annotated[float | None, arg(metavar="K")] = None,
    method: Literal["segment", "paper"] = "segment",
    report: Literal["full", "summary", "none"] = "full",
    friction: Annotated[float | None, arg(metavar="MU")] = None,
    reach: Annotated[float | None, arg(metavar="M")] = None,
    beside: Annotated[Path | None, arg(metavar="RESULTS")] = None,
    rerun: Annotated[Path | None, arg(metavar="FILE")] = None,
    foxglove: Annotated[Path | None, arg(metavar="FILE")] = None,
    dry_run: bool = False,
    workers: Annotated[int, arg(metavar="N")] = 0,
    time_limit: Annotated[float | None, arg(metavar="S")] = None,
    memory_limit: Annotated[float | None, arg(metavar="MB")] = None,
    cluster: Annotated[str | None, arg(metavar="ADDRESS")] = None,
) -> int:
    """Estimates external torques and wrenches in recordings and finds the contacts in them.

    Example: touchline analyze run1.parquet --robot robot.yaml --out results

    Writes into DIR estimates.parquet (a row per sample), contacts.parquet (a row per contact and
    sample), events.json (a list of contacts from beginning to end) and report.html. Open the report
    in a browser; it needs no network. For `touchline view DIR` it writes analysis.json (what the
    results were made from) and postures.parquet (joint positions, at most 100 a second). Prints a
    summary.
    Older results in DIR are replaced when the new ones are whole; other files in it are left alone.
    If it is stopped, the older results stay. The finished part of the new ones is in the folder
    touchline.unfinished: events.json, and Parquet files in estimates.parts and contacts.parts.

    Several recordings are analyzed by all cores, each into a folder of its own below DIR. Name
    them, or a folder, a pattern ("runs/*.mcap"), a URL (s3://, http://), or a list (CSV, Parquet)
    with the columns log and robot. Earlier results, robot.yaml, and files for viewers (.rrd, .mcap
    with scenes and no joint states) may stand among them: they are skipped. The page fleet.html
    there tells what they have in common, and so do tables as Parquet. The file manifest.jsonl tells
    what became of each and why: ok, partial (something in it could not be read), failed or skipped.
    It has hashes of input, configuration and results. The same command continues where it was
    stopped, and skips what is unchanged.
    Without --robot the robot.yaml in the recording's folder, or the nearest above it, is taken.
    Exit status then: 0 all ok, 3 some are not, 1 none.

    Args:
        logs: The recordings, or URLs of them: tables (.parquet, .csv, .csv.gz) or rosbag2 (.mcap,
            .db3, or its folder). Foreign column names are given in the robot description, key
            `log`.
        out: Directory for the results.
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        bandwidth: Bandwidth of the observer [rad/s]: a higher one is faster and noisier. Default:
            as described.
        method: segment: the momentum of each segment, without ghost contacts in motion; paper:
            each residual in its sensor's frame, as published.
        report: full; summary: without pictures and curves of each event; none: no report.html.
        friction: Coefficient of friction of what touches. Default: as described (`pushes`).
        reach: Free space that a push needs: length of a finger or tool [m]. Default: as described.
        beside: Results of another run or method: the report shows their curves, dashed, and events
            on the same time line. For one recording.
        rerun: Writes a file for Rerun (.rrd), too: arm, contacts, curves, events. For one
            recording.
        foxglove: Writes such a file for Foxglove (.mcap).
        dry_run: Print what would be done: files, hours, bytes, about how long, what is skipped.
        workers: Processes for several recordings. Default: one per core.
        time_limit: Time that each of several recordings may take [s].
        memory_limit: Memory that each process may take, of several recordings [MB].
        cluster: Address of a dask scheduler, such as tcp://host:8786, for several recordings. Its
            workers must see the same folders.
    """
    from touchline.fleet.forecast import forecast, forecast_text
    from touchline.fleet.plan import (
        ALLOWED,
        NO_ROBOT,
        is_single,
        make_plan,
        nearest_robot,
        why_not_recording,
    )

    if not logs:
        raise InputError("LOG: name at least one recording, folder, pattern or list")
    if dry_run:
        print(forecast_text(forecast(make_plan(logs, robot), out, report, workers)))
        return 0
    options = {"bandwidth": bandwidth, "method": method, "report": report}
    options |= {"friction": friction, "reach": reach}
    if is_single(logs):
        log = Path(logs[0])
        if reason := why_not_recording(logs[0]):
            raise InputError([f"{log}: {reason}", f"no recording: {ALLOWED}"])
        robot = robot or nearest_robot(log)
        if not robot:
            raise InputError(f"{log}: {NO_ROBOT}")
        return _one(log, robot, out, options | {"beside": beside}, Viewers(rerun, foxglove))
    if beside is not None:
        raise InputError("--beside: of one recording; analyze that one alone")
    if rerun is not None or foxglove is not None:
        raise InputError("--rerun, --foxglove: of one recording; analyze that one alone")
    from touchline.fleet.run import Limits

    return _several(logs, robot, out, options, Limits(workers, time_limit, memory_limit, cluster))


@dataclass(frozen=True)
class Viewers:
    """Files for other viewers, where they are wanted."""

    rerun: Path | None
    foxglove: Path | None

    def check(self, log: Path, out: Path) -> None:
        """Make sure, before the work begins, that they can be written."""
        from touchline.extras import need
        from touchline.folder import check_file
        from touchline.report.outputs import check_inputs

        for module, path in (("rerun", self.rerun), ("foxglove", self.foxglove)):
            if path is not None:
                check_inputs(out, path)
                if path.resolve() == log.resolve():
                    raise InputError(f"--{module} {path}: is the recording; choose another file")
                need(module)
                check_file(path)

    def write(self, out: Path, robot: str) -> None:
        """Write what is wanted of the results in `out`."""
        if self.rerun is None and self.foxglove is None:
            return
        from touchline.view.foxglove_file import write_foxglove
        from touchline.view.replay import Replay
        from touchline.view.rerun_file import write_rerun

        replay = Replay(out, robot)
        if self.rerun is not None:
            write_rerun(replay, self.rerun)
            print(f"for Rerun: {self.rerun}")
        if self.foxglove is not None:
            write_foxglove(replay, self.foxglove)
            print(f"for Foxglove: {self.foxglove}")


def _one(log: Path, robot: str, out: Path, options: dict[str, Any], viewers: Viewers) -> int:
    from touchline.report.analysis import analyze as run
    from touchline.report.summary import summary_text

    viewers.check(log, out)
    print(summary_text(run(log, robot, out, **options)))
    viewers.write(out, robot)
    return 0


def _several(
    logs: tuple[str, ...], robot: str | None, out: Path, options: dict[str, Any], limits: Any
) -> int:
    from touchline.fleet.run import analyze_all, outcome_text
    from touchline.report.analysis import check_options

    check_options(*(options[name] for name in ("bandwidth", "method", "friction", "reach")))
    outcome = analyze_all(logs, robot, out, options, limits)
    print(outcome_text(outcome, out))
    return outcome.status
