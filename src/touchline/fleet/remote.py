# SPDX-License-Identifier: Apache-2.0
"""Recordings that are elsewhere: any URL that fsspec knows, such as s3:// and http://."""

import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Any

from touchline.errors import InputError
from touchline.extras import need
from touchline.fleet.own import is_result
from touchline.logs.parquet import column_names

FETCHED = ".fetched"
# What fsspec needs for a kind of URL; its own message names no module that could be looked up.
PACKAGES = {"http": "aiohttp", "https": "aiohttp", "s3": "s3fs", "gs": "gcsfs", "gcs": "gcsfs"}

# Of a server that refuses, is not known or keeps silent: what is raised, or what that comes from.
NO_ANSWER = (ConnectionError, TimeoutError, socket.gaierror)


def is_url(word: str) -> bool:
    """Whether a word of the command line names something that is not a local path."""
    return "://" in word


class There:
    """Files elsewhere, as of a file system of fsspec."""

    def __init__(self, system: Any) -> None:
        self._system = system

    def exists(self, path: str) -> bool:
        """Whether there is a file or folder."""
        return bool(self._system.exists(path))

    def columns(self, path: str) -> list[str]:
        """Columns of a Parquet file; none of one that cannot be read."""
        if not self._system.isfile(path):
            return []
        with self._system.open(path, "rb") as file:
            return column_names(file)


def is_result_there(url: str) -> bool:
    """Whether an earlier analysis wrote what a URL names.

    Raises:
        InputError: it cannot be reached.
    """
    system, path = _system(url)
    with _reaching(url):
        return is_result(PurePosixPath(path), There(system))


@contextmanager
def _reaching(url: str) -> Iterator[None]:
    try:
        yield
    except (InputError, ImportError):
        raise
    except Exception as error:  # each kind of URL has errors of its own
        reason = error.__cause__ or error  # fsspec itself may say no more than the URL
        causes = (error, error.__cause__, reason.__cause__)
        silent = any(isinstance(cause, NO_ANSWER) for cause in causes)
        what = "the server does not answer" if silent else "cannot be read"
        raise InputError(f"{url}: {what}: {str(reason) or type(reason).__name__}") from error


def found(url: str, endings: tuple[str, ...]) -> list[tuple[str, int]]:
    """Recordings below a URL or that a pattern matches, with their sizes [bytes].

    Args:
        url: of a file, a folder, or a pattern.
        endings: of the names of recordings.

    Raises:
        InputError: nothing is there, or it cannot be reached.
        ModuleNotFoundError: fsspec, or what it needs for this kind of URL, is not installed.
    """
    system, path = _system(url)
    with _reaching(url):
        if any(mark in path for mark in "*?["):
            paths = system.glob(path)
        elif path.lower().endswith(endings) and not _is_folder(system, path):
            return [(str(system.unstrip_protocol(path)), int(system.size(path) or 0))]
        else:
            paths = system.find(path) or _listed(system, path)
        names = sorted(
            p
            for p in paths
            if p.lower().endswith(endings) and not is_result(PurePosixPath(p), There(system))
        )
        sizes = [
            (str(system.unstrip_protocol(name)), int(system.size(name) or 0)) for name in names
        ]
    if not sizes:
        raise InputError(f"{url}: no recordings there")
    return sizes


@contextmanager
def fetched(url: str, folder: Path) -> Iterator[Path]:
    """A copy of a recording below a folder, gone after the block.

    Raises:
        InputError: it cannot be read.
    """
    system, path = _system(url)
    place = folder / FETCHED
    place.mkdir(parents=True, exist_ok=True)
    try:
        copy = place / path.rsplit("/", 1)[-1]
        with _reaching(url), system.open(path, "rb") as source, copy.open("wb") as target:
            shutil.copyfileobj(source, target, 1 << 22)
        yield copy
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _listed(system: Any, path: str) -> list[str]:
    """Nothing, of a folder in which `find` has found nothing; what it keeps to itself is raised."""
    with suppress(FileNotFoundError):
        system.ls(path, detail=False)
    return []


def _is_folder(system: Any, path: str) -> bool:
    try:
        return bool(system.isdir(path))
    except (OSError, ValueError):
        return False


def _system(url: str) -> tuple[Any, str]:
    fsspec = need("fsspec")
    try:
        return fsspec.core.url_to_fs(url)
    except ImportError as error:
        package = PACKAGES.get(url.partition("://")[0])
        if package is None:
            raise InputError(f"{url}: {error}") from error
        raise ModuleNotFoundError(f"{url}: {error}", name=package) from error
    except ValueError as error:
        raise InputError(f"{url}: {error}; known are {', '.join(PACKAGES)} and others") from error
