# SPDX-License-Identifier: Apache-2.0
"""HDF5 files of episodes, as of DROID (one a file) or robomimic (groups below `data`)."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from touchline.errors import InputError
from touchline.extras import need
from touchline.folder import replaced_file
from touchline.label.channel import BEFORE, LEVELS, Feeler, episode_samples
from touchline.label.labelled import Labelled
from touchline.label.naming import KNOWN, Given, choose
from touchline.logs.period import typical_period
from touchline.model.robot import Robot

ENDINGS = (".h5", ".hdf5")
GROUP = "touch"
MILLISECONDS = 1e-3  # of the stamps of DROID [s]


def label_hdf5(path: Path, robot: Robot, given: Given) -> Labelled:
    """Adds a group `touch` beside the observations of each episode, in place.

    The file is replaced as a whole; everything else in it stays as it is.

    Raises:
        InputError: it is damaged, or lacks what is needed.
    """
    h5py = need("h5py")
    with replaced_file(path) as draft:
        shutil.copyfile(path, draft)
        try:
            with h5py.File(draft, "r+", locking=False) as file:  # the draft is locked already
                done = _label(path, file, robot, given, h5py)
        except OSError as error:
            raise InputError(f"{path}: not a readable HDF5 file: {error}") from error
    return done


def _label(path: Path, file: Any, robot: Robot, given: Given, h5py: Any) -> Labelled:
    data = file.get("data")
    episodes = [file]
    if isinstance(data, h5py.Group):
        episodes = [data[name] for name in sorted(data) if isinstance(data[name], h5py.Group)]
    done: Labelled | None = None
    feeler: Feeler | None = None
    for episode in episodes:
        widths: dict[str, int] = {}
        episode.visititems(lambda name, item, found=widths: _note(found, name, item, h5py))
        names = choose(path, given, widths, robot.description)
        signals = {s: np.asarray(episode[name], float) for s, name in names.items()}
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
        parent = episode[names["q"].split("/")[0]] if "/" in names["q"] else episode
        if GROUP in parent:
            del parent[GROUP]
        group = parent.create_group(GROUP)
        for name, values in channel.columns().items():
            group[name] = values
        group.attrs["links"] = json.dumps(feeler.links)
        group.attrs["levels"] = json.dumps(LEVELS)
        group.attrs["soon_seconds"] = BEFORE
    if done is None:
        raise InputError(f"{path}: holds no episodes")
    return done


def _note(found: dict[str, int], name: str, item: Any, h5py: Any) -> None:
    if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and item.ndim == 2:
        found[name] = item.shape[1]


def _time(path: Path, episode: Any, count: int, given: Given) -> np.ndarray:
    """Stamps from the first sample [s]: even at a rate that was given, else those of the file."""
    if given.rate:
        return np.arange(count) / given.rate
    for name in KNOWN["time"]:
        if name in episode:
            stamps = np.asarray(episode[name], float)
            return (stamps - stamps[0]) * MILLISECONDS if len(stamps) else stamps
    raise InputError(f"{path}: no time stamps: give the samples per second by --rate")
