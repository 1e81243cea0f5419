# SPDX-License-Identifier: Apache-2.0
"""From files to a checked description and its mechanism."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from touchline.errors import InputError
from touchline.model import guess as guesses
from touchline.model.corrections import apply_corrections
from touchline.model.description import JointDescription, RobotDescription, SensorDescription
from touchline.model.entries import JointEntry, RobotFile, SensorEntry
from touchline.model.expand import Expander
from touchline.model.interface_names import check_interface
from touchline.model.learned_rest import LearnedRest, read_rest
from touchline.model.mechanism import Mechanism
from touchline.model.names import Names, check_names, joint_entries, names_in, sensor_entries
from touchline.model.packages import resolve, resolve_robot
from touchline.model.policy_names import check_policy
from touchline.model.schema import structure
from touchline.model.topology import independent_joints
from touchline.model.urdf import load_urdf, parse_xml
from touchline.model.yaml_file import read_yaml


def read_robot_file(path: Path | str) -> tuple[RobotDescription, Mechanism]:
    """Read a `robot.yaml` and the model it names, with the file's corrections applied.

    Returns:
        The description, its per-joint values in the order of its joints; and the mechanism with
        corrected links, loads merged into theirs, and the file's gravity.

    Raises:
        InputError: everything that is wrong with both files, one line each.
    """
    path = Path(path)
    return read_robot_data(read_yaml(path), path)


def read_model(path: Path | str) -> tuple[RobotDescription, Mechanism, guesses.Guess]:
    """Read a URDF, MJCF or xacro without a description, which is guessed.

    Raises:
        InputError: what is wrong with the model.
    """
    path = Path(path)
    guess = guesses.guess_description(load_mechanism(path), path)
    return *read_robot_data(guess.data(), path), guess


def read_robot_data(data: dict[Any, Any], path: Path) -> tuple[RobotDescription, Mechanism]:
    """Read what a `robot.yaml` at `path` holds, or would hold; see `read_robot_file`."""
    file, problems = structure(data)
    if file.model is None and not any(problem.startswith("model: ") for problem in problems):
        problems.append("model: is missing")
    folders, folder_problems = _package_folders(file, path.parent)
    problems += folder_problems
    model, mechanism, model_problems = _read_model(file, path, folders)
    names = names_in(data)
    draft = _Draft(path, model, folders, file, names, mechanism)
    problems += draft.read_rest()
    at_fault = tuple(problems)  # a whole is not to blame where one of its parts is
    for where, what in draft.problems:
        if not any(problem.startswith(f"{where}.") for problem in at_fault):
            problems.append(f"{where}: {what}")
    lines = [f"{path}: {problem}" for problem in dict.fromkeys(problems)] + model_problems
    if lines or mechanism is None:
        raise InputError(lines)
    description = draft.description(file.name or guesses.robot_name(mechanism, Path(str(model))))
    return description, apply_corrections(mechanism, description)


def load_description(path: Path | str) -> RobotDescription:
    """Read a `robot.yaml`, checked against its model (see `read_robot_file`)."""
    return read_robot_file(path)[0]


def load_mechanism(path: Path | str, package_dirs: Sequence[Path] = ()) -> Mechanism:
    """Read a model file: URDF or MJCF, told apart by the root element; a xacro is expanded.

    Raises:
        InputError: the file is neither, or what is wrong with it.
    """
    path = Path(path)
    tag = parse_xml(path, package_dirs).tag
    if tag == "mujoco":
        from touchline.model.mjcf import load_mjcf

        return load_mjcf(path)
    if tag == "robot":
        return load_urdf(path, package_dirs)
    raise InputError(f"{path}: the root element is <{tag}>; a URDF has <robot>, an MJCF <mujoco>")


def _package_folders(file: RobotFile, base: Path) -> tuple[tuple[Path, ...], list[str]]:
    found = [base / Path(entry) for entry in file.package_dirs if entry is not None]
    problems = [
        f"package_dirs: no such folder: {folder}" for folder in found if not folder.is_dir()
    ]
    return tuple(found), problems


def _read_model(
    file: RobotFile, path: Path, folders: tuple[Path, ...]
) -> tuple[Path | None, Mechanism | None, list[str]]:
    """Return the model's path, the mechanism and the errors, each as a whole line."""
    if file.model is None:
        return None, None, []
    try:
        if file.model.startswith("robot:"):
            model = resolve_robot(file.model.removeprefix("robot:"))
        else:
            model = resolve(file.model, path.parent, folders)
    except FileNotFoundError as error:
        return None, None, [f"{path}: model: '{file.model}': {error}"]
    try:
        return model, load_mechanism(model, folders), []
    except InputError as error:
        return model, None, error.problems


