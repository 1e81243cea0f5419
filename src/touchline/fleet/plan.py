# SPDX-License-Identifier: Apache-2.0
"""Which recordings are to be analyzed, with which robots, and where their results go."""

import csv
import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from touchline.errors import InputError
from touchline.fleet.own import OWN, ROBOT_FILE, is_result, why_none
from touchline.fleet.remote import found, is_result_there, is_url
from touchline.logs.dataset import is_lerobot, lerobot_of
from touchline.logs.log import BAGS, TABLES
from touchline.logs.parquet import column_names, damages, first_line

LOG_COLUMN, ROBOT_COLUMN = "log", "robot"
ENDINGS = (*TABLES, *BAGS)
ALLOWED = (
    f"name recordings ({', '.join(ENDINGS)}, or the folder of a rosbag2), folders or patterns of "
    f"these, or lists (CSV, Parquet) with a column {LOG_COLUMN}"
)
NO_ROBOT = f"no robot: give --robot, or put a {ROBOT_FILE} beside it"


@dataclass(frozen=True)
class Recording:
    """One recording to analyze.

    Attributes:
        log: its file, or the folder of a rosbag2; of a URL only the name.
        robot: name or description of the robot; empty where none is known.
        name: of its results, a path below the folder of all.
        size: of its files [bytes].
        problem: why it is not analyzed, or empty.
        url: where it is, if not on this machine.
    """

    log: Path
    robot: str
    name: str
    size: int
    problem: str = ""
    url: str = ""

    @property
    def source(self) -> str:
        """Where it is."""
        return self.url or str(self.log)


class Plan(list[Recording]):
    """Recordings in a fixed order, each once.

    Attributes:
        none: what was named, or stands beside them, and is no recording, with the reason.
    """

    def __init__(self, recordings: Iterable[Recording], none: dict[str, str]) -> None:
        super().__init__(recordings)
        self.none = none


def none_text(none: dict[str, str]) -> list[str]:
    """A line for each reason why something is no recording."""
    names: dict[str, list[str]] = {}
    for name, reason in none.items():
        names.setdefault(reason, []).append(name)
    return [f"{'skipped':8} {', '.join(found)}: {reason}" for reason, found in names.items()]


def briefly(reason: str, source: str) -> str:
    """A reason without the place of the recording, whose name stands beside it."""
    return reason.removeprefix(f"{source}: ")


def is_single(logs: Sequence[str]) -> bool:
    """Whether what was named is one recording, and neither a folder of several nor a list."""
    if len(logs) != 1 or is_url(logs[0]) or glob.has_magic(logs[0]) and not Path(logs[0]).exists():
        return False
    path = Path(logs[0])
    return _is_bag_folder(path) or not path.is_dir() and not _is_list(path)


def make_plan(logs: Sequence[str], robot: str | None) -> Plan:
    """All recordings that were named, in a fixed order, each once.

    Args:
        logs: files, folders, patterns such as `runs/*.mcap`, CSV or Parquet lists with the columns
            `log` and `robot` (paths in a list count from where it is), or URLs of files, folders
            and patterns.
        robot: of all; default: what a list says, else the `robot.yaml` in the recording's folder
            or the nearest above it.

    Raises:
        InputError: something does not exist, or there is no recording.
    """
    none: dict[str, str] = {}  # what is no recording -> the reason
    local: dict[Path, tuple[str, str]] = {}  # log -> robot, problem
    targets: set[Path] = set()  # of links, so that no recording comes twice
    remote: dict[str, tuple[int, str]] = {}  # URL -> size, robot
    for word in logs:
        if reason := why_not_recording(word):
            none[word] = reason
            continue
        for log, own in _named(word):
            if is_url(log):
                there = found(log, ENDINGS)
                remote |= {url: (size, robot or own) for url, size in there}
                continue
            # A link keeps its own name: what it leads to may be called by its hash alone.
            path = Path(os.path.abspath(log))
            if path.resolve() in targets:
                continue
            targets.add(path.resolve())
            if reason := why_none(path):
                none[log] = reason
                continue
            chosen = robot or own or nearest_robot(path)
            local[path] = (chosen, "" if chosen else NO_ROBOT)
    if not local and not remote:
        problems = [f"{name}: {reason}" for name, reason in none.items()]
        told = [f"no recordings: {ALLOWED}"]
        raise InputError([*(problems or [f"{', '.join(logs)}: no recordings there"]), *told])
    paths = {url: _as_path(url) for url in remote}
    names = _names([*local, *paths.values()])
    plan = []
    for log, (chosen, problem) in local.items():
        if not problem and not log.exists():
            problem = "a link that leads nowhere" if log.is_symlink() else "no such file"
        plan.append(Recording(log, chosen, names[log], _size(log), problem))
    for url, (size, chosen) in remote.items():
        problem = "" if chosen else NO_ROBOT
        plan.append(Recording(paths[url], chosen, names[paths[url]], size, problem, url))
    return Plan(sorted(plan, key=lambda recording: recording.name), none)


