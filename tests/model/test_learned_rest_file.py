# SPDX-License-Identifier: Apache-2.0
"""The file of a learned rest: written, read, and told where it is wrong."""

import numpy as np
import pytest

import touchline as tl
from touchline.model.learned_rest import LearnedRest, read_rest, write_rest
from touchline.model.robot_file import write_description

JOINTS = ["joint1", "joint2"]
TABLE = LearnedRest(
    (-1.0, 0.0, 1.0),
    (-0.5, 0.1, 0.2, 0.5),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.3, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0),
)


def test_what_is_written_is_read_again(tmp_path):
    write_rest(tmp_path / "rest.csv", {"joint2": TABLE})
    assert read_rest(tmp_path / "rest.csv", JOINTS) == {"joint2": TABLE}


@pytest.mark.parametrize(
    "change, told",
    [
        (lambda lines: lines[1:], "the first line must be joint,q,qd,torque,doubt"),
        (lambda lines: [*lines, "joint3,0,0,0,0"], "line 14: unknown joint 'joint3'"),
        (lambda lines: [*lines, "joint2,0,0"], "line 14 has 3 values, not 5"),
        (lambda lines: [*lines, "joint2,0,0,x,0"], "line 14: 0,0,x,0 are no numbers"),
        (lambda lines: [*lines, "joint2,0,nan,1,0"], "are not finite"),
        (lambda lines: lines[:-1], "joint2: the nodes are no grid"),
        (lambda lines: [*lines[:-1], lines[-2]], "joint2: the nodes are no grid"),
        (lambda lines: [*lines[:-1], "joint2,1,0.5,0.1,0"], "the edges of the grid must be 0"),
    ],
)
def test_what_is_wrong_with_a_file_is_told(tmp_path, change, told):
    path = tmp_path / "rest.csv"
    write_rest(path, {"joint2": TABLE})
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    with pytest.raises(tl.InputError, match=told):
        read_rest(path, JOINTS)


def test_a_description_names_its_file(tmp_path):
    robot = tl.load_robot("sara")
    name = robot.joint_names[1]
    write_rest(tmp_path / "rest.csv", {name: TABLE})
    text = "name: arm\nmodel: robot:sara\nlearned_rest: rest.csv\n"
    (tmp_path / "robot.yaml").write_text(text)
    read = tl.load_robot(tmp_path / "robot.yaml")
    assert [j.rest for j in read.description.joints if j.name == name] == [TABLE]
    (tmp_path / "other").mkdir()
    write_description(tmp_path / "robot.yaml", tmp_path / "other" / "robot.yaml", {})
    again = tl.load_robot(tmp_path / "other" / "robot.yaml")
    assert again.description.joints == read.description.joints
    (tmp_path / "robot.yaml").write_text(text.replace("rest.csv", "lost.csv"))
    with pytest.raises(tl.InputError, match=r"learned_rest: .*lost.csv: cannot be read"):
        tl.load_robot(tmp_path / "robot.yaml")


def test_a_table_never_leaves_its_nodes():
    rng = np.random.default_rng(0)
    q, qd = rng.uniform(-3, 3, 1000), rng.uniform(-2, 2, 1000)
    torque = TABLE.at(q, qd)
    assert np.abs(torque).max() <= TABLE.largest == 0.3
    outside = (np.abs(q) >= 1.0) | (np.abs(qd) >= 0.5)
    assert not torque[outside].any()
    np.testing.assert_allclose(TABLE.at(np.array([0.0, 0.0]), np.array([0.1, 0.2])), [0.3, -0.2])
