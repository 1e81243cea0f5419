# SPDX-License-Identifier: Apache-2.0
"""Plain arms of any number of joints, and what their sensors read while they are pushed."""

import numpy as np

from touchline.model.robot import load_robot
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import scripted
from touchline.simulation.scene import Run

LINK = """  <link name="link{i}">
    <inertial><origin xyz="0 0 0.12"/><mass value="{mass}"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.12"/><geometry><cylinder radius="0.05" length="0.24"/></geometry>
    </collision>
  </link>
"""
JOINT = """  <joint name="joint{i}" type="revolute"><parent link="link{p}"/><child link="link{i}"/>
    <origin xyz="0 0 0.24"/><axis xyz="{axis}"/>
    <limit lower="-3" upper="3" effort="200" velocity="3"/></joint>
"""


def write_arm(folder, joints, sensor=True, extra=""):
    """The path of a robot.yaml."""
    parts = [LINK.format(i=i, mass=5 - 0.5 * i) for i in range(joints + 1)]
    axes = ["0 0 1", "0 1 0"]
    parts += [JOINT.format(i=i, p=i - 1, axis=axes[(i + 1) % 2]) for i in range(1, joints + 1)]
    (folder / "arm.urdf").write_text(f'<robot name="arm{joints}">\n{"".join(parts)}</robot>\n')
    text = f"name: arm{joints}\nmodel: arm.urdf\njoints:\n"
    text += "".join(f"  - {{name: joint{i}, torque: sensor}}\n" for i in range(1, joints + 1))
    if sensor:
        text += f"force_torque_sensors:\n  - {{name: wrist, link: link{joints}}}\n"
    noise = "noise: {qd: 2.0e-4, tau: 0.05"
    text += noise + (", wrist: [0.05, 0.05, 0.05, 0.01, 0.01, 0.01]}\n" if sensor else "}\n")
    path = folder / "robot.yaml"
    path.write_text(text + extra)
    return path


def make_arm(folder, joints, sensor=True, extra=""):
    return load_robot(write_arm(folder, joints, sensor, extra))


def pushed(robot, seconds=4.0, rate=500.0, force=20.0, begin=2.0, hold=1.0):
    """Samples of an arm that stands and is pushed on its last link but one."""
    n = len(robot.joint_names)
    push = ScriptedContact(
        f"link{n - 2}",
        np.array([0.05, 0.0, 0.12]),
        np.array([-force, 0.0, 0.0]),
        Profile(begin, hold=hold),
    )
    pose = np.array([0.3, 0.5, -0.2, 0.7, 0.1, 0.4, 0.2][:n])
    run = Run(noise=SensorNoise(), rate=rate)
    return scripted(robot, [push], seconds, settings=run, start=pose).samples
