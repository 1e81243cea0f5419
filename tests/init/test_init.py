"""`touchline init`: descriptions of real robots and recordings without a line by hand."""

import os
from pathlib import Path

import numpy as np
import pytest
from bag_support import JOINTS, WRENCH, joint_state, wrench, write_bag

import touchline as tl
from touchline.cli import main
from touchline.init.contents import Contents, JointStates
from touchline.init.signals import find_signals
from touchline.logs import open_log
from touchline.model.guess import UNKNOWN, cautions, family_of, guess_description
from touchline.model.loading import load_mechanism
from touchline.model.sources import example_models, find_robot

DATA = Path(os.environ.get("TOUCHLINE_DATA", Path(__file__).parents[3] / "shared" / "data"))
URDF = """<robot name="arm"><link name="base"/>
{links}
</robot>"""
LINK = """<link name="{name}"><inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01"
ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size=".1 .1 .3"/></geometry>
</collision></link><joint name="{joint}" type="{kind}"><parent link="{parent}"/>
<child link="{name}"/><origin xyz="0 0 .3"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2" effort="50" velocity="2"/></joint>"""


def arm(folder, *joints, name="arm"):
    """A chain of joints (name, child, kind)."""
    parent, parts = "base", []
    for i, (joint, child, kind) in enumerate(joints):
        axis = ("0 0 1", "0 1 0")[i % 2]
        parts.append(LINK.format(name=child, joint=joint, kind=kind, parent=parent, axis=axis))
        parent = child
    path = folder / f"{name}.urdf"
    path.write_text(URDF.replace('"arm"', f'"{name}"').format(links="\n".join(parts)))
    return path


def chain(folder, n=6, **options):
    return arm(folder, *((f"j{i + 1}", f"l{i + 1}", "revolute") for i in range(n)), **options)


def real(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"no recordings at {DATA}: set TOUCHLINE_DATA")
    return path


@pytest.mark.parametrize(
    ("name", "torque", "locked"),
    [
        ("panda", "sensor", ["panda_finger_joint1"]),
        ("ur3", "motor", []),
        ("ur5", "motor", []),
        ("ur10_robot", "motor", []),
        ("xarm7", "motor", []),
        ("so100", "none", ["gripper"]),
        ("talos_left_arm", "sensor", ["gripper_left_joint"]),
        ("z1", "motor", ["jointGripper"]),
    ],
)
def test_robots_by_name(name, torque, locked):
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    robot = tl.load_robot(name)
    assert {joint.torque for joint in robot.description.joints} == {torque}
    assert sorted(robot.description.locked) == locked
    assert robot.assumed[0].startswith(f"joint torques are `torque: {torque}`")


def test_every_model_of_the_collection_is_read_or_told_what_is_wrong():
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    names = example_models()
    assert len(names) > 50
    read = 0
    for name in names:
        try:
            read += bool(tl.load_robot(name).assumed)
        except tl.InputError as error:
            assert str(names[name]) in str(error)
    assert read > len(names) - 6


def test_an_unknown_name_is_answered_with_those_there_are():
    with pytest.raises(tl.InputError, match="did you mean 'sara'"):
        find_robot("sarah")
    with pytest.raises(tl.InputError, match="is a folder without robot.yaml"):
        find_robot(Path(__file__).parent)


def test_a_folder_stands_for_the_description_in_it_and_hides_no_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shipped = find_robot("sara")
    Path("sara").mkdir()  # of results, say
    assert find_robot("sara") == shipped
    Path("sara/robot.yaml").write_text(shipped.path.read_text())
    assert find_robot("sara").path == Path("sara/robot.yaml")


def test_names_of_families():
    assert family_of(["ur5e"], []).torque == "motor"
    assert family_of(["xarm7_nohand"], []).torque == "motor"
    assert family_of(["so_arm100"], []).torque == "none"
    assert family_of(["lbr_iiwa14"], []).torque == "sensor"
    assert family_of(["fourlegs", "curfew"], []) is UNKNOWN


