# SPDX-License-Identifier: Apache-2.0
"""Where a model's files are: relative paths, `file://`, `package://` and `robot:NAME`."""

import os
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote, urlparse

ROBOTS = Path(__file__).parents[1] / "robots"  # that ship with Touchline
# Distributions on PyPI that bring model files, by the name of their ROS package.
PYPI_DATA = {"example-robot-data": "example-robot-data"}


class PackageMissingError(FileNotFoundError):
    """A package is not installed or not where `package_dirs` says; the message names it."""


class FileMissingError(FileNotFoundError):
    """There is no such file.

    Args:
        message: what was looked for.
        folder: in which it is not.
    """

    def __init__(self, message: str, folder: str) -> None:
        super().__init__(message)
        self.folder = folder


def resolve(uri: str, folder: Path, package_dirs: Sequence[Path] = ()) -> Path:
    """Return the existing file that a model or mesh URI means.

    `package://NAME/x` is looked up as DIR/NAME/x, then DIR/x, for each of `package_dirs`; then in
    the packages around `folder` (`_around`); then in the installed ones (`installed_shares`).

    Args:
        uri: `package://NAME/x`, `file:///x`, an absolute path, or a path relative to `folder`.
        folder: where the file stands that contains the URI.
        package_dirs: folders with packages.

    Raises:
        FileNotFoundError: the message says what was looked for and where.
    """
    if uri.startswith("package://"):
        return _resolve_package(uri.removeprefix("package://"), folder, package_dirs)
    path = _local_path(uri)
    path = path if path.is_absolute() else folder / path
    if not path.is_file():
        more = f": {path}" if str(path) != uri else ""
        if path.is_dir():
            raise FileNotFoundError(f"is a folder, not a file{more}")
        raise FileMissingError(f"no such file{more}", str(path.parent))
    return path


def resolve_robot(name: str) -> Path:
    """Return the model file of a robot that ships with Touchline.

    Raises:
        FileNotFoundError: there is none of this name; the message lists those there are.
    """
    robots = shipped_robots()
    if name not in robots:
        known = ", ".join(sorted(robots)) or "none"
        raise FileNotFoundError(f"no robot '{name}' ships with Touchline; there are: {known}")
    return robots[name]


def shipped_robots() -> dict[str, Path]:
    """Return the model file of each robot that ships with Touchline, by name."""
    found = {}
    for folder in sorted(ROBOTS.iterdir()) if ROBOTS.is_dir() else ():
        for stem in (folder.name, "model"):
            for suffix in (".xml", ".urdf"):
                file = folder / f"{stem}{suffix}"
                if file.is_file():
                    found.setdefault(folder.name, file)
    return found


def shipped_descriptions() -> dict[str, Path]:
    """Return the `robot.yaml` of each robot that ships with Touchline, by name."""
    return {file.parent.name: file for file in sorted(ROBOTS.glob("*/robot.yaml"))}


def installed_shares(package: str) -> Iterator[Path]:
    """Yield the folders where an installed package of this name may keep its files.

    These are `share/PACKAGE` below the ROS prefixes (`AMENT_PREFIX_PATH`), the Python environment
    and its wheels with a prefix of their own (cmeel), and the entries of `ROS_PACKAGE_PATH`.
    Nothing is imported.
    """
    prefixes = [Path(entry) for entry in _path_variable("AMENT_PREFIX_PATH")]
    prefixes += [Path(entry) / "cmeel.prefix" for entry in sys.path if entry]
    prefixes.append(Path(sys.prefix))
    yield from (prefix / "share" / package for prefix in prefixes)
    yield from (Path(entry) / package for entry in _path_variable("ROS_PACKAGE_PATH"))


def _resolve_package(rest: str, folder: Path, package_dirs: Sequence[Path]) -> Path:
    package, _, inside = rest.partition("/")
    inside = unquote(inside)
    roots = [Path(entry) / part for entry in package_dirs for part in (package, ".")]
    roots += [*_around(package, folder), *installed_shares(package)]
    for root in roots:
        if (root / inside).is_file():
            return root / inside
    if any(root.is_dir() and root.name == package for root in roots):
        raise FileNotFoundError(f"package '{package}' has no file '{inside}'")
    raise _missing(package, package_dirs)


def package_folder(package: str, folder: Path, package_dirs: Sequence[Path] = ()) -> Path:
    """Return the absolute folder of a package, as `$(find NAME)` of a xacro in `folder` means it.

    Raises:
        PackageMissingError: it is nowhere.
    """
    roots = [Path(entry) / package for entry in package_dirs]
    roots += [Path(entry) for entry in package_dirs if _is_package(Path(entry), package)]
    for root in (*roots, *_around(package, folder), *installed_shares(package)):
        if root.is_dir():
            return root.absolute()  # a relative one xacro takes from the including file's folder
    raise _missing(package, package_dirs)


def _around(package: str, folder: Path) -> Iterator[Path]:
    """Yield the package if `folder` is in it, or in one beside it, as in a ROS workspace."""
    folder = folder.resolve()
    for parent in (folder, *folder.parents):
        if parent.name == package or _is_package(parent, package):
            yield parent
        if _is_package(parent / package, package):
            yield parent / package


def _is_package(folder: Path, package: str) -> bool:
    """Whether the package.xml in a folder has this name."""
    try:
        text = (folder / "package.xml").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return re.search(rf"<name>\s*{re.escape(package)}\s*</name>", text) is not None


def _missing(package: str, package_dirs: Sequence[Path]) -> PackageMissingError:
    hint = f"`pip install {PYPI_DATA[package]}`" if package in PYPI_DATA else "install it"
    where = ", ".join(str(entry) for entry in package_dirs) or "none"
    return PackageMissingError(
        f"package '{package}' not found: {hint}, or name the folder it is in under package_dirs "
        f"(now: {where})"
    )


def _local_path(uri: str) -> Path:
    return Path(unquote(urlparse(uri).path)) if uri.startswith("file://") else Path(uri)


def _path_variable(name: str) -> list[str]:
    return [entry for entry in os.environ.get(name, "").split(os.pathsep) if entry]