def why_not_recording(word: str) -> str:
    """Why a word of the command line names no recording but what stands beside some, or nothing."""
    if is_url(word):
        return OWN if is_result_there(word) else ""
    return why_none(Path(word)) if Path(word).exists() else ""


def _as_path(url: str) -> Path:
    """A path that stands for a URL where names are made: never one on this machine."""
    kind, _, rest = url.partition("://")
    return Path(f"/{kind}:") / rest.lstrip("/")


def _named(word: str) -> Iterator[tuple[str, str]]:
    """Recordings that one word of the command line names, and their robots."""
    if is_url(word):
        yield word, ""
        return
    path = Path(word)
    if not path.exists():
        matches = sorted(glob.glob(word, recursive=True)) if glob.has_magic(word) else []
        if not matches:
            raise InputError(f"{word}: no such file" + (" matches" if glob.has_magic(word) else ""))
        # Of a data set only itself is told, not each of its files.
        for match in dict.fromkeys(lerobot_of(Path(m)) or Path(m) for m in matches):
            if (match.is_dir() or _is_log(match)) and not is_result(match):
                yield from _named(str(match))
    elif path.is_dir() and not _is_bag_folder(path) and not is_lerobot(path):
        for log in _below(path):
            yield str(log), ""
    elif _is_list(path):
        yield from _listed(path)
    else:
        yield word, ""


def _below(folder: Path) -> Iterator[Path]:
    """Recordings in a folder and the folders in it, without results of earlier analyses."""
    for path in sorted(folder.iterdir()):
        hidden = path.name.startswith(".") or path.name.endswith(".parts")
        if hidden or is_result(path):
            continue
        if path.is_dir():
            if _is_bag_folder(path) or is_lerobot(path):  # of the latter the reason is told
                yield path
            else:
                yield from _below(path)
        elif _is_log(path) and not _is_list(path):
            yield path


def _is_log(path: Path) -> bool:
    return path.name.lower().endswith(ENDINGS)


def _is_bag_folder(path: Path) -> bool:
    return path.is_dir() and (path / "metadata.yaml").is_file()


def _is_list(path: Path) -> bool:
    """Whether a table is a list of recordings and not one itself."""
    if not path.is_file():
        return False
    if path.suffix.lower() == ".parquet":
        return LOG_COLUMN in column_names(path)
    if path.suffix.lower() != ".csv":
        return False
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            head = next(csv.reader([file.readline(1 << 16)]), [])
    except (OSError, UnicodeDecodeError, csv.Error):
        return False
    return LOG_COLUMN in [name.strip() for name in head]


def _listed(path: Path) -> Iterator[tuple[str, str]]:
    for place, row in _list_rows(path):
        log = str(row.get(LOG_COLUMN) or "").strip()
        if not log:
            raise InputError(f"{path}: {place}: names no {LOG_COLUMN}")
        robot = str(row.get(ROBOT_COLUMN) or "").strip()
        beside = path.parent / robot
        source = log if is_url(log) else str(path.parent / log)
        yield source, str(beside) if robot and beside.is_file() else robot


def _list_rows(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Rows of a list, and where each stands."""
    if path.suffix.lower() == ".parquet":
        import pyarrow.parquet as pq

        columns = [c for c in (LOG_COLUMN, ROBOT_COLUMN) if c in column_names(path)]
        try:
            rows = pq.read_table(path, columns=columns).to_pylist()
        except damages() as error:
            raise InputError(f"{path}: damaged: {first_line(error)}") from error
        for number, row in enumerate(rows, 1):
            yield f"row {number}", row
        return
    with path.open(encoding="utf-8-sig", newline="") as file:
        for number, row in enumerate(csv.DictReader(file, skipinitialspace=True), 2):
            yield f"line {number}", row


def nearest_robot(log: Path) -> str:
    """The `robot.yaml` in a recording's folder or the nearest above it; empty where none is."""
    log = Path(os.path.abspath(log))
    for folder in (*log.parents, *log.resolve().parents):
        if (folder / ROBOT_FILE).is_file():
            return str(folder / ROBOT_FILE)
    return ""


def _names(logs: list[Path]) -> dict[Path, str]:
    """Names for the results: paths below what all recordings share, no two the same."""
    shared = logs[0].parent
    while not all(log.is_relative_to(shared) for log in logs):
        shared = shared.parent
    names: dict[Path, str] = {}
    taken: set[str] = set()
    for log in sorted(logs):
        relative = log.relative_to(shared)
        short = relative.as_posix()
        for ending in sorted(ENDINGS, key=len, reverse=True):
            short = short.removesuffix(ending)
        name = short if short and short not in taken else relative.as_posix().replace(".", "_")
        while name in taken:
            name += "_"
        taken.add(name)
        names[log] = name
    return names


def _size(log: Path) -> int:
    if log.is_dir():
        return sum(file.stat().st_size for file in log.iterdir() if file.is_file())
    return log.stat().st_size if log.exists() else 0
