# SPDX-License-Identifier: Apache-2.0
"""What became of each recording: a line of JSON in `manifest.jsonl`."""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from touchline import __version__
from touchline.errors import InputError
from touchline.folder import replaced_file
from touchline.model.robot import load_robot

MANIFEST = "manifest.jsonl"
JOURNAL = "log.jsonl"  # beside it: a line for each recording that a run is done with
Row = dict[str, Any]


class Manifest:
    """The rows of a folder of results, one per recording, by its name.

    While recordings are analyzed rows are appended, each in one write, so that a kill costs at most
    the one in progress; at the end the file is written anew with one row per recording.
    """

    def __init__(self, folder: Path) -> None:
        """Read what an earlier run has left; a line that is not whole does not count.

        Raises:
            InputError: another program wrote it.
        """
        self.path = folder / MANIFEST
        self.rows: dict[str, Row] = {}
        if self.path.is_file():
            for line in self.path.read_text(encoding="utf-8", errors="replace").splitlines():
                try:
                    row = json.loads(line)
                except ValueError:
                    continue
                if not isinstance(row, dict) or not {"name", "status"} <= row.keys():
                    raise InputError(f"{self.path}: not by Touchline; choose another --out")
                self.rows[str(row["name"])] = row

    def add(self, row: Row) -> None:
        """Take the row of a recording that is done."""
        self.rows[row["name"]] = row
        # A line that a kill has cut off must not swallow this one.
        with self.path.open("ab") as file:
            file.write(b"\n" + _line(row).encode())

    def close(self, names: Iterable[str]) -> None:
        """Write the rows of these recordings, in their order, and no others."""
        with replaced_file(self.path) as draft:
            text = "".join(_line(self.rows[name]) for name in names if name in self.rows)
            draft.write_text(text, encoding="utf-8")


def _line(row: Row) -> str:
    return json.dumps(row, allow_nan=False) + "\n"


def file_hash(path: Path) -> str:
    """Hash of a file, or of all files in a folder."""
    digest = hashlib.blake2b(digest_size=16)
    files = sorted(f for f in path.iterdir() if f.is_file()) if path.is_dir() else [path]
    for file in files:
        if path.is_dir():
            digest.update(file.name.encode() + b"\0")
        with file.open("rb") as stream:
            while piece := stream.read(1 << 20):
                digest.update(piece)
    return digest.hexdigest()


def configuration_hash(robot: str, options: dict[str, Any]) -> str:
    """Hash of all that the results depend on but the recording: the robot and the options.

    Raises:
        InputError: the robot cannot be loaded.
    """
    model = load_robot(robot)
    description = model.description
    learned = {joint.name: joint.rest for joint in description.joints if joint.rest is not None}
    digest = hashlib.blake2b(digest_size=16)
    told = [__version__, options, {name: vars(rest) for name, rest in learned.items()}]
    digest.update(json.dumps(told, sort_keys=True).encode())
    shapes = (s for link in model.mechanism.links.values() for s in (*link.visual, *link.collision))
    meshes = sorted({shape.path for shape in shapes if shape.path is not None})
    for path in (description.path, description.model, *meshes):
        if path is not None and Path(path).is_file():
            digest.update(Path(path).read_bytes())
    return digest.hexdigest()


def stands(row: Row, folder: Path) -> bool:
    """Whether the results that a row tells of are still what they were."""
    outputs = row.get("outputs")
    if not isinstance(outputs, dict) or not outputs:
        return False
    files = {folder / row["name"] / name: told for name, told in outputs.items()}
    return all(path.is_file() and file_hash(path) == told for path, told in files.items())
