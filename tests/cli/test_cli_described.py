# SPDX-License-Identifier: Apache-2.0
"""Commands that write a description start from a model alone, as the others do."""

import pytest
from free_motion import free_motion

import touchline as tl
from touchline.cli import main
from touchline.cli.described import described
from touchline.logs import write_table

URDF = """<robot name="two"><link name="base"/>
<link name="one"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
 iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="9" velocity="1"/></joint></robot>"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    return path


def test_a_description_is_taken_as_it_is(tmp_path):
    with described("sara", None, tmp_path / "new.yaml") as source:
        assert source == "sara"


def test_a_model_gets_a_first_description_beside_the_new_one(tmp_path, model, capsys):
    with described(str(model), None, tmp_path / "new.yaml") as source:
        assert tl.load_robot(source).joint_names == ("j",)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["two.urdf"]
    assert "assumed, as there is no robot.yaml" in capsys.readouterr().out


def test_calibrate_takes_a_model(tmp_path, model, monkeypatch, capsys):
    robot, log, seen = tl.load_robot(model), tmp_path / "free.parquet", []
    write_table(log, free_motion(robot, seconds=1.0, rate=100.0), robot.description)

    def stops(logs, source, *_):
        seen.append(tl.load_robot(source).description.path)
        raise tl.InputError("that is enough")

    monkeypatch.setattr("touchline.calibrate.run.calibrate", stops)
    out = tmp_path / "robot.yaml"
    assert main(["calibrate", str(log), "--robot", str(model), "--out", str(out)]) == 2
    assert "that is enough" in capsys.readouterr().err
    assert seen and seen[0].parent == tmp_path and not seen[0].exists()


ARM = """<mujoco model="two"><worldbody><body name="one"><joint name="j" axis="0 0 1"/>
<geom size=".1" mass="2"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("file", "text"), [("arm.urdf", URDF), ("arm.xml", ARM)])
def test_analyze_takes_a_model(tmp_path, file, text, capsys):
    (tmp_path / file).write_text(text)
    robot, log = tl.load_robot(tmp_path / file), tmp_path / "free.parquet"
    write_table(log, free_motion(robot, seconds=1.0, rate=100.0), robot.description)
    out = tmp_path / "results"
    given = ["analyze", str(log), "--robot", str(tmp_path / file), "--out", str(out)]
    assert main([*given, "--report", "none"]) == 0
    assert (out / "events.json").is_file() and "results:" in capsys.readouterr().out


def test_an_export_into_nowhere_is_told(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "x.touchline"
    assert main(["export", "sara", "--out", str(out)]) == 2
    assert f"{out}: cannot be written" in capsys.readouterr().err
