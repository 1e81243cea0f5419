# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from touchline.errors import InputError
from touchline.model import schema
from touchline.model.description import Friction, RowCalibration
from touchline.model.loading import load_description, read_robot_file

CONTRACT_JOINT = """name: shoulder, torque: motor, sign: -1, gain: 2, bias: 0.5, delay: 1e-3,
  range: 87.0, compensated: gravity, rotor_inertia: 0.2, friction: {coulomb: 0.3, viscous: 1}"""


def write(folder, text):
    path = folder / "robot.yaml"
    path.write_text(text)
    return path


def edit(folder, *changes, more=""):
    text = (folder / "robot.yaml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return write(folder, text + more)


def test_defaults(folder):
    robot = load_description(folder / "robot.yaml")
    assert [joint.name for joint in robot.joints] == ["shoulder", "elbow"]
    assert robot.noise.q == (0.0, 0.0)
    assert robot.noise.qd == (2e-4, 2e-4)
    assert robot.noise.tau == (0.05, 0.05)
    assert robot.noise.sensors["wrist"] == (0.05, 0.05, 0.05, 0.01, 0.01, 0.01)
    assert robot.bandwidth_joints == (100.0, 100.0)
    assert robot.bandwidth_sensors == {"base_ft": 100.0, "wrist": 100.0}
    assert robot.model == folder / "arm.urdf"
    assert robot.sensors[0].range == (math.inf,) * 6
    assert robot.gravity is None


def test_all_keys_of_the_contract(folder):
    path = edit(
        folder,
        ("name: shoulder, torque: sensor", CONTRACT_JOINT),
        (
            "{name: wrist, link: hand}",
            """
    name: wrist
    link: hand
    pose: {xyz: [0, 0, 0.1], rpy: [0, 0, 1]}
    axes: [fx, fz, mz]
    polarity: inboard
    frame: base
    compensated: gravity
    bias: [1, 2, 3]
    delay: 0.002
    range: [10, .inf, 30]""",
        ),
        ("name: arm", "name: arm\npackage_dirs: [.]\ngravity: [0, 0, 9.81]"),
        more="loads: [{link: hand, mass: 0.3, com: [0, 0, 0.1], inertia: [1, 0, 0, 1, 0, 1]}]\n"
        "links: {base: {mass: 3}}\ndetection: {release: 0.5}\nlog: {time: t}\n"
        "noise: {q: 1e-5, qd: [1e-3, 2e-3], base_ft: 0.1, wrist: [1, 2, 3]}\n"
        "observer: {bandwidth: {joints: [10, 20], wrist: 50}}\n",
    )
    robot = load_description(path)
    joint = robot.joints[0]
    assert (joint.torque, joint.sign, joint.gain, joint.bias) == ("motor", -1.0, 2.0, 0.5)
    assert (joint.delay, joint.range, joint.compensated) == (1e-3, 87.0, "gravity")
    assert (joint.rotor_inertia, joint.friction) == (0.2, Friction(0.3, 1.0, 0.05))
    wrist = robot.sensors[1]
    assert (wrist.xyz, wrist.rpy) == ((0.0, 0.0, 0.1), (0.0, 0.0, 1.0))
    assert (wrist.axes, wrist.polarity, wrist.frame) == (("fx", "fz", "mz"), "inboard", "base")
    assert wrist.bias == (1.0, 0.0, 2.0, 0.0, 0.0, 3.0)
    assert wrist.range == (10.0, math.inf, math.inf, math.inf, math.inf, 30.0)
    assert (wrist.compensated, wrist.delay) == ("gravity", 0.002)
    assert robot.noise.q == (1e-5, 1e-5)
    assert robot.noise.qd == (1e-3, 2e-3)
    assert robot.noise.sensors["base_ft"] == (0.1,) * 6
    assert robot.noise.sensors["wrist"] == (1.0, 0.05, 2.0, 0.01, 0.01, 3.0)
    assert robot.bandwidth_joints == (10.0, 20.0)
    assert robot.bandwidth_sensors == {"base_ft": 100.0, "wrist": 50.0}
    assert robot.links["base"].mass == 3.0
    assert robot.links["base"].com is None
    assert robot.loads[0].inertia == (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    assert (robot.gravity, robot.package_dirs) == ((0.0, 0.0, 9.81), (folder / ".",))
    assert (robot.detection.release, robot.log) == (0.5, {"time": "t"})


def test_without_a_name_it_is_the_model_s(folder):
    assert load_description(edit(folder, ("name: arm\n", ""))).name == "arm"
    model = folder / "arm.urdf"
    model.write_text(model.read_text().replace('<robot name="arm"', '<robot name="its own"'))
    assert load_description(folder / "robot.yaml").name == "its-own"


def test_without_joints_all_that_move_are_observed(folder):
    robot = load_description(write(folder, "name: arm\nmodel: arm.urdf\n"))
    assert [joint.name for joint in robot.joints] == ["shoulder", "elbow", "grip"]
    assert {joint.torque for joint in robot.joints} == {"sensor"}
    robot = load_description(write(folder, "name: arm\nmodel: arm.urdf\nlocked: {grip: 0}\n"))
    assert [joint.name for joint in robot.joints] == ["shoulder", "elbow"]


def test_torque_from_sensors(folder):
    path = edit(folder, ("{name: elbow, torque: sensor}", "{name: elbow, torque: {from: [wrist]}}"))
    joint = load_description(path).joints[1]
    assert (joint.torque, joint.sources) == ("from", ("wrist",))


def test_empty_keys_stand_for_the_default(folder):
    robot = load_description(edit(folder, more="links:\nlog:\nnoise:\ngravity: ~\n"))
    assert (robot.links, robot.log, robot.gravity) == ({}, {}, None)


def test_order_of_joints_is_the_file_s(folder):
    path = edit(folder, ("shoulder", "x_tmp"), ("elbow", "shoulder"), ("x_tmp", "elbow"))
    robot, _ = read_robot_file(path)
    assert [joint.name for joint in robot.joints] == ["elbow", "shoulder"]


def problems_of(path):
    with pytest.raises(InputError) as error:
        read_robot_file(path)
    assert all(line.startswith(str(path.parent)) for line in error.value.problems)
    return [line.removeprefix(f"{path}: ") for line in error.value.problems]


SHOULDER = "{name: shoulder, torque: sensor}"
ELBOW = "{name: elbow, torque: sensor}"
WRIST = "{name: wrist, link: hand}"


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (
            SHOULDER,
            "{name: shoulder, torque: senser}",
            "joints[0].torque: 'senser' is not allowed; allowed: sensor, motor, none, "
            "{from: [SENSOR, ...]} (did you mean 'sensor'?)",
        ),
        (SHOULDER, "{name: shoulder, torque: {form: [wrist]}}", "joints[0].torque: "),
        (SHOULDER, "{name: shoulder, torque: {from: []}}", "joints[0].torque: from: []: name at"),
        (SHOULDER, "{name: shoulder, torque: {from: wrist}}", "joints[0].torque: 'wrist' is text"),
        (SHOULDER, "{name: shoulder, torque: 1}", "joints[0].torque: '1' is not allowed"),
        (
            SHOULDER,
            "{name: shoulder, torque: {from: [wrst]}}",
            "joints[0].torque.from: unknown sensor 'wrst'; known: base_ft, wrist "
            "(did you mean 'wrist'?)",
        ),
        (SHOULDER, "{name: shoulder, sign: 0.5}", "joints[0].sign: 0.5 is not allowed; allowed: 1"),
        (SHOULDER, "{name: shoulder, sign: true}", "joints[0].sign: True is not allowed"),
        (SHOULDER, "{name: shoulder, gain: 0}", "joints[0].gain: 0 is not allowed; allowed: more"),
        (SHOULDER, "{name: shoulder, gain: '1'}", "joints[0].gain: '1' is not a number"),
        (SHOULDER, "{name: shoulder, bias: .nan}", "joints[0].bias: nan is not a finite number"),
        (SHOULDER, "{name: shoulder, bias: .inf}", "joints[0].bias: inf is not a finite number"),
        (SHOULDER, "{name: shoulder, bias: [1]}", "joints[0].bias: [1] is not a number"),
        (SHOULDER, "{name: shoulder, bias: yes}", "joints[0].bias: 'yes' is not a number"),
        (SHOULDER, "{name: shoulder, bias: true}", "joints[0].bias: True is not a number"),
        (SHOULDER, "{name: shoulder, bias: }", "joints[0].bias: None is not a number"),
        (SHOULDER, "{name: shoulder, delay: -1e-3}", "joints[0].delay: -0.001 is negative"),
        (SHOULDER, "{name: shoulder, range: -87}", "joints[0].range: -87 is not allowed"),
        (SHOULDER, "{name: shoulder, range: .nan}", "joints[0].range: nan is not a finite number"),
        (SHOULDER, "{name: shoulder, compensated: gravty}", "joints[0].compensated: 'gravty' is"),
        (
            SHOULDER,
            "{name: shoulder, rotor_inertia: 0.1}",
            "joints[0].rotor_inertia: 0.1 is given, but only a joint with torque: motor has one",
        ),
        (SHOULDER, "{name: shoulder, friction: 0.1}", "joints[0].friction: 0.1 is a number, not a"),
        (
            SHOULDER,
            "{name: shoulder, friction: {coulomb: -1}}",
            "joints[0].friction.coulomb: -1 is negative; allowed: 0 or more",
        ),
        (
            SHOULDER,
            "{name: shoulder, friction: {stribeck: 0.5}}",
            "joints[0].friction.stribeck: 0.5 is given without stribeck_speed",
        ),
        (
            SHOULDER,
            "{name: shoulder, friction: {viscos: 1}}",
            "joints[0].friction.viscos: unknown key; allowed: coulomb, viscous, coulomb_width, "
            "stribeck, stribeck_speed (did you mean 'viscous'?)",
        ),
        (SHOULDER, "{name: shoulder, tork: 1}", "joints[0].tork: unknown key; allowed: name, tor"),
        (SHOULDER, "{torque: sensor}", "joints[0].name: is missing"),
        (SHOULDER, "{name: 5}", "joints[0].name: 5 is a number, not text"),
        (SHOULDER, "{name: ''}", "joints[0].name: the text is empty"),
        (
            SHOULDER,
            "[shoulder]",
            "joints[0]: ['shoulder'] is a list, not a mapping; its keys: name",
        ),
        (SHOULDER, "null", "joints[0]: None is nothing, not a mapping"),
        (ELBOW, SHOULDER, "joints[1].name: 'shoulder' is also the name of joints[0]; names are"),
        (
            ELBOW,
            "{name: elbw}",
            "joints[1].name: unknown joint 'elbw'; known: shoulder, elbow, gri",
        ),
        (ELBOW, "{name: mount}", "joints[1].name: joint 'mount' is fixed in the model"),
        (
            f"  - {ELBOW}\n",
            "",
            "joints: the model's movable joints elbow are in neither joints nor locked; hold with "
            "locked: {elbow: 0.0}",
        ),
        ("locked: {grip: 0.01}", "", "joints: the model's movable joints grip are in neither"),
        ("grip: 0.01", "grip: open", "locked.grip: 'open' is not a number"),
        ("grip: 0.01", "grip: 0, elbow: 0", "locked.elbow: stands in joints too"),
        ("grip: 0.01", "grip: 0, mount: 0", "locked.mount: joint 'mount' is fixed in the model"),
        ("grip: 0.01", "grip: 0, gripp: 0", "locked.gripp: unknown joint 'gripp'; known: should"),
        ("{grip: 0.01}", "[grip]", "locked: ['grip'] is a list, not a mapping"),
        (WRIST, "{name: wrist}", "force_torque_sensors[1].link: is missing"),
        (
            WRIST,
            "{name: wrist, link: hands}",
            "force_torque_sensors[1].link: unknown link 'hands'; known: base, upper, hand, handle, "
            "finger (did you mean 'hand'?)",
        ),
        (WRIST, "{name: elbow, link: hand}", "force_torque_sensors[1].name: 'elbow' is also the n"),
        (WRIST, "{name: root, link: hand}", "force_torque_sensors[1].name: 'root' is reserved"),
        (WRIST, "{name: tau, link: hand}", "force_torque_sensors[1].name: 'tau' is reserved"),
        (WRIST, "{name: a.b, link: hand}", "force_torque_sensors[1].name: 'a.b' has a dot; dots"),
        (
            WRIST,
            "{name: wrist, link: hand, frame: bas}",
            "force_torque_sensors[1].frame: unknown frame 'bas'; known: sensor, world, base, ",
        ),
        (WRIST, "{name: wrist, link: hand, polarity: out}", "force_torque_sensors[1].polarity: 'o"),
        (WRIST, "{name: wrist, link: hand, compensated: model}", "force_torque_sensors[1].compen"),
        (WRIST, "{name: wrist, link: hand, axes: [fx, qx]}", "force_torque_sensors[1].axes: 'qx' "),
        (WRIST, "{name: wrist, link: hand, axes: []}", "force_torque_sensors[1].axes: []: name e"),
        (WRIST, "{name: wrist, link: hand, axes: [fz, fx]}", "force_torque_sensors[1].axes: ['fz"),
        (WRIST, "{name: wrist, link: hand, axes: [fz, fz]}", "force_torque_sensors[1].axes: ['fz"),
        (WRIST, "{name: wrist, link: hand, axes: fz}", "force_torque_sensors[1].axes: 'fz' is te"),
        (
            WRIST,
            "{name: wrist, link: hand, pose: {xyz: [0, 0]}}",
            "force_torque_sensors[1].pose.xyz: [0, 0] has 2 values; allowed: 3",
        ),
        (WRIST, "{name: wrist, link: hand, pose: [0]}", "force_torque_sensors[1].pose: [0] is a l"),
        (
            WRIST,
            "{name: wrist, link: hand, axes: [fx, fy], bias: [1, 2, 3]}",
            "force_torque_sensors[1].bias: [1.0, 2.0, 3.0] has 3 values; allowed: 6, or 2 for the "
            "axes fx, fy",
        ),
        (
            WRIST,
            "{name: wrist, link: hand, range: [1, 1, 1, 1, 1, 0]}",
            "force_torque_sensors[1].range: 0 is not allowed; allowed: more than 0",
        ),
        ("name: arm\n", "name: [arm]\n", "name: ['arm'] is a list, not text"),
        ("model: arm.urdf\n", "", "model: is missing"),
        ("model: arm.urdf", "model: gone.urdf", "model: 'gone.urdf': no such file: "),
        ("model: arm.urdf", "model: .", "model: '.': is a folder, not a file: "),
        ("model: arm.urdf", "model: robot:gone", "model: 'robot:gone': no robot 'gone' ships with"),
        ("model: arm.urdf", "model: package://gone/a.urdf", "model: 'package://gone/a.urdf': pack"),
        ("locked:", "lockd: {}\nlocked:", "lockd: unknown key; allowed: name, model, package_d"),
    ],
)
def test_one_error(folder, old, new, problem):
    found = problems_of(edit(folder, (old, new)))
    if len(found) > 1:  # a joint that lost its name is rightly said to be missing, too
        found = [line for line in found if not line.startswith("joints: the model's movable")]
    assert len(found) == 1, found
    assert found[0].startswith(problem)


