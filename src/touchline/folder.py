# SPDX-License-Identifier: Apache-2.0
"""Folders and files that results go into: replaced as a whole, or not at all."""

import errno
import json
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

from touchline.errors import InputError

UNFINISHED = "touchline.unfinished"  # in it a run writes; what a killed one leaves is there
FINISHED = ".touchline.finished"  # whole results on their way into the folder
CONTENTS = ".contents.json"  # in FINISHED: the names of the new results


def make_folder(path: Path) -> Path:
    """Makes sure that a folder exists.

    Raises:
        InputError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be used as a directory: {error.strerror}") from error
    return path


class ResultsFolder:
    """A folder whose results are replaced together, once the new ones are whole.

    A run writes into `draft`; `commit` puts what is there in the place of the older results.
    Whenever a run is killed, the older results stand, or the next `settle` finishes the move.
    One process at a time may hold the folder. Other files in it stay as they are.

    Args:
        path: of the folder; it is made.
        names: of all files that results may consist of; those that a new run does not write are
            removed with the older ones.

    Attributes:
        draft: the folder that a run writes into.

    Raises:
        InputError: it is a file, cannot be written, or another process writes into it.
    """

    def __init__(self, path: Path, names: Collection[str]) -> None:
        self.path, self.draft = path, path / UNFINISHED
        self._names = tuple(names)
        if path.exists() and not path.is_dir():
            raise InputError(f"--out {path}: is a file; a directory is needed")
        self._lock: int | None = None
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock = _locked(path, f"--out {path}")
            settle(path)
            if self.draft.exists():
                shutil.rmtree(self.draft)
            self.draft.mkdir()
        except OSError as error:
            self.close()
            raise InputError(f"--out {path}: cannot be written: {error.strerror}") from error
        except BaseException:
            self.close()
            raise

    def commit(self) -> None:
        """Put the new results in the place of the older ones."""
        new = [name for name in self._names if (self.draft / name).is_file()]
        gone = [name for name in self._names if name not in new]
        contents = {"new": new, "gone": gone}
        (self.draft / CONTENTS).write_text(json.dumps(contents), encoding="utf-8")
        for name in (*new, CONTENTS):
            _flush(self.draft / name)
        os.rename(self.draft, self.path / FINISHED)  # from here on the new results stand
        settle(self.path)

    def close(self) -> None:
        """Let others write into the folder."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def settle(path: Path) -> None:
    """Finish a move of whole results into a folder that a killed run had begun."""
    finished = path / FINISHED
    if not finished.is_dir():
        return
    with suppress(FileNotFoundError, ValueError):
        contents = json.loads((finished / CONTENTS).read_text(encoding="utf-8"))
        for name in contents["new"]:
            with suppress(FileNotFoundError):  # moved before the kill
                os.replace(finished / name, path / name)
        for name in contents["gone"]:
            (path / name).unlink(missing_ok=True)
    shutil.rmtree(finished)


def is_unfinished(path: Path) -> bool:
    """Whether a run was stopped before its results were whole."""
    return (path / UNFINISHED).is_dir()


@contextmanager
def replaced_file(path: Path) -> Iterator[Path]:
    """A draft that takes the place of a file at the end of the block, unless that fails.

    Yields:
        Where to write; its name has the same ending.

    Raises:
        InputError: another process writes the same file.
    """
    if path.exists() and not path.is_file():  # a device or a pipe has no older content
        yield path
        return
    path = path.resolve()
    draft = _draft(path)
    lock = os.open(draft, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        _lock(lock, str(path))
    except BaseException:
        os.close(lock)
        raise
    try:
        yield draft
        if path.exists():
            shutil.copymode(path, draft)
        _flush(draft)
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)
        os.close(lock)


def check_file(path: Path, option: str = "") -> None:
    """Make sure, before the work begins, that a file can be written; makes its folder.

    Args:
        path: of the file.
        option: of the command that names it, for the message.

    Raises:
        InputError: it is a folder, or cannot be written.
    """
    named = f"{option} {path}".strip()
    if path.is_dir():
        raise InputError(f"{named}: cannot be written: it is a directory")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if not path.exists() or path.is_file():
            draft = _draft(path.resolve())
            draft.open("ab").close()
            if not draft.stat().st_size:
                draft.unlink()
    except OSError as error:
        raise InputError(f"{named}: cannot be written: {error.strerror}") from error


def _draft(path: Path) -> Path:
    return path.with_name(f".part.{path.name}")


def _locked(folder: Path, name: str) -> int:
    """The lock of a folder; it ends with the process, however that ends."""
    lock = os.open(folder, os.O_RDONLY)
    try:
        _lock(lock, name)
    except BaseException:
        os.close(lock)
        raise
    return lock


def _lock(handle: int, name: str) -> None:
    try:
        import fcntl
    except ImportError:  # Windows
        return
    lock: Any = fcntl.LOCK_EX | fcntl.LOCK_NB
    try:
        fcntl.flock(handle, lock)
    except BlockingIOError:
        raise InputError(
            f"{name}: another process is writing there; wait for it, or choose another place"
        ) from None
    except OSError:  # a file system without locks
        return


def _flush(path: Path) -> None:
    """Bring a file to the disk: a full one is told now, not after the older file is gone."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
