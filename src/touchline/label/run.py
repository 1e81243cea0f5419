# SPDX-License-Identifier: Apache-2.0
"""Labels a data set of any supported kind, and tells what its sample rate costs."""

import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

from touchline.check.felt import felt
from touchline.errors import InputError
from touchline.folder import check_file
from touchline.label.hdf5 import ENDINGS, label_hdf5
from touchline.label.labelled import Labelled
from touchline.label.lerobot import label_lerobot
from touchline.label.naming import Given
from touchline.label.table import label_table
from touchline.logs.dataset import is_lerobot, lerobot_of
from touchline.model.robot import Robot, load_robot
from touchline.numbers import counted, lasting

FAST = 1000.0  # samples per second, to which others are compared


def label(
    dataset: Path, robot: Robot | str, out: Path | None, given: Given, workers: int = 1
) -> Labelled:
    """Adds the touch channel to a data set.

    Args:
        dataset: a LeRobot data set (v3), an HDF5 or Parquet file, or a folder of such.
        robot: the robot, or what `load_robot` takes.
        out: for a copy that is labelled; None: in place.
        given: names and numbers from the user.
        workers: number of processes that label the files of a LeRobot data set.

    Raises:
        InputError: it cannot be used, or `out` exists.
    """
    given.check()
    if not dataset.exists():
        raise InputError(f"{dataset}: no such file")
    whole = lerobot_of(Path(os.path.abspath(dataset)).parent)
    if whole is not None:  # features of one part would be unknown to the others
        raise InputError(f"{dataset}: a part of the LeRobot data set {whole}; name that")
    robot = robot if isinstance(robot, Robot) else load_robot(robot)
    if out is None:
        return _in_place(dataset, robot, given, workers)
    if out.exists():
        raise InputError(f"--out {out}: exists already; name a new place")
    if dataset.is_file() and out.suffix != dataset.suffix:
        raise InputError(f"--out {out}: must end in {dataset.suffix!r}, as {dataset} does")
    draft = out.with_name(f".part.{out.name}")  # keeps the ending: it tells the kind
    if draft.is_dir():
        raise InputError(f"{draft}: left by a run that was killed, or one is at work; remove it")
    check_file(out, "--out")
    try:
        _copy(dataset, draft)
        try:
            done = _in_place(draft, robot, given, workers)
        except InputError as error:  # in the user's words: of the copy nothing is left
            told = [line.replace(str(draft), str(dataset)) for line in error.problems]
            raise InputError(told) from error
        draft.rename(out)
    finally:
        if draft.is_dir():
            shutil.rmtree(draft)
        draft.unlink(missing_ok=True)
    return done


def _copy(dataset: Path, draft: Path) -> None:
    """A copy that can be written, of what may be write-protected."""
    if not dataset.is_dir():
        shutil.copyfile(dataset, draft)
        return
    try:
        shutil.copytree(dataset, draft, copy_function=shutil.copyfile)
    finally:
        for folder, _, _ in os.walk(draft):
            os.chmod(folder, os.stat(folder).st_mode | stat.S_IRWXU)


def _in_place(path: Path, robot: Robot, given: Given, workers: int) -> Labelled:
    if path.is_dir() and is_lerobot(path):
        return label_lerobot(path, robot, given, workers)
    if not path.is_dir():
        kind = _kind(path)
        check_file(path)
        return kind(path, robot, given)
    files = [f for f in sorted(path.rglob("*")) if f.suffix in (*ENDINGS, ".parquet")]
    if not files:
        raise InputError(f"{path}: neither a LeRobot data set nor HDF5 or Parquet files")
    for file in files:  # the last one, too, before the first is replaced
        check_file(file)
    done: Labelled | None = None
    for file in files:
        one = _kind(file)(file, robot, given)
        if done is None:
            done = one
        else:
            done += one
    assert done is not None
    return done


def _kind(path: Path) -> Callable[[Path, Robot, Given], Labelled]:
    if path.suffix in ENDINGS:
        return label_hdf5
    if path.suffix == ".parquet":
        return label_table
    raise InputError(f"{path}: must be a LeRobot data set, or end in .parquet, .h5 or .hdf5")


def labelled_text(done: Labelled, robot: Robot) -> str:
    """What was added, and what the rate of the data set costs."""
    share = 100.0 * done.touched / done.samples if done.samples else 0.0
    lines = [
        f"{counted(done.episodes, 'episode')}, {done.samples} samples at {done.rate:.4g} Hz "
        f"({lasting(done.seconds)}): {counted(done.touches, 'touch', 'es')}, "
        f"{share:.1f} % of the samples"
    ]
    slow, fast = (_forces(robot, rate) for rate in (done.rate, FAST))
    if slow:
        line = f"At {done.rate:.4g} Hz 95 % of the pushes are felt from {slow}"
        line += f" (at {FAST:g} Hz {fast})" if done.rate < FAST else ""
        lines.append(f"{line}; a touch shorter than {2e3 / done.rate:.3g} ms may pass unnoticed.")
    return "\n".join(lines)


def _forces(robot: Robot, rate: float) -> str:
    forces = [f.force for f in felt(robot, 1.0 / rate) if f.segment and f.force < float("inf")]
    if not forces:
        return ""
    low, high = min(forces), max(forces)
    return f"{low:.3g} N" if low == high else f"{low:.3g} to {high:.3g} N, by link"