def test_many_names_with_dots_are_one_line(folder):
    many = "\n  - ".join(f"{{name: a.{k}, link: hand}}" for k in range(6))
    (line,) = problems_of(edit(folder, (WRIST, many)))
    told = "6 have a dot: 'a.0', 'a.1', 'a.2', 'a.3', ... (2 more); dots are reserved"
    assert line == f"force_torque_sensors[1].name: {told}"


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ("gravity: -9.81", "gravity: -9.81 is a number, not a list"),
        ("gravity: [0, -9.81]", "gravity: [0, -9.81] has 2 values; allowed: 3"),
        ("gravity: [0, 0, .inf]", "gravity: inf is not a finite number"),
        ("package_dirs: [gone]", "package_dirs: no such folder: "),
        ("package_dirs: here", "package_dirs: 'here' is text, not a list"),
        ("loads: [{link: hand}]", "loads[0].mass: is missing"),
        ("loads: [{link: hand, mass: -1}]", "loads[0].mass: -1 is negative; allowed: 0 or more"),
        ("graspable: [hnd]", "graspable[0]: unknown link 'hnd'; known: base, "),
        ("graspable: hand", "graspable: 'hand' is text, not a list"),
        ("pushes: {links: [hnd]}", "pushes.links[0]: unknown link 'hnd'; known: base, "),
        ("pushes: {friction: 0}", "pushes.friction: 0 is not allowed; allowed: more than 0"),
        ("pushes: {reach: -0.1}", "pushes.reach: -0.1 is not allowed; allowed: more than 0"),
        ("pushes: {finger: 0.1}", "pushes.finger: unknown key"),
        ("loads: [{link: hnd, mass: 1}]", "loads[0].link: unknown link 'hnd'; known: base, "),
        ("loads: [{link: hand, mass: 1, com: 0}]", "loads[0].com: 0 is a number, not a list"),
        ("loads: [{link: hand, mass: 1, inertia: [1, 1, 1]}]", "loads[0].inertia: [1, 1, 1] has"),
        (
            "loads: [{link: hand, mass: 1, inertia: [1, 0, 0, -1, 0, 1]}]",
            "loads[0].inertia: the inertia has a negative principal moment: -1, 1, 1 kg m2",
        ),
        ("loads: {link: hand}", "loads: {'link': 'hand'} is a mapping, not a list"),
        ("links: {hnd: {mass: 1}}", "links.hnd: unknown link 'hnd'; known: base, upper, hand, "),
        ("links: {hand: {mass: -1}}", "links.hand.mass: -1 is negative; allowed: 0 or more"),
        ("links: {hand: {weight: 1}}", "links.hand.weight: unknown key; allowed: mass, com, iner"),
        ("links: {hand: 1}", "links.hand: 1 is a number, not a mapping; its keys: mass, com"),
        ("links: {1: {mass: 1}}", "links: the key 1 is a number, not text"),
        ("noise: {q: -1}", "noise.q: -1 is negative; allowed: 0 or more"),
        ("noise: {tau: [1, 2, 3]}", "noise.tau: [1.0, 2.0, 3.0] has 3 values; allowed: a number, "),
        ("noise: {tau: [1, x]}", "noise.tau: 'x' is not a number"),
        ("noise: {wrst: 1}", "noise.wrst: unknown key 'wrst'; known: q, qd, tau, base_ft, wrist "),
        ("noise: {wrist: [1, 2]}", "noise.wrist: [1.0, 2.0] has 2 values; allowed: 6"),
        ("noise: {wrist: .nan}", "noise.wrist: nan is not a finite number"),
        ("noise: 3", "noise: 3 is a number, not a mapping"),
        ("observer: 100", "observer: 100 is a number, not a mapping; its keys: bandwidth"),
        ("observer: {bandwith: 1}", "observer.bandwith: unknown key; allowed: bandwidth"),
        ("observer: {bandwidth: 0}", "observer.bandwidth: 0 is not allowed; allowed: more than 0"),
        ("observer: {bandwidth: fast}", "observer.bandwidth: 'fast' is not a number"),
        ("observer: {bandwidth: [1, 2]}", "observer.bandwidth: [1, 2] is not a number"),
        ("observer: {bandwidth: {wrist: 0}}", "observer.bandwidth.wrist: 0 is not allowed"),
        ("observer: {bandwidth: {wrist: [1]}}", "observer.bandwidth.wrist: [1] is not a number"),
        ("observer: {bandwidth: {wrst: 1}}", "observer.bandwidth.wrst: unknown key 'wrst'; known"),
        ("observer: {bandwidth: {joints: [1]}}", "observer.bandwidth.joints: [1.0] has 1 values"),
        ("detection: 5", "detection: 5 is a number, not a mapping"),
        ("log: text", "log: 'text' is text, not a mapping"),
        ("1: 2", "1: unknown key; allowed: name, model"),
    ],
)
def test_one_error_of_another_key(folder, more, problem):
    (found,) = problems_of(edit(folder, more=more + "\n"))
    assert found.startswith(problem)


