# SPDX-License-Identifier: Apache-2.0
"""Writes the model (URDF) and the robot descriptions."""

from math import pi
from pathlib import Path

from arms.inertia import Body
from arms.kinematics import JOINTS, JointRow

NOTICE = "Geometry and numbers are Touchline's own, not DLR's. Written by scripts/make_arms.py."
COLORS = {
    "shell": (0.90, 0.91, 0.92),
    "trim": (0.16, 0.17, 0.19),
    "metal": (0.55, 0.57, 0.60),
    "grip": (0.10, 0.11, 0.12),
    "accent": (0.05, 0.42, 0.66),
}
MATERIALS = {"link7": "metal", "tool": "trim", "handle": "grip"}
TRIMS = {"link0": "accent", "base_mount": "metal"}


def urdf(bodies: dict[str, Body], trims: set[str]) -> str:
    """The whole URDF; `bodies` are the links with mass, `trims` the links with drawn parts."""
    lines = ['<?xml version="1.0"?>', "<!-- SPDX-License-Identifier: Apache-2.0 -->"]
    lines += [f"<!-- {NOTICE} -->", '<robot name="sara">']
    lines += ["  <mujoco>", '    <compiler meshdir="meshes" balanceinertia="false"']
    lines += ['      discardvisual="false" fusestatic="false" strippath="true"/>', "  </mujoco>"]
    for name, rgb in COLORS.items():
        rgba = " ".join(f"{c:g}" for c in rgb)
        lines.append(f'  <material name="{name}"><color rgba="{rgba} 1"/></material>')
    for name in ("base_mount", *bodies):
        lines += _link(name, bodies.get(name), name in trims)
    for row in JOINTS:
        lines += _joint(row)
    return "\n".join([*lines, "</robot>", ""])


def _link(name: str, body: Body | None, trimmed: bool) -> list[str]:
    lines = [f'  <link name="{name}">']
    if body:
        lines += _inertial(body)
        lines += _shape("visual", f"{name}.stl", MATERIALS.get(name, "shell"))
    if trimmed:
        lines += _shape("visual", f"{name}_trim.stl", TRIMS.get(name, "trim"))
    if body:
        lines += _shape("collision", f"{name}.stl", None)
    return [*lines, "  </link>"]


def _inertial(body: Body) -> list[str]:
    com = " ".join(f"{c:.9g}" for c in body.com)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = zip(names, (xx, xy, xz, yy, yz, zz), strict=True)
    terms = " ".join(f'{n}="{v:.9g}"' for n, v in values)
    return [
        "    <inertial>",
        f'      <origin xyz="{com}"/>',
        f'      <mass value="{body.mass:g}"/>',
        f"      <inertia {terms}/>",
        "    </inertial>",
    ]


def _shape(tag: str, file: str, material: str | None) -> list[str]:
    lines = [f"    <{tag}>", f'      <geometry><mesh filename="meshes/{file}"/></geometry>']
    if material:
        lines.append(f'      <material name="{material}"/>')
    return [*lines, f"    </{tag}>"]


def _joint(row: JointRow) -> list[str]:
    xyz = " ".join(f"{v:g}" for v in row.xyz)
    rpy = " ".join(f"{v:.15g}" for v in row.rpy)
    lines = [
        f'  <joint name="{row.name}" type="{"revolute" if row.axis else "fixed"}">',
        f'    <parent link="{row.parent}"/>',
        f'    <child link="{row.child}"/>',
        f'    <origin xyz="{xyz}" rpy="{rpy}"/>',
    ]
    if row.axis:
        axis = " ".join(str(v) for v in row.axis)
        limit = f'lower="{-row.limit:.9g}" upper="{row.limit:.9g}"'
        lines.append(f'    <axis xyz="{axis}"/>')
        lines.append(f'    <limit {limit} velocity="{row.velocity:g}" effort="{row.effort:g}"/>')
    return [*lines, "  </joint>"]


HEADERS = {
    "sara": "The paper's layout: sensors in joints 2 to 5, the others read from base and wrist.",
    "sara-full": "As sara, with a torque sensor in every joint.",
    "sara-handle-1axis": "As sara, but the handle has a one-axis sensor (twist about its neck).",
}
SIXAXIS = {  # link, range of forces [N] and moments [Nm]
    "base": ("link0", 1500, 500),
    "wrist": ("tool", 400, 40),
    "handle": ("handle", 300, 25),
}


def robot_yaml(name: str) -> str:
    """The `robot.yaml` of one of the shipped variants."""
    model = "sara.urdf" if name == "sara" else "robot:sara"
    lines = ["# SPDX-License-Identifier: Apache-2.0", f"# {HEADERS[name]}", f"# {NOTICE}"]
    lines += [f"name: {name}", f"model: {model}", "gravity: [0, 0, -9.81]", "joints:"]
    lines += [_yaml_joint(row, name) for row in JOINTS if row.axis]
    lines.append("force_torque_sensors:")
    for sensor, (link, force, moment) in SIXAXIS.items():
        one_axis = sensor == "handle" and name == "sara-handle-1axis"
        axes = "mz" if one_axis else "fx, fy, fz, mx, my, mz"
        limits = ", ".join([f"{force}"] * 3 + [f"{moment}"] * 3)
        lines += [
            f"  - name: {sensor}",
            f"    link: {link}",
            "    pose: {xyz: [0, 0, 0], rpy: [0, 0, 0]}",
            f"    axes: [{axes}]",
            "    polarity: outboard",
            f"    range: [{limits}]",
        ]
    sigma = "[0.05, 0.05, 0.05, 0.01, 0.01, 0.01]"
    lines += ["noise:", "  q: 0.0", "  qd: 2.0e-4", "  tau: 0.05"]
    lines += [f"  {sensor}: {sigma}" for sensor in SIXAXIS]
    return "\n".join([*lines, "observer: {bandwidth: 100.0}", ""])


def _yaml_joint(row: JointRow, robot: str) -> str:
    source = {"joint1": "base", "joint6": "wrist", "joint7": "wrist"}.get(row.name)
    if source and robot != "sara-full":
        return f"  - {{name: {row.name}, torque: {{from: [{source}]}}}}"
    return f"  - {{name: {row.name}, torque: sensor, range: {row.effort:g}}}"


def simulation_yaml() -> str:
    """Home position and joint impedance gains for simulations of the arm."""
    home = (0.0, 0.45, 0.0, 1.45, 0.0, round(pi - 1.9, 4), 0.0)
    rows = {
        "home": home,
        "stretched": (0.0,) * 7,
        "stiffness": (1200, 1200, 800, 800, 300, 200, 60),
        "damping": (75, 75, 35, 30, 7, 5, 0.8),
    }
    units = {"home": "rad, tool down", "stretched": "rad, singular", "stiffness": "Nm/rad"}
    units["damping"] = "Nm s/rad"
    lines = ["# SPDX-License-Identifier: Apache-2.0"]
    lines.append("# Suggestions for joint impedance control of `sara`, joints 1 to 7.")
    for key, values in rows.items():
        lines.append(f"{key}: [{', '.join(f'{v:g}' for v in values)}]  # {units[key]}")
    return "\n".join([*lines, ""])


def write(path: Path, text: str) -> None:
    """`text` to `path`, making its directory."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
