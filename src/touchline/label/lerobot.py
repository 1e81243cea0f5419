# SPDX-License-Identifier: Apache-2.0
"""LeRobot data sets, version 3: Parquet files of many episodes, described in `meta/info.json`."""

import atexit
import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline import __version__
from touchline.arrays import Array
from touchline.errors import InputError
from touchline.folder import check_file, replaced_file
from touchline.label.channel import BEFORE, LEVELS, Channel, Feeler, episode_samples, parts
from touchline.label.labelled import Labelled
from touchline.label.naming import Given, choose
from touchline.logs.dataset import INFO
from touchline.logs.parquet import damages, first_line
from touchline.model.robot import Robot
from touchline.workers import workers

STATS, ABOUT = "meta/stats.json", "meta/touchline.json"
PREFIX = "observation.touch."
NUMBERS = ("float32", "float64", "int32", "int64")


def label_lerobot(path: Path, robot: Robot, given: Given, workers: int = 1) -> Labelled:
    """Adds the features `observation.touch.*` to a data set, in place; the rest stays as it is.

    Each file is replaced as a whole. Labelled data sets may be labelled again.

    Args:
        path: of the data set.
        robot: the robot.
        given: names and numbers from the user.
        workers: number of processes; the results do not depend on it.

    Raises:
        InputError: it is damaged, of another version, or lacks what is needed.
    """
    info = _read_json(path / INFO)
    version = str(info.get("codebase_version", ""))
    if not version.startswith("v3"):
        raise InputError(
            f"{path / INFO}: codebase_version is {version!r}, but v3.x is needed; "
            "lerobot converts older data sets"
        )
    features = info.get("features")
    if not isinstance(features, dict):
        raise InputError(f"{path / INFO}: features is missing")
    rate = given.rate or info.get("fps")
    if not isinstance(rate, int | float) or not rate > 0:
        raise InputError(f"{path / INFO}: fps is {rate!r}, but must be a positive number")
    names = choose(path, given, _widths(features), robot.description)
    files = sorted((path / "data").glob("**/*.parquet"))
    if not files:
        raise InputError(f"{path / 'data'}: no Parquet files")
    for file in (*files, path / INFO):  # before the first is replaced
        check_file(file)
    task = _Task(robot, float(rate), given.bandwidth, names)
    done, spread, links = Labelled(rate=float(rate)), _Spread(), tuple[str, ...]()
    with _hands(task, min(workers, len(files))) as label_all:
        for counted, spread_of, named in label_all(files):
            done += counted
            spread.merge(spread_of)
            links = named
    stats = path / STATS
    if stats.is_file():
        _write_json(stats, _without_touch(_read_json(stats)) | spread.as_json())
    about = {"touchline": __version__, "robot": robot.name, "links": links}
    about |= {"levels": LEVELS, "soon_seconds": BEFORE, "rate": rate, "signals": names}
    _write_json(path / ABOUT, about)
    info["features"] = _without_touch(features) | _features(robot)
    _write_json(path / INFO, info)
    return done


@dataclass(frozen=True)
class _Task:
    """What is to be done with each file."""

    robot: Robot
    rate: float
    bandwidth: float | None
    names: dict[str, str]


class _Hand:
    """Labels files, one after another."""

    def __init__(self, task: _Task) -> None:
        self._names, self._rate = task.names, task.rate
        self._feeler = Feeler(task.robot, 1.0 / task.rate, task.bandwidth)

    def label(self, file: Path) -> tuple[Labelled, "_Spread", tuple[str, ...]]:
        """Label a file; what there was to count, and the links that `link` numbers."""
        done, spread = Labelled(rate=self._rate), _Spread()
        _label_file(file, self._feeler, self._names, done, spread)
        return done, spread, self._feeler.links


_HANDS: list[_Hand] = []  # the one of this process, where it is one of several


def _begin(task: _Task) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asks sees to it
    _HANDS.append(_Hand(task))
    atexit.register(_HANDS.clear)  # before native types go


def _label_here(file: Path) -> tuple[Labelled, "_Spread", tuple[str, ...]]:
    return _HANDS[0].label(file)


@contextmanager
def _hands(task: _Task, count: int) -> Iterator[Callable[[list[Path]], Iterator[Any]]]:
    """What labels files, in this process or in several; it answers in the order of the files."""
    if count <= 1:
        hand = _Hand(task)
        yield lambda files: map(hand.label, files)
        return
    with workers(count, _begin, task) as pool:
        yield lambda files: pool.map(_label_here, files)


