# SPDX-License-Identifier: Apache-2.0
"""Everything about the robot description that an analysis used."""

from collections.abc import Sequence
from html import escape
from itertools import groupby
from typing import Any

import numpy as np

from touchline.model.description import JointDescription, SensorDescription
from touchline.model.robot import Robot
from touchline.report.facts import detection_fact
from touchline.report.html import Cell, section, table, text
from touchline.report.outcome import Analysis


def robot_section(analysis: Analysis) -> str:
    """The section: model, joints, sensors, bodies, corrections, and the file as it stands."""
    robot = analysis.robot
    parts = [
        table(["", ""], _general(analysis)),
        "<h3>Joints</h3>",
        _joints(analysis),
        "<h3>Force-torque sensors</h3>" if robot.sensor_names else "",
        _sensors(analysis) if robot.sensor_names else "",
        "<h3>Bodies</h3>",
        table(["body", "links", "segment", "mass [kg]"], _bodies(robot)),
        _corrections(robot),
        _file(robot),
    ]
    return section(f"Robot: {robot.name}", *parts)


def _general(analysis: Analysis) -> list[list[Any]]:
    robot = analysis.robot
    description, detection = robot.description, robot.description.detection
    locked = [f"{name} = {value:g}" for name, value in description.locked.items()]
    rows = [
        ["description", description.path or description.name],
        ["model", description.model],
        ["gravity [m/s2]", tuple(float(x) for x in robot.gravity)],
        ["mass of all links [kg]", f"{sum(n.inertia.mass for n in robot.nodes):.4g}"],
        ["segments", ", ".join(robot.segment_names)],
        ["locked joints", ", ".join(locked)],
        ["observer", f"method {analysis.method}"],
        [
            "detection",
            f"{detection_fact(robot, analysis.thresholds)}; "
            f"fires after {1e3 * detection.min_duration:g} ms, "
            f"ends below {detection.release:g} of the thresholds for {1e3 * detection.hold:g} ms; "
            "baseline over "
            f"{detection.baseline.time:g} s, at most {detection.baseline.limit:g} thresholds",
        ],
    ]
    if analysis.bandwidth:
        rows.append(["bandwidth given", f"{analysis.bandwidth:g} rad/s for all rows"])
    return [row for row in rows if row[1] != ""]


def _joints(analysis: Analysis) -> str:
    robot = analysis.robot
    description = robot.description
    limits = {row.joint: row for row in analysis.thresholds.rows if row.joint >= 0}
    rows = []
    for j, joint in enumerate(description.joints):
        limit = limits.get(j)
        model = robot.mechanism.joints[joint.name]
        rows.append(
            [
                joint.name,
                _torque(joint),
                robot.joint_segments[j],
                analysis.bandwidth or description.bandwidth_joints[j],
                float(f"{limit.contact:.3g}") if limit else None,
                float(f"{limit.collision:.3g}") if limit else None,
                _friction(joint),
                _conversion(joint),
                joint.range if np.isfinite(joint.range) else None,
                Cell(f"{model.lower:.4g}&nbsp;to&nbsp;{model.upper:.4g}"),
                description.noise.tau[j],
                description.noise.qd[j],
            ]
        )
    head = ["joint", "torque", "segment", "K [rad/s]", "contact [Nm]", "collision [Nm]"]
    head += ["friction", "conversion", "range [Nm]", "limits", "tau noise", "qd noise"]
    return table(head, rows)


def _torque(joint: JointDescription) -> str:
    if joint.torque == "from":
        return "from " + ", ".join(joint.sources)
    return joint.torque if joint.compensated == "none" else f"{joint.torque}, {joint.compensated}"


def _friction(joint: JointDescription) -> str:
    friction = joint.friction
    parts = []
    if friction.coulomb:
        parts.append(f"{friction.coulomb:g} tanh(qd / {friction.coulomb_width:g})")
    if friction.stribeck:
        fall = f"exp(-(qd / {friction.stribeck_speed:g})^2)"
        parts.append(f"{friction.stribeck:g} {fall} tanh(qd / {friction.coulomb_width:g})")
    if friction.viscous:
        parts.append(f"{friction.viscous:g} qd")
    if joint.rest is not None:
        parts.append(f"learned, up to {joint.rest.largest:.2g}")
    return " + ".join(parts)


def _conversion(joint: JointDescription) -> str:
    parts = {
        "sign": (joint.sign, 1.0),
        "gain": (joint.gain, 1.0),
        "bias": (joint.bias, 0.0),
        "delay": (joint.delay, 0.0),
        "rotor inertia": (joint.rotor_inertia, 0.0),
    }
    return ", ".join(f"{k} {v:g}" for k, (v, default) in parts.items() if v != default)


def _sensors(analysis: Analysis) -> str:
    robot = analysis.robot
    rows = [_sensor(analysis, sensor) for sensor in robot.description.sensors]
    head = ["sensor", "link", "position [m]", "rpy [rad]", "axes", "polarity", "frame"]
    head += ["compensated", "bias", "delay [s]", "range", "noise", "K [rad/s]"]
    return table(head, rows)


def _sensor(analysis: Analysis, sensor: SensorDescription) -> list[Any]:
    description = analysis.robot.description
    axes = "six" if len(sensor.axes) == 6 else " ".join(sensor.axes)
    values = (sensor.name, sensor.link, sensor.xyz, sensor.rpy, axes, sensor.polarity)
    own = (sensor.frame, sensor.compensated, _repeated(sensor.bias), sensor.delay or None)
    noise = description.noise.sensors.get(sensor.name, ())
    bandwidth = analysis.bandwidth or description.bandwidth_sensors[sensor.name]
    return [*values, *own, _repeated(sensor.range), _repeated(noise), bandwidth]


def _repeated(values: Sequence[float]) -> str:
    """Numbers of six axes, equal neighbours once: "3 x 0.05, 3 x 0.01"; nothing for zeros."""
    if not any(values):
        return ""
    runs = [(value, len(list(run))) for value, run in groupby(values)]
    return ", ".join(f"{count} x {text(v)}" if count > 1 else text(v) for v, count in runs)


def _bodies(robot: Robot) -> list[list[Any]]:
    return [
        [body.name, body.links, body.segment, f"{robot.nodes[body.node].inertia.mass:.4g}"]
        for body in robot.bodies
    ]


def _corrections(robot: Robot) -> str:
    description = robot.description
    rows = [["load", load.link, load.mass, load.com, load.inertia] for load in description.loads]
    rows += [
        ["link", name, link.mass, link.com, link.inertia]
        for name, link in description.links.items()
    ]
    if not rows:
        return ""
    head = ["", "link", "mass [kg]", "centre of mass [m]", "inertia [kg m2]"]
    return "<h3>Loads and corrected links</h3>" + table(head, rows)


def _file(robot: Robot) -> str:
    path = robot.description.path
    if path is None or not path.is_file():
        return ""
    content = escape(path.read_text(encoding="utf-8", errors="replace"))
    return (
        f"<details><summary>{text(path.name)} as it stands</summary><pre>{content}</pre></details>"
    )