def test_wheels_fingers_legs_and_coupled_joints(tmp_path):
    joints = [
        ("front_wheel_joint", "wheel", "continuous"),
        ("shoulder", "upper", "revolute"),
        ("gripper_joint", "gripper", "revolute"),
        ("slide", "pad", "prismatic"),
    ]
    guess = guess_description(load_mechanism(arm(tmp_path, *joints)), tmp_path / "arm.urdf")
    assert guess.observed == ("shoulder",)
    assert set(guess.locked) == {"front_wheel_joint", "gripper_joint", "slide"}
    assert "wheels" in guess.cautions[0]
    legs = arm(tmp_path, ("hip", "thigh", "revolute"), ("knee", "shank", "revolute"), name="leg")
    (line,) = cautions(load_mechanism(legs))
    assert "legs" in line and "root link is taken to stand still" in line
    hand = arm(tmp_path, ("finger1", "f1", "revolute"), ("finger2", "f2", "revolute"), name="h")
    assert not guess_description(load_mechanism(hand), hand).locked  # a hand alone is its fingers


def table(joints, q="q.{}", qd="qd.{}", tau="tau.{}", time="time", step=1e-3, extra=()):
    columns = {time: step * np.arange(50)}
    for pattern in (q, qd, tau):
        for i, joint in enumerate(joints):
            if pattern:
                columns[pattern.format(joint, i=i, i1=i + 1)] = np.zeros(50)
    return Contents(columns | {name: np.zeros(50) for name in extra})


@pytest.mark.parametrize(
    ("options", "log"),
    [
        ({}, {}),
        ({"time": "Time", "step": 1.0}, {"time": {"column": "Time", "factor": 1e-3}}),
        ({"time": "timestamp", "step": 1e6}, {"time": {"column": "timestamp", "factor": 1e-9}}),
        ({"time": "t"}, {"time": "t"}),
        ({"time": "stamp_ms", "step": 1.0}, {"time": {"column": "stamp_ms", "factor": 1e-3}}),
        ({"time": "Time [s]"}, {"time": "Time [s]"}),
        ({"tau": "tau_J{i}"}, {"tau": "tau_J{i}"}),
        ({"q": "Position{i1}"}, {"q": "Position{i1}"}),
        ({"q": "actual_q_{i}", "qd": "dq[{i}]"}, {"q": "actual_q_{i}", "qd": "dq[{i}]"}),
        ({"tau": "{}.effort"}, {"tau": "{joint}.effort"}),
        ({"qd": ""}, {}),
    ],
    ids=str,
)
def test_columns_of_tables(tmp_path, options, log):
    mechanism = load_mechanism(chain(tmp_path))
    joints = [f"j{i + 1}" for i in range(6)]
    found = find_signals(table(joints, **options), mechanism, joints)
    assert found.log == log and found.has_torque


