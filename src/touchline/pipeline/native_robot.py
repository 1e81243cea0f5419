# SPDX-License-Identifier: Apache-2.0
"""A robot with its surfaces and thresholds in the words of the native core, and as a file of it."""

from collections.abc import Mapping
from pathlib import Path

from touchline.classifier.classifier import blow_limits
from touchline.classifier.zones import Zones
from touchline.detector.detector import native_rows, native_settings
from touchline.detector.residual_noise import native_noise
from touchline.detector.thresholds import Thresholds
from touchline.errors import InputError
from touchline.localizer.localizer import native_surfaces
from touchline.localizer.skin import Skin
from touchline.model.description import PushDescription
from touchline.model.kernel import joint_row, native_node, sensor_row
from touchline.model.robot import Robot
from touchline.native import core

# The arguments of `native_robot` from `period` on.
Weights = tuple[float, float | None, float, float, float, PushDescription, Mapping[str, float]]

MAGIC = 8  # bytes with which exported robots begin, as robot_file.hpp says


def native_robot(
    robot: Robot,
    thresholds: Thresholds,
    skin: Skin,
    period: float,
    bandwidth: float | None,
    wrench_error: float,
    torque_error: float,
    wrench_error_off: float,
    pushes: PushDescription,
    tuning: Mapping[str, float],
) -> core.Robot:
    """All that the native pipeline has to know of a robot; arguments as of `Pipeline`."""
    zones = Zones(robot)
    native = core.Robot()
    native.name = robot.name
    native.nodes = [native_node(node) for node in robot.nodes]
    native.set_gravity(*robot.gravity.tolist())
    native.joints = [joint_row(robot, i, bandwidth) for i in range(len(robot.joint_names))]
    native.sensors = [sensor_row(robot, i, bandwidth) for i in range(len(robot.sensor_names))]
    native.joint_names = list(robot.joint_names)
    native.sensor_names = list(robot.sensor_names)
    native.segment_names = list(robot.segment_names)
    native.rows = native_rows(thresholds)
    native.detection = native_settings(robot, thresholds, period)
    native.noise = native_noise(robot, period, wrench_error, torque_error, wrench_error_off)
    native.blows = blow_limits(robot, thresholds, zones, tuning)
    native.segment_zones = [_zone(zones.of(segment)) for segment in robot.segment_names]
    native.surfaces = native_surfaces(robot, skin)
    native.pushes = core.Pushes(pushes.friction, pushes.reach)
    native.links = [
        core.link(
            patch.link,
            patch.body,
            _zone(zones.of(patch.segment or "", patch.link)),
            patch.T_node_link[:3, :3].ravel().tolist(),
            patch.T_node_link[:3, 3].tolist(),
        )
        for patch in skin.patches
    ]
    return native


def write_robot(path: Path, robot: core.Robot) -> None:
    """Write the file that `touchline::read_robot` reads, in one step.

    Raises:
        InputError: another kind of file is there, such as the robot's description.
        OSError: it cannot be written.
    """
    content = robot.to_bytes()
    if path.is_file():
        with path.open("rb") as file:
            if file.read(MAGIC) != content[:MAGIC]:
                raise InputError(f"{path}: exists and is no exported robot; name another file")
    draft = path.with_name(f".{path.name}.part")
    draft.write_bytes(content)
    draft.replace(path)


def _zone(zone: str | None) -> core.Zone:
    return getattr(core.Zone, zone or "open")