def test_torque_from_a_sensor_on_another_branch(folder):
    path = edit(
        folder,
        (ELBOW, "{name: elbow, torque: {from: [wrist]}}"),
        (WRIST, "{name: wrist, link: handle}"),
    )
    what = "sensor 'wrist' on link 'handle' is on another branch than the joint"
    assert problems_of(path) == [f"joints[1].torque.from: {what}"]


def test_a_mimic_joint_is_not_named(folder):
    urdf = folder / "arm.urdf"
    text = urdf.read_text().replace(
        '<child link="finger"/>', '<child link="finger"/><mimic joint="elbow"/>'
    )
    urdf.write_text(text)
    what = "joint 'grip' follows 'elbow' (mimic) and is not named here"
    assert problems_of(folder / "robot.yaml") == [f"locked.grip: {what}"]


def test_all_errors_of_both_files_at_once(folder):
    (folder / "arm.urdf").write_text(
        (folder / "arm.urdf").read_text().replace('<mass value="2"/>', '<mass value="heavy"/>')
    )
    path = edit(
        folder,
        (SHOULDER, "{name: shoulder, torque: senser, gain: 0}"),
        (ELBOW, "{name: wrist}"),
        (WRIST, "{name: wrist, link: 7, bias: [1, x]}"),
        more="noise: {wrst: 1}\nlods: []\nloads: [{mass: -1}]\n",
    )
    with pytest.raises(InputError) as error:
        read_robot_file(path)
    found = str(error.value)
    places = "joints[0].torque joints[0].gain force_torque_sensors[1].link noise.wrst lods"
    places += " force_torque_sensors[1].bias loads[0].mass loads[0].link"
    places += " force_torque_sensors[1].name"
    for place in places.split():
        assert f"robot.yaml: {place}: " in found
    assert "arm.urdf: link 'base': <mass value='heavy'> is not a finite number" in found
    assert len(error.value.problems) == 10


