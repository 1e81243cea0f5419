# SPDX-License-Identifier: Apache-2.0
"""A folder of short recordings, some of them damaged in eight ways."""

import gzip
import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from touchline.bench.logs.run import motion
from touchline.logs import write_table
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

LENGTH = 400  # samples of each, at 1 kHz
DIFFERENT = 32  # recordings that differ; the others are copies of these
BOMB = 1 << 28  # bytes that a small compressed file claims to hold
# What must not pass for a good recording. Of numbers and stamps the health of samples tells.
UNREADABLE = frozenset({"truncated", "empty", "foreign", "joints", "bomb", "unreadable"})
DAMAGES = (*sorted(UNREADABLE), "nan", "stamps")


def make_recordings(folder: Path, robot: Robot, count: int, damaged: int) -> dict[str, str]:
    """Write `count` recordings into a folder, the last `damaged` of them damaged, way after way.

    Returns:
        Name of each -> how it is damaged, or "".
    """
    whole = []
    for number, samples in enumerate(_parts(motion(robot, LENGTH * DIFFERENT))):
        path = folder / f"r{number:05d}.parquet"
        write_table(path, samples, robot.description)
        whole.append(path.read_bytes())
        if number >= count - damaged:
            path.unlink()
    made = {}
    for number in range(count - damaged):
        name = f"r{number:05d}"
        (folder / f"{name}.parquet").write_bytes(whole[number % DIFFERENT])
        made[name] = ""
    spoilt = _damaged(folder, robot, motion(robot, LENGTH), whole[0])
    for number in range(damaged):
        way = DAMAGES[number % len(DAMAGES)]
        name = f"{way}{number:05d}"
        ending, content = spoilt[way]
        (folder / f"{name}{ending}").write_bytes(content)
        made[name] = way
    return made


def _parts(samples: Samples) -> list[Any]:
    names = ("time", "q", "qd", "tau", "wrench")
    return [
        Samples(*(getattr(samples, name)[first : first + LENGTH] for name in names))
        for first in range(0, len(samples), LENGTH)
    ]


def _damaged(
    folder: Path, robot: Robot, samples: Any, whole: bytes
) -> dict[str, tuple[str, bytes]]:
    """Way -> ending and content of a recording that is damaged so."""
    draft = folder / "draft.csv"

    def written(samples: Any, kind: str) -> bytes:
        path = draft.with_suffix(kind)
        write_table(path, samples, robot.description)
        content = path.read_bytes()
        path.unlink()
        return content

    first = robot.joint_names[0].encode()
    text = written(samples, ".csv").replace(b"q." + first, b"q.elsewhere", 1)
    late = samples.time.copy()
    late[LENGTH // 2 :] = 1e300
    return {
        "truncated": (".parquet", whole[: len(whole) // 2]),
        "empty": (".parquet", b""),
        "foreign": (".mcap", b"no recording" * 99),
        "joints": (".csv", text),
        "bomb": (".csv.gz", _bomb()),
        "unreadable": (".db3", b"SQLite format 3\0" + bytes(range(256)) * 40),
        "nan": (
            ".parquet",
            written(replace(samples, q=np.full_like(samples.q, np.nan)), ".parquet"),
        ),
        "stamps": (".parquet", written(replace(samples, time=late), ".parquet")),
    }


def _bomb() -> bytes:
    """Compressed zeros, written in pieces: they never stand in memory as a whole."""
    out, piece = io.BytesIO(), bytes(1 << 20)
    with gzip.GzipFile(fileobj=out, mode="wb", mtime=0, compresslevel=1) as file:
        for _ in range(BOMB // len(piece)):
            file.write(piece)
    return out.getvalue()
