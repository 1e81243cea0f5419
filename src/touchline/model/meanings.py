# SPDX-License-Identifier: Apache-2.0
"""What each key of `robot.yaml` means: its type, unit and meaning, for the reference.

The places are those of the file; `[]` stands for an item of a list and NAME for a name.
"""

from collections.abc import Iterator
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

from touchline.model.entries import RobotFile

# May be missing only where it could not be read.
REQUIRED = ((RobotFile, "model"),)
SIX = "list of 6 numbers"
THREE = "list of 3 numbers"
INERTIA = "ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, in link axes"

# Key: type, unit, meaning.
MEANINGS: dict[str, tuple[str, str, str]] = {
    "name": ("text", "", "Name of the robot; default: the name in the model."),
    "model": (
        "text",
        "",
        "URDF, MJCF or xacro, relative to this file; or `robot:NAME`, or `package://NAME/x`.",
    ),
    "package_dirs": (
        "list of text",
        "",
        "Folders in which `package://NAME/x` is looked up as NAME/x, then x.",
    ),
    "gravity": (THREE, "m/s²", "Acceleration of gravity in world; default: the model's."),
    "joints": ("list", "", "The observed joints, in the order of all arrays; default: all."),
    "joints[].name": ("text", "", "Joint of the model."),
    "joints[].torque": (
        "`sensor`, `motor`, `none` or `{from: [SENSOR]}`",
        "",
        "Where its torque is measured: link side, motor side, nowhere, or from sensors named.",
    ),
    "joints[].sign": ("1 or -1", "", "Sign of the logged torque."),
    "joints[].gain": ("number", "Nm per logged unit", "Factor of the logged torque."),
    "joints[].bias": ("number", "Nm", "What the torque reads without load."),
    "joints[].delay": ("number", "s", "By how much the torque is late."),
    "joints[].range": ("number", "Nm", "Beyond it the torque sensor is saturated."),
    "joints[].compensated": (
        "`none`, `gravity` or `model`",
        "",
        "What the robot's driver has already taken out of the torque.",
    ),
    "joints[].rotor_inertia": ("number", "kg m²", "Rotor's, seen through the gear; for `motor`."),
    "joints[].friction": ("mapping", "", "Friction that the torque signal contains."),
    "joints[].friction.coulomb": ("number", "Nm", "Torque of dry friction."),
    "joints[].friction.viscous": ("number", "Nm s/rad", "Viscous friction, per speed."),
    "joints[].friction.coulomb_width": (
        "number",
        "rad/s",
        "Speed within which dry friction turns its sign.",
    ),
    "joints[].friction.stribeck": (
        "number",
        "Nm",
        "What dry friction has more of at slow speeds; needs `stribeck_speed`.",
    ),
    "joints[].friction.stribeck_speed": (
        "number",
        "rad/s",
        "Speed with which that falls: exp(-(qd / speed)^2).",
    ),
    "locked": (
        "mapping JOINT: number",
        "rad or m",
        "Joints that are not observed, and where they stand.",
    ),
    "force_torque_sensors": ("list", "", "The force-torque sensors, in the order of all arrays."),
    "force_torque_sensors[].name": (
        "text",
        "",
        "Name of the sensor, and of the segment that begins there.",
    ),
    "force_torque_sensors[].link": ("text", "", "First link that the sensor carries."),
    "force_torque_sensors[].pose": ("mapping", "", "Pose of the sensor's frame in that link."),
    "force_torque_sensors[].pose.xyz": (THREE, "m", "Origin."),
    "force_torque_sensors[].pose.rpy": (THREE, "rad", "Roll, pitch, yaw about fixed axes."),
    "force_torque_sensors[].axes": ("list of text", "", "The axes it measures."),
    "force_torque_sensors[].polarity": (
        "`outboard` or `inboard`",
        "",
        "`outboard`: the wrench exerted on the outboard body; `inboard`: the opposite sign.",
    ),
    "force_torque_sensors[].frame": ("`sensor`, `world` or LINK", "", "Axes of the logged wrench."),
    "force_torque_sensors[].compensated": (
        "`none` or `gravity`",
        "",
        "What the sensor's driver has already taken out of the wrench.",
    ),
    "force_torque_sensors[].bias": ("list of numbers", "N, Nm", "Reading without load, by axis."),
    "force_torque_sensors[].delay": ("number", "s", "By how much the wrench is late."),
    "force_torque_sensors[].range": ("list of numbers", "N, Nm", "Saturation, by axis."),
    "loads": ("list", "", "Bodies that the model lacks: adapter plate, sensor body, tool."),
    "loads[].link": ("text", "", "Link that carries the body."),
    "loads[].mass": ("number", "kg", "Mass."),
    "loads[].com": (THREE, "m", "Centre of mass in link axes."),
    "loads[].inertia": (SIX, "kg m²", f"Inertia: {INERTIA}."),
    "learned_rest": (
        "text",
        "",
        "A CSV of what the torques have beside the model, written by `calibrate --learn`.",
    ),
    "links": ("mapping LINK: mapping", "", "Corrections of links, written by `calibrate`."),
    "links.NAME.mass": ("number", "kg", "Mass, instead of the model's."),
    "links.NAME.com": (THREE, "m", "Centre of mass, instead of the model's."),
    "links.NAME.inertia": (SIX, "kg m²", f"Inertia, instead of the model's: {INERTIA}."),
    "graspable": ("list of text", "", "Links that may be pulled and twisted, not only pushed."),
    "pushes": ("mapping", "", "What touches: where contacts are looked for."),
    "pushes.friction": ("number", "", "Coefficient of friction: pushes come within its cone."),
    "pushes.reach": ("number", "m", "Free space that a push needs: length of a finger or tool."),
    "pushes.links": ("list of text", "", "Links that may be touched; default: all."),
    "noise": (
        "mapping",
        "",
        "1 sigma per sample: `q` [rad], `qd` [rad/s], `tau` [Nm], each SENSOR [N, Nm].",
    ),
    "observer": ("mapping", "", "How quickly loads are followed."),
    "observer.bandwidth": (
        "number or mapping",
        "rad/s",
        "K of all rows, or `{joints: K, SENSOR: K}`; the filter's corner is K/2π Hz.",
    ),
    "detection": ("mapping", "", "When residuals count as contacts."),
    "detection.method": (
        "list of `rows`, `scaled`, `chi2`, `glrt`, `cusum`",
        "",
        "Tests; an event begins when one of them fires.",
    ),
    "detection.false_alarms": ("number", "1/h", "Rate for the whole robot, where calibrated."),
    "detection.windows": ("list of numbers", "s", "Windows of `glrt`."),
    "detection.min_duration": ("number", "s", "How long a test must fire for an event to begin."),
    "detection.hold": ("number", "s", "How long all must be calm for an event to end."),
    "detection.release": ("number, 0 to 1", "", "Share of the thresholds that counts as calm."),
    "detection.baseline": ("mapping", "", "The slow mean that is taken out of the residuals."),
    "detection.baseline.time": ("number", "s", "Its time constant."),
    "detection.baseline.limit": (
        "number",
        "thresholds",
        "How far it may go from where it began, but for slow drift.",
    ),
    "detection.calibration": ("mapping", "", "Written by `calibrate`; not for editing by hand."),
    "detection.calibration.hours": ("number", "h", "Contact-free motion that it rests on."),
    "detection.calibration.period": ("number", "s", "Sample period for which it holds."),
    "detection.calibration.rows": (
        "mapping ROW: mapping",
        "",
        "What was found, by joint or by SENSOR.fx to mz.",
    ),
    "detection.calibration.rows.NAME.typical": (
        "number",
        "N or Nm",
        "Root mean square of the residual.",
    ),
    "detection.calibration.rows.NAME.slow": (
        THREE,
        "N or Nm",
        "Errors of the model beside the baseline: constant, per squared speed, per acceleration.",
    ),
    "detection.calibration.rows.NAME.quick": (
        THREE,
        "N or Nm",
        "The same beside the mean of the last 0.2 s.",
    ),
    "detection.calibration.tails": (
        "mapping SEGMENT: mapping",
        "",
        "How often levels were exceeded, by segment and method.",
    ),
    "detection.calibration.tails.NAME.NAME.level": ("number", "", "A level that was exceeded."),
    "detection.calibration.tails.NAME.NAME.per_hour": ("number", "1/h", "How often it was."),
    "detection.calibration.tails.NAME.NAME.scale": (
        "number",
        "",
        "Scale of the Pareto tail beyond.",
    ),
    "detection.calibration.tails.NAME.NAME.shape": (
        "number",
        "",
        "Shape of the Pareto tail beyond.",
    ),
    "policy": ("mapping", "", "What the robot does about which touch."),
    "policy.zones": (
        "mapping NAME: zone",
        "",
        "Zone of links or segments: `structure`, `end_effector` or `handle`.",
    ),
    "policy.onset": ("mapping", "", "Growth of force above which a touch is a collision."),
    "policy.onset.structure": ("number", "N/s", "The limit on the structure."),
    "policy.onset.end_effector": ("number", "N/s", "The limit on the end effector."),
    "policy.onset.handle": ("number", "N/s", "The limit on a handle."),
    "policy.rules": ("list", "", "The first rule that holds decides."),
    "policy.rules[].reaction": (
        "`ignore`, `stop`, `float`, `retract` or `own:NAME`",
        "",
        "What the robot does.",
    ),
    "policy.rules[].level": ("`contact` or `collision`", "", "Condition: level of the touch."),
    "policy.rules[].clamped": (
        "true or false",
        "",
        "Condition: whether forces on two sides oppose each other.",
    ),
    "policy.rules[].zone": ("zone", "", "Condition: zone that is touched."),
    "policy.rules[].segment": ("text", "", "Condition: segment that is touched."),
    "policy.rules[].link": ("text", "", "Condition: link that is touched."),
    "policy.rules[].force": ("number", "N", "Condition: the force is at least this."),
    "policy.limits": ("mapping NAME: mapping", "", "Largest forces, by link or segment."),
    "policy.limits.NAME.transient": ("number", "N", "Largest force for a short while."),
    "policy.limits.NAME.quasi_static": ("number", "N", "Largest force for longer."),
    "policy.limits.NAME.reaction": ("reaction", "", "What the robot does beyond these."),
    "policy.transient_time": ("number", "s", "How long a force counts as transient."),
    "policy.retract": ("mapping", "", "How the touched point moves away."),
    "policy.retract.way": ("number", "m", "How far it moves."),
    "policy.retract.speed": ("number", "m/s", "How fast it moves."),
    "interface": (
        "mapping NAME: mapping",
        "",
        "Named places on the arm that people touch on purpose.",
    ),
    "interface.NAME.kind": (
        "`button`, `toggle`, `slider`, `dial` or `pad`",
        "",
        "Which kind of widget it is.",
    ),
    "interface.NAME.link": ("text", "", "Link that carries it."),
    "interface.NAME.at": (THREE, "m", "Middle of a button, toggle, dial or pad, in link axes."),
    "interface.NAME.radius": ("number", "m", "Radius of a button, toggle or dial."),
    "interface.NAME.path": ("list of lists of 3 numbers", "m", "Corners of a slider's path."),
    "interface.NAME.width": ("number", "m", "Width of a slider."),
    "interface.NAME.normal": (THREE, "", "Axis of a dial, in link axes."),
    "interface.NAME.up": (THREE, "", "Direction of a pad's second coordinate, in link axes."),
    "interface.NAME.size": ("list of 2 numbers", "m", "Width and height of a pad."),
    "interface.NAME.force": ("number", "N", "The least force that counts."),
    "interface.NAME.most": ("number", "N", "From this force on, the policy answers the touch."),
    "interface.NAME.range": ("list of 2 numbers", "", "Values at the ends of a slider."),
    "interface.NAME.taught": ("list", "", "Touches that taught it, written by `teach`."),
    "interface.NAME.taught[].q": ("list of numbers", "rad or m", "Posture, one per joint."),
    "interface.NAME.taught[].step": ("list of numbers", "Nm", "Change of each external torque."),
    "log": ("mapping", "", "How a foreign log names its columns or topics."),
    "log.time": (
        "column",
        "",
        "Column of the time stamps; `{column: NAME, factor: 0.001}` for ms.",
    ),
    "log.q": (
        "column pattern",
        "rad or m",
        "Positions. `{joint}` stands for the joint's name, `{i}` for its number from 0, `{i1}` "
        "from 1.",
    ),
    "log.qd": (
        "column pattern",
        "rad/s or m/s",
        "Velocities, in the same way; they may be missing.",
    ),
    "log.tau": ("column pattern", "Nm or N", "Torques, in the same way."),
    "log.sensors": (
        "mapping SENSOR: column pattern",
        "N, Nm",
        "Wrenches; `{axis}` stands for fx to mz; or a list with a column for each axis.",
    ),
    "log.topics": (
        "mapping",
        "",
        "Topics of a rosbag2: `joint_states: /TOPIC`, `wrench: {SENSOR: /TOPIC}`.",
    ),
    "log.joint_names": ("mapping JOINT: text", "", "Name of each joint in the log."),
}
for level in ("contact", "collision"):
    MEANINGS |= {
        f"detection.{level}": ("mapping", "", f"Thresholds of a {level}; default: from the noise."),
        f"detection.{level}.torque": (
            "number, or one per joint",
            "Nm",
            "Threshold of the joint torques.",
        ),
        f"detection.{level}.force": (
            "number, or by sensor",
            "N",
            "Threshold of the sensors' forces.",
        ),
        f"detection.{level}.moment": (
            "number, or by sensor",
            "Nm",
            "Threshold of the sensors' moments.",
        ),
    }


