# SPDX-License-Identifier: Apache-2.0
"""HDF5 files of episodes, as of DROID (one a file) or robomimic (groups below `data`)."""

import contextlib
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.extras import need
from touchline.folder import replaced_file
from touchline.label.channel import BEFORE, LEVELS, Channel, Feeler, episode_samples
from touchline.label.labelled import Labelled
from touchline.label.naming import KNOWN, Given, choose
from touchline.logs.period import typical_period
from touchline.model.robot import Robot

ENDINGS = (".h5", ".hdf5")
GROUP = "touch"
MILLISECONDS = 1e-3  # of the stamps of DROID [s]
CLAIMED = 100e6  # bytes of an array that are always believed
MOST_PACKED = 1000.0  # times smaller than its numbers is no recording, however still the arm stands
# h5py raises these of a damaged file, by where the damage is.
UNREADABLE = (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError, OverflowError)


def label_hdf5(path: Path, robot: Robot, given: Given) -> Labelled:
    """Adds a group `touch` beside the observations of each episode, in place.

    The file is replaced as a whole; everything else in it stays as it is.

    Raises:
        InputError: it is damaged, or lacks what is needed.
    """
    h5py = need("h5py")
    with replaced_file(path) as draft:
        shutil.copyfile(path, draft)
        with _refusing(path):
            file = h5py.File(draft, "r+", locking=False)  # the draft is locked already
        try:
            return _label(path, file, robot, given, h5py)
        finally:
            with _refusing(path):
                file.close()


@contextlib.contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """What h5py raises of a damaged file, in words."""
    try:
        yield
    except InputError:
        raise
    except UNREADABLE as error:
        reason = " ".join(str(error).strip("'\"").split())
        raise InputError(f"{path}: not a readable HDF5 file: {reason}") from error


def _label(path: Path, file: Any, robot: Robot, given: Given, h5py: Any) -> Labelled:
    done: Labelled | None = None
    feeler: Feeler | None = None
    with _refusing(path):
        episodes = _episodes(file, h5py)
    for episode in episodes:
        with _refusing(path):
            widths: dict[str, int] = {}
            episode.visititems(lambda name, item, found=widths: _note(found, name, item, h5py))
            names = choose(path, given, widths, robot.description)
            signals = {signal: _numbers(path, episode[name]) for signal, name in names.items()}
            time = _time(path, episode, len(signals["q"]), given)
        if feeler is None or done is None:
            period = 1.0 / given.rate if given.rate else typical_period(time)
            feeler, done = Feeler(robot, period, given.bandwidth), Labelled(1.0 / period)
        arrays = [signals.get(signal) for signal in ("qd", "tau", "wrench")]
        if any(a is not None and len(a) != len(time) for a in (signals["q"], *arrays)):
            raise InputError(f"{path}: {episode.name}: arrays of different lengths")
        samples = episode_samples(path, robot.description, time, signals["q"], *arrays)
        channel = feeler.feel(samples)
        done.add(channel, len(time) * feeler.period)
        with _refusing(path):
            parent = episode[names["q"].split("/")[0]] if "/" in names["q"] else episode
            _write(parent, channel, feeler.links)
    if done is None:
        raise InputError(f"{path}: holds no episodes")
    return done


def _write(parent: Any, channel: Channel, links: tuple[str, ...]) -> None:
    if GROUP in parent:
        del parent[GROUP]
    group = parent.create_group(GROUP)
    for name, values in channel.columns().items():
        group[name] = values
    group.attrs["links"] = json.dumps(links)
    group.attrs["levels"] = json.dumps(LEVELS)
    group.attrs["soon_seconds"] = BEFORE


def _episodes(file: Any, h5py: Any) -> list[Any]:
    data = file.get("data")
    if isinstance(data, h5py.Group):
        return [data[name] for name in sorted(data) if isinstance(data[name], h5py.Group)]
    return [file]


def _numbers(path: Path, stored: Any) -> Array:
    """All numbers of an array; one that claims far more than it holds is refused unread."""
    claimed, held = stored.size * stored.dtype.itemsize, stored.id.get_storage_size()
    if claimed > CLAIMED and claimed > MOST_PACKED * held:
        raise InputError(
            f"{path}: {stored.name}: claims {claimed / 1e6:.0f} MB and holds {held / 1e6:.1f}"
        )
    return np.asarray(stored, float)


def _note(found: dict[str, int], name: str, item: Any, h5py: Any) -> None:
    if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and item.ndim == 2:
        found[name] = item.shape[1]


def _time(path: Path, episode: Any, count: int, given: Given) -> np.ndarray:
    """Stamps from the first sample [s]: even at a rate that was given, else those of the file."""
    if given.rate:
        return np.arange(count) / given.rate
    for name in KNOWN["time"]:
        if name in episode:
            stamps = _numbers(path, episode[name])
            return (stamps - stamps[0]) * MILLISECONDS if len(stamps) else stamps
    raise InputError(f"{path}: no time stamps: give the samples per second by --rate")
