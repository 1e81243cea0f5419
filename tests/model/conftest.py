# SPDX-License-Identifier: Apache-2.0
"""A small branched robot whose files the tests write and spoil."""

import os
from pathlib import Path

import pytest

ARM_URDF = """<robot name="arm">
  <link name="base"><inertial><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.1 0 0" rpy="0 0 0"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"><inertial><mass value="0.5"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="handle"><inertial><mass value="0.2"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="finger"><inertial><mass value="0.1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 2"/><limit lower="-1" upper="1" effort="10" velocity="3"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="hand"/>
    <origin xyz="0.3 0 0" rpy="0 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="grip" type="prismatic"><parent link="hand"/><child link="finger"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="10" velocity="3"/></joint>
  <joint name="mount" type="fixed"><parent link="upper"/><child link="handle"/></joint>
</robot>
"""

ROBOT_YAML = """name: arm
model: arm.urdf
joints:
  - {name: shoulder, torque: sensor}
  - {name: elbow, torque: sensor}
locked: {grip: 0.01}
force_torque_sensors:
  - {name: base_ft, link: base}
  - {name: wrist, link: hand}
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with arm.urdf and robot.yaml."""
    (tmp_path / "arm.urdf").write_text(ARM_URDF)
    (tmp_path / "robot.yaml").write_text(ROBOT_YAML)
    return tmp_path


@pytest.fixture
def data_folder():
    """The folder of recordings beside the repository."""
    beside = Path(__file__).parents[2].parent / "shared" / "data"
    found = Path(os.environ.get("TOUCHLINE_DATA", beside))
    if not found.is_dir():
        pytest.skip(f"no recordings: {found} is missing (set TOUCHLINE_DATA)")
    return found


def example_model(name: str) -> Path:
    """Return a URDF of example-robot-data, or skip."""
    from touchline.model.packages import resolve

    try:
        return resolve(f"package://example-robot-data/robots/{name}", Path())
    except FileNotFoundError as error:
        pytest.skip(str(error))


@pytest.fixture(
    params=[
        "panda_description/urdf/panda.urdf",
        "ur_description/urdf/ur10_robot.urdf",
        "kinova_description/robots/kinova.urdf",
    ],
    ids=["panda", "ur10", "kinova"],
)
def example_urdf(request):
    """The URDF of a real arm."""
    return example_model(request.param)
