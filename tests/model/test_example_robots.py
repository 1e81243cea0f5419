# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest

from touchline.model.loading import read_robot_file

ROBOTS = Path(__file__).parents[2] / "examples" / "robots"


@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*.yaml")), ids=lambda path: path.stem)
def test_example_robots_are_right(path, data_folder, tmp_path):
    """Every description reads without an error; only Gen3's meshes are missing."""
    pytest.importorskip("pinocchio", reason="comes with example-robot-data in the test group")
    text = path.read_text().replace("../../../shared/data", str(data_folder))
    copy = tmp_path / path.name
    copy.write_text(text)
    robot, mechanism = read_robot_file(copy)
    assert robot.name == path.stem.replace("_", "-")
    missing_meshes = path.stem == "kinova_gen3"
    assert bool(mechanism.warnings) == missing_meshes


def test_the_hand_is_off():
    pytest.importorskip("pinocchio", reason="comes with example-robot-data in the test group")
    masses = []
    for name in ("panda_hand", "panda_no_hand", "panda_wrist_ft"):
        _, mechanism = read_robot_file(ROBOTS / f"{name}.yaml")
        masses.append(sum(link.inertia.mass for link in mechanism.links.values()))
    assert masses[0] - masses[1] == pytest.approx(0.76)  # hand 0.73, fingers 0.015 each
    assert masses[2] - masses[0] == pytest.approx(0.35)