def _label_file(
    file: Path, feeler: Feeler, names: dict[str, str], done: Labelled, spread: "_Spread"
) -> None:
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(file) as opened:
            table, metadata = opened.read(), opened.metadata
            groups = [metadata.row_group(g).num_rows for g in range(metadata.num_row_groups)]
            codec = metadata.row_group(0).column(0).compression if groups else "SNAPPY"
    except damages() as error:
        raise InputError(f"{file}: not a readable Parquet file: {first_line(error)}") from error
    for column in ("episode_index", "timestamp", *names.values()):
        if column not in table.column_names:
            raise InputError(f"{file}: column {column!r} is missing")
    table = table.drop_columns([n for n in table.column_names if n.startswith(PREFIX)])
    episodes = table["episode_index"].to_numpy()
    cuts = [0, *(np.flatnonzero(np.diff(episodes)) + 1), len(episodes)] if len(episodes) else []
    time = table["timestamp"].to_numpy().astype(float)
    signals = {signal: _numbers(table[name], f"{file}: {name}") for signal, name in names.items()}
    felt = []
    for begin, end in zip(cuts[:-1], cuts[1:], strict=True):
        own = {signal: values[begin:end] for signal, values in signals.items()}
        arrays = [own.get(signal) for signal in ("qd", "tau", "wrench")]
        description = feeler.robot.description
        samples = episode_samples(file, description, time[begin:end], own["q"], *arrays)
        channel = feeler.feel(samples)
        done.add(channel, (end - begin) * feeler.period)
        felt.append(channel)
    for name in Channel.__annotations__:
        values = np.concatenate([getattr(c, name) for c in felt]) if felt else np.zeros(0)
        spread.add(name, values)
        table = table.append_column(PREFIX + name, _column(values))
    with (
        replaced_file(file) as draft,
        pq.ParquetWriter(draft, table.schema, compression=codec.lower()) as writer,
    ):
        begin = 0
        for rows in groups:
            writer.write_table(table.slice(begin, rows))
            begin += rows


def _widths(features: dict[str, Any]) -> dict[str, int]:
    """Features of numbers in a row."""
    found = {}
    for name, feature in features.items():
        shape = feature.get("shape") if isinstance(feature, dict) else None
        if not (isinstance(shape, list) and len(shape) == 1 and isinstance(shape[0], int)):
            continue
        if feature.get("dtype") in NUMBERS:
            found[name] = shape[0]
    return found


def _without_touch(entries: dict[str, Any]) -> dict[str, Any]:
    return {name: entry for name, entry in entries.items() if not name.startswith(PREFIX)}


def _features(robot: Robot) -> dict[str, Any]:
    kinds = {"contact": "bool", "soon": "bool", "link": "int64", "level": "int64"}
    kinds["health"] = "int64"
    return {
        PREFIX + name: {
            "dtype": kinds.get(name, "float32"),
            "shape": [len(words)],
            "names": list(words),
        }
        for name, words in parts(robot).items()
    }


def _numbers(column: Any, where: str) -> Array:
    """(N, w) of a column of lists; (N, 1) of one of numbers."""
    import pyarrow as pa

    array = column.combine_chunks()
    if isinstance(array, pa.ChunkedArray):
        array = pa.concat_arrays(array.chunks) if array.num_chunks else pa.array([], pa.float64())
    count = len(array)
    if array.null_count:
        raise InputError(f"{where}: {array.null_count} rows are empty")
    kind = array.type
    lists = (
        pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    )
    if pa.types.is_nested(kind) and not lists:
        raise InputError(f"{where}: holds {kind}, not lists of numbers")
    flat = array.flatten() if lists else array
    values = np.asarray(flat.to_numpy(zero_copy_only=False), dtype=float)
    if count and len(values) % count:
        raise InputError(f"{where}: rows of different lengths")
    return values.reshape(count, -1) if count else values.reshape(0, 1)


def _column(values: NDArray) -> Any:
    import pyarrow as pa

    if values.ndim == 1:
        return pa.array(values)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


class _Spread:
    """Least, largest, mean and standard deviation of each feature, for `meta/stats.json`."""

    def __init__(self) -> None:
        self._sums: dict[str, list[NDArray]] = {}

    def add(self, name: str, values: NDArray) -> None:
        """Take N rows; what is not finite does not count."""
        if not len(values):
            return
        x = values.reshape(len(values), -1).astype(float)
        known = np.isfinite(x)
        clean = np.where(known, x, 0.0)
        new = [
            np.where(known, x, np.inf).min(0),
            np.where(known, x, -np.inf).max(0),
            clean.sum(0),
            (clean**2).sum(0),
            known.sum(0),
        ]
        self._join(name, new)

    def merge(self, other: "_Spread") -> None:
        """Take all that another one has taken."""
        for name, new in other._sums.items():
            self._join(name, new)

    def _join(self, name: str, new: list[NDArray]) -> None:
        old = self._sums.get(name)
        if old is not None:
            joined = [np.minimum(old[0], new[0]), np.maximum(old[1], new[1])]
            new = [*joined, *(a + b for a, b in zip(old[2:], new[2:], strict=True))]
        self._sums[name] = new

    def as_json(self) -> dict[str, Any]:
        """One entry per feature."""
        told = {}
        for name, (low, high, total, squares, count) in self._sums.items():
            number = np.maximum(count, 1)
            mean = total / number
            std = np.sqrt(np.maximum(squares / number - mean**2, 0.0))
            some = count > 0
            entry = {"min": np.where(some, low, 0.0), "max": np.where(some, high, 0.0)}
            entry |= {"mean": mean, "std": std}
            told[PREFIX + name] = {key: value.tolist() for key, value in entry.items()}
            told[PREFIX + name]["count"] = [int(count.max())]
        return told


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not readable JSON: {error}") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: must be a mapping")
    return content


def _write_json(path: Path, content: dict[str, Any]) -> None:
    with replaced_file(path) as draft:
        draft.write_text(json.dumps(content, indent=4) + "\n", encoding="utf-8")