def test_one_error_does_not_make_others_up(folder):
    """An unreadable sensor is still known by its name, an unreadable joint is still listed."""
    path = edit(
        folder,
        (ELBOW, "{name: elbow, torque: {from: [wrist]}, gain: x}"),
        (WRIST, "{name: wrist}"),
        more="noise: {wrist: 1, tau: [1, 2]}\nobserver: {bandwidth: {wrist: 10}}\n",
    )
    assert problems_of(path) == [
        "joints[1].gain: 'x' is not a number",
        "force_torque_sensors[1].link: is missing",
    ]


def test_a_required_key_without_a_check_of_its_own_may_be_missing(monkeypatch):
    """Its place is taken by nothing, and the rest is read on."""
    monkeypatch.setitem(schema.HOOKS, RowCalibration, {})
    monkeypatch.setattr(schema, "_CONVERTER", schema._make_converter())
    rows = {"j1": {}, "j2": {"typical": "x"}, "j3": {"typical": 2.0}}
    calibration = {"hours": 1.0, "period": 0.001, "rows": rows}
    file, problems = schema.structure({"detection": {"calibration": calibration}})
    assert problems == [
        "detection.calibration.rows.j1.typical: is missing",
        "detection.calibration.rows.j2.typical: 'x' is not a number",
    ]
    read = file.detection.calibration.rows
    assert {name: row.typical for name, row in read.items()} == {"j1": None, "j2": None, "j3": 2.0}


def test_corrections_and_gravity_reach_the_mechanism(folder):
    path = edit(
        folder,
        more="gravity: [1, 2, 3]\nlinks: {upper: {mass: 5}}\n"
        "loads: [{link: base, mass: 2, com: [1, 0, 0]}]\n",
    )
    _, mechanism = read_robot_file(path)
    np.testing.assert_array_equal(mechanism.gravity, [1, 2, 3])
    assert mechanism.links["upper"].inertia.mass == 5
    assert mechanism.links["base"].inertia.mass == 4
    np.testing.assert_allclose(mechanism.links["base"].inertia.com, [0.5, 0, 0])