def test_joints_that_a_recording_lacks_are_locked(tmp_path, capsys):
    model = chain(tmp_path)
    log = tmp_path / "log.csv"
    names = ["t", *(f"j{i}_position" for i in (2, 3, 4)), *(f"j{i}_effort" for i in (2, 4))]
    rows = [",".join(["0"] * len(names)) for _ in range(20)]
    log.write_text("\n".join([",".join(names), *rows]) + "\n")
    out = tmp_path / "robot.yaml"
    assert main(["init", str(model), str(log), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "locked: j1, j5, j6: the recording does not have it" in told
    assert "no torque is recorded of j3" in told
    joints = {j.name: j.torque for j in tl.load_robot(out).description.joints}
    assert joints == {"j2": "sensor", "j3": "none", "j4": "sensor"}
    assert tl.load_robot(out).description.locked == {"j1": 0.0, "j5": 0.0, "j6": 0.0}


def test_torques_that_are_all_zero_give_way_to_others(tmp_path):
    joints = [f"j{i + 1}" for i in range(6)]
    mechanism, zeros = load_mechanism(chain(tmp_path)), table(joints, tau="TorqueSm{i1}").columns
    others = {f"Torque{i + 1}": np.sin(np.arange(50.0)) for i in range(6)}
    assert find_signals(Contents(zeros), mechanism, joints).log["tau"] == "TorqueSm{i1}"
    assert find_signals(Contents(zeros | others), mechanism, joints).log["tau"] == "Torque{i1}"


@pytest.mark.parametrize(
    ("names", "how"),
    [
        (("Base", "Shoulder", "Elbow"), "their order"),
        (("left_j3", "left_j1", "left_j2", "gripper"), "what stands around them"),
        (("j1.pos", "j2.pos", "j3.pos", "j10.pos"), "what stands around them"),
    ],
)
def test_joints_of_other_names_are_taken(tmp_path, names, how):
    mechanism, joints = load_mechanism(chain(tmp_path, 3)), ["j1", "j2", "j3"]
    contents = Contents(joint_states={"/arm": JointStates(names, True, True)})
    found = find_signals(contents, mechanism, joints)
    expected = dict(zip(joints, sorted(names[:3]) if "left_j3" in names else names, strict=False))
    assert found.log == {"topics": {"joint_states": "/arm"}, "joint_names": expected}
    assert found.has_torque and not found.absent
    assert any(f"taken by {how}" in line for line in found.statements)


def test_joints_of_another_number_are_not_taken(tmp_path):
    mechanism = load_mechanism(chain(tmp_path, 3))
    contents = Contents(joint_states={"/arm": JointStates(("a", "b"), True, True)})
    found = find_signals(contents, mechanism, ["j1", "j2", "j3"])
    assert not found.log and any("no topic of joint states" in x for x in found.statements)


def test_a_bag_of_ros_1_is_answered_with_its_conversion(tmp_path, capsys):
    bag = tmp_path / "run.bag"
    bag.write_bytes(b"#ROSBAG V2.0")
    assert main(["init", str(chain(tmp_path)), str(bag), "--out", str(tmp_path / "r.yaml")]) == 2
    assert f"rosbags-convert --src {bag} --dst {tmp_path / 'run'}" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["i{i1}", "motor_current_{i}", "{}.current"])
def test_motor_currents_are_told(tmp_path, name):
    joints = [f"j{i + 1}" for i in range(6)]
    found = find_signals(table(joints, tau=name), load_mechanism(chain(tmp_path)), joints)
    assert found.currents and found.has_torque
    assert any("seem motor currents" in line for line in found.statements)


def test_sensors_of_tables(tmp_path):
    mechanism = load_mechanism(chain(tmp_path))
    joints = [f"j{i + 1}" for i in range(6)]
    extra = [f"wrist_ft/{kind}{axis}" for kind in "ft" for axis in "xyz"]
    extra += [f"l2.{axis}" for axis in ("fx", "fy", "fz", "mx", "my", "mz")]
    extra += [f"lame.{axis}" for axis in ("fx", "fy")]
    found = find_signals(table(joints, extra=extra), mechanism, joints)
    assert [(s.name, s.link) for s in found.sensors] == [("wrist", "l6"), ("l2", "l2")]
    assert found.log["sensors"] == {
        "wrist": {"fx": "wrist_ft/fx", "fy": "wrist_ft/fy", "fz": "wrist_ft/fz"}
        | {"mx": "wrist_ft/tx", "my": "wrist_ft/ty", "mz": "wrist_ft/tz"}
    }


@pytest.mark.parametrize(
    ("model", "log", "torque"),
    [
        ("panda", "panda_touches/a4.csv.gz", "sensor"),
        ("kinova_gen3/kinovaGen3V12.urdf", "kinova_gen3/opti_traj_testing1.csv", "sensor"),
        ("ur10", "panda_ur10_rosbag2/ur10_exciting_trajectory.db3", "motor"),
        ("kuka_lwr4/kuka_lwr4.urdf", "kuka_lwr4/free_motion_1.csv.gz", "sensor"),
    ],
)
def test_real_recordings_are_read_with_the_description_that_init_writes(
    tmp_path, model, log, torque, capsys
):
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    log, out = real(log), tmp_path / "robot.yaml"
    model = str(DATA / model) if (DATA / model).exists() else model
    assert main(["init", model, str(log), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert f"joint torques are `torque: {torque}`" in said
    robot = tl.load_robot(out)
    with open_log(log, robot.description) as recording:
        samples = next(recording.chunks(1000))
    assert np.isfinite(samples.q).all() and np.isfinite(samples.tau).any()
    assert tl.Pipeline(robot).update(
        samples.time[0], samples.q[0], samples.qd[0], samples.tau[0], samples.wrench[0]
    )


def bag_of(folder, names, *sensors, first=b"\x00\x01"):
    """A bag of two instants whose first message of joint states is damaged."""
    values = [0.1] * len(names)
    messages = [("/joint_states", 1.0, JOINTS, first)]
    for t in (1.01, 1.02):
        state = joint_state(t, names, values, [float("nan")] * len(names), values)
        messages.append(("/joint_states", t, JOINTS, state))
        for topic, frame in sensors:
            messages.append((topic, t, WRENCH, wrench(t, range(6), frame)))
    return write_bag(folder / "bag", messages)


def test_topics_of_a_bag(tmp_path, capsys):
    model, out = chain(tmp_path), tmp_path / "robot.yaml"
    names = [f"j{i + 1}" for i in range(5)]
    sensors = ("/wrist/wrench", "l5"), ("/base/ft/wrench", ""), ("/ft/raw", ""), ("/ft/data", "")
    bag = bag_of(tmp_path, names, *sensors)
    assert main(["init", str(model), str(bag), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "joints are in /joint_states, with position, effort" in told
    assert "sensor wrist (/wrist/wrench) carries l5: its messages are in the frame l5" in told
    assert "sensor base (/base/ft/wrench) carries base: the link has its name" in told
    assert "sensor ft (/ft/raw) carries l6: the model does not tell" in told
    assert "sensor ft_4 (/ft/data)" in told
    robot = tl.load_robot(out)
    assert robot.sensor_names == ("wrist", "base", "ft", "ft_4")
    assert robot.description.locked == {"j6": 0.0}
    with open_log(bag, robot.description) as recording:
        samples = next(recording.chunks(10))
    assert samples.q[-1] == pytest.approx([0.1] * 5)
    assert samples.wrench[-1, 0] == pytest.approx(range(6))


def test_a_bag_of_another_robot_is_told(tmp_path, capsys):
    model, out = chain(tmp_path), tmp_path / "robot.yaml"
    bag = bag_of(tmp_path, ["wheel_left", "wheel_right"])
    assert main(["init", str(model), str(bag), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "no topic of joint states has these joints; those recorded: wheel_left, wheel" in told
    assert "`torque: none`: no joint torques were found in the recording" in told
    assert {j.torque for j in tl.load_robot(out).description.joints} == {"none"}


@pytest.mark.parametrize(
    ("name", "link", "why"),
    [
        ("pedestal_base", "l1", "it is called a base sensor"),
        ("wrist", "tool_ft_sensor", "the model has a link that is named like a force-torque"),
    ],
)
def test_the_link_of_a_sensor_by_its_name(tmp_path, name, link, why):
    joints = [("j1", "l1", "revolute"), ("j2", "l2", "revolute")]
    joints += [("mount", "tool_ft_sensor", "fixed"), ("j3", "l3", "revolute")]
    path = arm(tmp_path, *joints, name="x")
    path.write_text(path.read_text().replace('"base"', '"world"'))
    mechanism = load_mechanism(path)
    extra = [f"{name}.{axis}" for axis in ("fx", "fy", "fz", "mx", "my", "mz")]
    found = find_signals(table(["j1", "j2"], extra=extra), mechanism, ["j1", "j2"])
    (sensor,) = found.sensors
    assert (sensor.name, sensor.link) == (name, link) and why in sensor.why


def test_what_a_table_lacks_is_told(tmp_path):
    joints = [f"j{i + 1}" for i in range(6)]
    mechanism = load_mechanism(chain(tmp_path))
    found = find_signals(table(joints, time="row", q="", tau=""), mechanism, joints)
    assert not found.has_torque
    for words in ("recognized as the time", "recognized as q", "recognized as tau"):
        assert any(words in line for line in found.statements)


@pytest.mark.parametrize("rows", [0, 3])
def test_tables_of_words_and_without_rows(tmp_path, capsys, rows):
    """The columns' names tell the signals; cells that are no numbers tell nothing of the time."""
    import pyarrow
    import pyarrow.parquet

    names = ["time", *(f"{signal}.j{i + 1}" for signal in ("q", "tau") for i in range(6))]
    cells = pyarrow.array(["x"] * rows, pyarrow.string())
    path, out = tmp_path / "log.parquet", tmp_path / "robot.yaml"
    pyarrow.parquet.write_table(pyarrow.table({name: cells for name in names}), path)
    assert main(["init", str(chain(tmp_path)), str(path), "--out", str(out)]) == 0
    assert "velocities are not in the recording" in capsys.readouterr().out
    assert {joint.torque for joint in tl.load_robot(out).description.joints} == {"sensor"}


def test_places_and_models_that_do_not_fit_are_one_line(tmp_path, capsys):
    model = chain(tmp_path)
    (tmp_path / "file").write_text("")
    for name, out, words in (
        (model, tmp_path / "robot.txt", "must end in .yaml"),
        (model, tmp_path / "file" / "robot.yaml", "cannot be written"),
        ("sara", tmp_path / "robot.yaml", "is a description already"),
    ):
        assert main(["init", str(name), "--out", str(out)]) == 2
        assert words in capsys.readouterr().err


def test_a_file_that_is_there_is_kept(tmp_path, capsys):
    model, out = chain(tmp_path), tmp_path / "robot.yaml"
    out.write_text("mine")
    assert main(["init", str(model), "--out", str(out)]) == 2
    assert "--overwrite" in capsys.readouterr().err and out.read_text() == "mine"
    assert main(["init", str(model), "--out", str(out), "--overwrite"]) == 0
    assert tl.load_robot(out).name == "arm"
    assert not list(tmp_path.glob(".*"))


def test_a_floating_robot_is_told(tmp_path, capsys):
    model = tmp_path / "leg.xml"
    model.write_text(
        '<mujoco><worldbody><body name="pelvis"><freejoint/><geom size=".1"/><body name="thigh">'
        '<joint name="hip"/><geom size=".1"/></body></body></worldbody></mujoco>'
    )
    assert main(["init", str(model), "--out", str(tmp_path / "robot.yaml")]) == 0
    told = "  ! pelvis floats on a free joint; it is taken to stand still on the world\n"
    assert told in capsys.readouterr().out


@pytest.mark.parametrize("log", ["none.csv", "log.txt", "empty.csv", "broken.parquet"])
def test_a_recording_that_cannot_be_read_is_one_line(tmp_path, capsys, log):
    model, path = chain(tmp_path), tmp_path / log
    if log != "none.csv":
        path.write_text("" if log == "empty.csv" else "x")
    assert main(["init", str(model), str(path), "--out", str(tmp_path / "r.yaml")]) == 2
    assert str(path) in capsys.readouterr().err
    assert not (tmp_path / "r.yaml").exists()


def test_a_xacro_is_expanded(tmp_path):
    pytest.importorskip("xacro")
    text = chain(tmp_path, 2).read_text()
    path = tmp_path / "arm.xacro"
    macro = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    macro += '<xacro:property name="half" value="0.15"/>'
    text = text.replace('<robot name="arm">', macro).replace("0 0 .3", "0 0 ${2*half}")
    path.write_text(text)
    robot = tl.load_robot(path)
    assert robot.mechanism.joints["j1"].T_parent_joint[2, 3] == pytest.approx(0.3)
    path.write_text(text.replace("${2*half}", "${nothing}"))
    with pytest.raises(tl.InputError, match="xacro cannot expand it"):
        tl.load_robot(path)


def test_a_xacro_finds_packages_around_it(tmp_path, monkeypatch):
    """In a workspace without ROS: its own package, whatever its folder is called, and others."""
    pytest.importorskip("xacro")
    arm, tool = tmp_path / "src" / "arm-main", tmp_path / "src" / "tool_description"
    for folder, name in ((arm, "arm_description"), (tool, "tool_description")):
        (folder / "urdf").mkdir(parents=True)
        (folder / "package.xml").write_text(f"<package><name>{name}</name></package>")
    text = chain(tmp_path, 2).read_text()
    names = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    (tool / "urdf" / "tool.xacro").write_text(
        f'<robot {names}><xacro:property name="half" value="0.25"/></robot>'
    )
    head = f'<robot name="arm" {names}>'
    for package, file in (("arm_description", "own.xacro"), ("tool_description", "tool.xacro")):
        head += f'<xacro:include filename="$(find {package})/urdf/{file}"/>'
    (arm / "urdf" / "own.xacro").write_text(f"<robot {names}/>")
    path = arm / "urdf" / "arm.urdf.xacro"
    path.write_text(text.replace('<robot name="arm">', head).replace("0 0 .3", "0 0 ${2*half}"))
    robot = tl.load_robot(path)
    assert robot.mechanism.joints["j1"].T_parent_joint[2, 3] == pytest.approx(0.5)
    tool.rename(tmp_path / "elsewhere")
    with pytest.raises(tl.InputError, match="package 'tool_description' not found: install it"):
        tl.load_robot(path)


def test_names_of_robot_descriptions_come_from_its_cache_alone(tmp_path, monkeypatch):
    pytest.importorskip("robot_descriptions")
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    with pytest.raises(tl.InputError, match="is not there; fetch it once"):
        tl.load_robot("ur5e_mj")
    folder = tmp_path / "mujoco_menagerie" / "universal_robots_ur5e"
    folder.mkdir(parents=True)
    (folder / "ur5e.xml").write_text(
        """<mujoco model="ur5e"><worldbody><body name="link"><joint name="elbow" axis="0 1 0"/>
        <geom size=".1" mass="1"/></body></worldbody></mujoco>"""
    )
    robot = tl.load_robot("ur5e_mj")
    assert robot.description.joints[0].torque == "motor"
    assert repr(robot) == (
        "<Robot ur5e: 1 joints, 1 with torques; force-torque sensors: none; segments: root>"
    )