class _Draft:
    """A description in the making: the readable part of the file, checked and expanded."""

    def __init__(
        self,
        path: Path,
        model: Path | None,
        folders: tuple[Path, ...],
        file: RobotFile,
        names: Names,
        mechanism: Mechanism | None,
    ):
        self.path, self.model, self.folders, self.file = path, model, folders, file
        self.joints = self._joint_entries(names, mechanism)
        sensors = [sensor for _, sensor in sensor_entries(file)]
        # A list with an unreadable item still tells how many joints there are.
        count = len(file.joints) if file.joints is not None else None
        count = len(self.joints) if count is None and mechanism else count
        self.expander = Expander(count, sensors, names.sensors)
        self.noise = self.expander.noise(file.noise)
        self.bandwidth = self.expander.bandwidth(file.observer.bandwidth)
        self.detection = self.expander.detection(file.detection)
        self.rest: dict[str, LearnedRest] = {}
        self.sensors = [self._sensor(place, sensor) for place, sensor in sensor_entries(file)]
        self.problems = [
            *check_names(file, names, mechanism),
            *check_policy(file, names, mechanism),
            *check_interface(file, mechanism, count),
            *self.expander.problems,
        ]

    def _joint_entries(self, names: Names, mechanism: Mechanism | None) -> list[JointEntry]:
        if names.joints is not None or mechanism is None:
            return [joint for _, joint in joint_entries(self.file)]
        free = independent_joints(mechanism)
        return [JointEntry(name) for name in free if name not in self.file.locked]

    def _sensor(self, place: str, entry: SensorEntry) -> SensorDescription:
        bias = self.expander.per_axis(f"{place}.bias", entry.bias, entry, (0.0,) * 6)
        limits = (float("inf"),) * 6
        reach = self.expander.per_axis(f"{place}.range", entry.range, entry, limits)
        same: dict[str, Any] = {key: value for key, value in vars(entry).items() if key != "pose"}
        same.update(vars(entry.pose), bias=bias, range=reach)
        return SensorDescription(**same)

    def read_rest(self) -> list[str]:
        """Reads what was learned of the torques; returns what is wrong with it."""
        if self.file.learned_rest is None:
            return []
        names = [joint.name for joint in self.joints]
        try:
            self.rest = read_rest(self.path.parent / self.file.learned_rest, names)
        except InputError as error:
            return [f"learned_rest: {problem}" for problem in error.problems]
        return []

    def description(self, name: str) -> RobotDescription:
        """Return the description of a robot of that name; only without problems."""
        file = self.file
        joints, sensors = self.bandwidth
        return RobotDescription(
            name=name,
            model=Path(str(self.model)),
            joints=tuple(_joint(joint, self.rest.get(joint.name)) for joint in self.joints),
            sensors=tuple(self.sensors),
            noise=self.noise,
            bandwidth_joints=joints,
            bandwidth_sensors=sensors,
            package_dirs=self.folders,
            gravity=file.gravity,
            locked=file.locked,
            loads=tuple(file.loads),
            links=file.links,
            graspable=tuple(file.graspable),
            pushes=file.pushes,
            detection=self.detection,
            policy=file.policy,
            interface=file.interface,
            log=file.log,
            path=self.path,
        )


def _joint(entry: JointEntry, rest: LearnedRest | None) -> JointDescription:
    torque: dict[str, Any] = {"torque": entry.torque.kind, "sources": entry.torque.sources}
    return JointDescription(**vars(entry) | torque, rest=rest)