@dataclass(frozen=True)
class Key:
    """A key that is accepted in `robot.yaml`.

    Attributes:
        place: in the file.
        default: as it would be written; None where the key is required.
    """

    place: str
    default: str | None


def accepted_keys() -> Iterator[Key]:
    """Yield every key that is accepted, from the classes that the file is read into.

    The keys of `log` are not among them: `touchline.logs.naming.LOG_KEYS` has those.
    """
    yield from _keys_of(RobotFile, "")


def _keys_of(cls: type, prefix: str) -> Iterator[Key]:
    hints = get_type_hints(cls)
    for entry in fields(cls):
        place = f"{prefix}{entry.name}"
        yield Key(place, _default(cls, entry))
        yield from _below(hints[entry.name], place)


def _below(hint: Any, place: str) -> Iterator[Key]:
    """Yield the keys within a value, through optional ones, lists and mappings."""
    origin, arguments = get_origin(hint), get_args(hint)
    if isinstance(hint, type) and is_dataclass(hint) and hint.__name__ != "Torque":
        yield from _keys_of(hint, f"{place}.")
    elif origin is list:
        yield from _below(arguments[0], f"{place}[]")
    elif origin is dict:
        yield from _below(arguments[1], f"{place}.NAME")
    elif origin is not None and origin is not tuple:  # optional
        for argument in arguments:
            yield from _below(argument, place)


def _default(cls: type, entry: Any) -> str | None:
    if (cls, entry.name) in REQUIRED:
        return None
    if entry.default is not MISSING:
        return shown(entry.default)
    if entry.default_factory is not MISSING:
        return shown(entry.default_factory())
    return None


def shown(value: Any) -> str:
    """Return a default as it would be written in the file."""
    if value is None:
        return "-"
    if is_dataclass(value):
        return getattr(value, "kind", "see below")
    if isinstance(value, tuple | list):
        if value and is_dataclass(value[0]):
            return "see below"
        return f"[{', '.join(map(shown, value))}]"
    if isinstance(value, dict):
        return "{}" if not value else str(value)
    if isinstance(value, float):
        return f"{value:g}"
    return str(value)
