# SPDX-License-Identifier: Apache-2.0
"""Where a robot comes from: a `robot.yaml`, a model file, or a name that some collection knows.

A name is looked up among the robots that ship with Touchline, then among the models of the
installed package example-robot-data, then among those that robot_descriptions has in its cache.
Nothing is ever fetched from elsewhere.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, Literal
from unittest import mock

from touchline.errors import InputError
from touchline.model.packages import installed_shares, shipped_descriptions
from touchline.model.yaml_file import read_yaml
from touchline.suggest import did_you_mean

DESCRIPTIONS = (".yaml", ".yml")
DESCRIPTION = "robot.yaml"  # in a folder that stands for a robot
MODELS = (".urdf", ".xml", ".mjcf", ".xacro")
EXAMPLE_DATA = "example-robot-data"
WELL_KNOWN = ("panda", "iiwa", "ur5", "kinova")  # of its robots, as examples
DESCRIPTIONS_PACKAGE = "robot_descriptions"


@dataclass(frozen=True)
class Source:
    """A file that tells what a robot is.

    Attributes:
        kind: "description" for a `robot.yaml`, "model" for a URDF, MJCF or xacro.
        path: of the file.
    """

    kind: Literal["description", "model"]
    path: Path


def find_robot(robot: str | Path) -> Source:
    """Return the file that is meant by a path or a name.

    Raises:
        InputError: no file and no collection has it; the message lists what there is.
    """
    path, name = Path(robot), str(robot)
    if path.suffix.lower() in MODELS:
        return Source("model", path)
    if path.suffix.lower() in DESCRIPTIONS or path.is_file():
        return Source("description", path)
    if (path / DESCRIPTION).is_file():
        return Source("description", path / DESCRIPTION)
    shipped = shipped_descriptions()
    if name in shipped:
        return Source("description", shipped[name])
    examples = example_models()
    if name in examples:
        return Source("model", examples[name])
    cached = _cached_model(name)
    if cached is not None:
        return Source("model", cached)
    if path.is_dir():
        raise InputError(
            f"{robot}: is a folder without {DESCRIPTION}; that, a URDF or an MJCF is needed"
        )
    raise InputError(_unknown(name, list(shipped), list(examples)))


def given_keys(source: Path | None) -> dict[Any, Any]:
    """What the file of a robot says; nothing where it is a model or there is none.

    Raises:
        InputError: the file cannot be read.
    """
    if source is None or find_robot(source).kind == "model":
        return {}
    return read_yaml(source)


def example_models() -> dict[str, Path]:
    """Return the URDFs of the package example-robot-data by file name without suffix.

    Where two have the same file name, each is named FOLDER/NAME; `_robot` may be left out.
    """
    found: dict[str, list[Path]] = {}
    for share in installed_shares(EXAMPLE_DATA):
        for file in sorted(share.glob("robots/*/**/*.urdf")):
            if not any(file.samefile(other) for other in found.get(file.stem, ())):
                found.setdefault(file.stem, []).append(file)
    models = {}
    for stem, files in found.items():
        for file in files:
            folder = file.parents[1].name.removesuffix("_description")
            models[stem if len(files) == 1 else f"{folder}/{stem}"] = file
    for name in list(models):
        short = name.removesuffix("_robot")
        if short != name and not (short in models and _has_links(models[short])):
            models[short] = models[name]
    return models


def _has_links(model: Path) -> bool:
    """Is there anything in a URDF? The package has one of which an expansion left only the head."""
    return "<link" in model.read_text(encoding="utf-8", errors="replace")


def _cached_model(name: str) -> Path | None:
    """Return the model of robot_descriptions by the name of its module, if its cache has it."""
    package = DESCRIPTIONS_PACKAGE
    if "/" in name or find_spec(package) is None:
        return None
    modules = (name, f"{name}_description", f"{name}_mj_description")
    module = next((m for m in modules if m.isidentifier() and _has_module(package, m)), None)
    if module is None:
        return None
    with _from_cache_alone(name):
        described: Any = import_module(f"{package}.{module}")
    for attribute in ("URDF_PATH", "MJCF_PATH"):
        if path := getattr(described, attribute, None):
            return Path(path)
    raise InputError(f"{name}: robot_descriptions has this model neither as URDF nor as MJCF")


def _has_module(package: str, module: str) -> bool:
    return find_spec(f"{package}.{module}") is not None


@contextmanager
def _from_cache_alone(name: str) -> Iterator[None]:
    """The modules of robot_descriptions clone what they need when imported; here they must not."""
    repositories = import_module("robot_descriptions._repositories").REPOSITORIES
    default = Path.home() / ".cache" / "robot_descriptions"
    cache = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", default)).expanduser()

    def find(repository: str, commit: str | None = None) -> str:
        folder = cache / repositories[repository].cache_path
        if not folder.is_dir():
            raise InputError(
                f"{name}: robot_descriptions knows this robot, but {folder} is not there; fetch it "
                f"once with: python -m robot_descriptions pull {name}"
            )
        return str(folder)

    stand_in: Any = ModuleType("robot_descriptions._cache")
    stand_in.clone_to_cache = find
    known = set(sys.modules)
    with mock.patch.dict(sys.modules, {"robot_descriptions._cache": stand_in}):
        yield
        for module in set(sys.modules) - known:
            if module.startswith("robot_descriptions."):
                del sys.modules[module]  # one that knows only the stand-in is of no use to others


def _unknown(name: str, shipped: list[str], examples: list[str]) -> str:
    known = [*shipped, *examples]
    message = (
        f"{name}: no such file, and no robot of this name{did_you_mean(name, known)}; "
        f"with Touchline come {', '.join(shipped)}"
    )
    if examples:
        told = [example for example in WELL_KNOWN if example in examples] or examples[:3]
        message += f"; {EXAMPLE_DATA} has {len(examples)} more, such as {', '.join(told)}"
    absent = [] if examples else [EXAMPLE_DATA]
    absent += [] if find_spec(DESCRIPTIONS_PACKAGE) else [DESCRIPTIONS_PACKAGE]
    return f"{message}; more names come with: pip install {' '.join(absent)}" if absent else message
