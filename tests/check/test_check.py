# SPDX-License-Identifier: Apache-2.0
"""Every mistake that a user makes in a description or a log is named."""

import os
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from free_motion import free_motion

import touchline as tl
from touchline.check.model import outboard_mass
from touchline.check.order import joint_orders
from touchline.check.run import check
from touchline.check.windows import WindowMaker
from touchline.cli.main import main
from touchline.logs import write_table
from touchline.model.robot import Robot
from touchline.observer.dynamics import gravity_loads

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara-full")


@pytest.fixture(scope="module")
def recording(robot):
    return free_motion(robot, rate=100.0)


def findings_of(tmp_path, robot, samples, name="sara-full"):
    path = tmp_path / "log.parquet"
    write_table(path, samples, robot.description)
    return check(name, path).findings


def changed(samples, **changes):
    """A copy with functions applied to signals, in place."""
    copies = {name: getattr(samples, name).copy() for name in changes}
    for name, change in changes.items():
        result = change(copies[name])
        copies[name] = copies[name] if result is None else result
    return replace(samples, **copies)


def test_nothing_is_found_where_nothing_is_wrong(tmp_path, robot, recording):
    assert findings_of(tmp_path, robot, recording) == []


BASE, WRIST, HANDLE = 0, 1, 2


def scale(index, factor):
    def change(values):
        values[(slice(None), *index)] *= factor

    return change


def swap(a, b, sensor=None):
    def change(values):
        part = values if sensor is None else values[:, sensor]
        part[:, [a, b]] = part[:, [b, a]]

    return change


def swap_axes(values):
    swap(0, 1, WRIST)(values)
    swap(3, 4, WRIST)(values)


def flip_axes(values):
    values[:, WRIST, [0, 1, 3, 4]] *= -1.0


def hold(index):
    def change(values):
        values[(slice(None), *index)] = 1.25

    return change


def add(index, number):
    def change(values):
        values[(slice(None), *index)] += number

    return change


def drop(tau):
    tau[::3, 5] = np.nan


MISTAKES = {
    "base polarity": ({"wrench": scale((BASE,), -1)}, ["sensor base", "polarity: inboard"]),
    "wrist polarity": ({"wrench": scale((WRIST,), -1)}, ["sensor wrist", "polarity: inboard"]),
    "wrist in kgf": (
        {"wrench": scale((WRIST, slice(0, 3)), 1 / 9.80665)},
        ["sensor wrist", "forces", "kgf"],
    ),
    "base in kN": (
        {"wrench": scale((BASE, slice(0, 3)), 1e-3)},
        ["sensor base", "forces", "kN"],
    ),
    "wrist in grams": (
        {"wrench": scale((WRIST,), 1000 / 9.80665)},
        ["sensor wrist", "forces", "grams", "0.00980665"],
    ),
    "moments in mNm": (
        {"wrench": scale((WRIST, slice(3, 6)), 1e3)},
        ["sensor wrist", "moments", "mNm"],
    ),
    "axes swapped": ({"wrench": swap_axes}, ["sensor wrist", "axes swapped", "x holds y"]),
    "axes turned": ({"wrench": flip_axes}, ["sensor wrist", "opposite sign", "x holds -x"]),
    "weight taken out": (
        {"wrench": scale((HANDLE,), 0.01)},
        ["sensor handle", "compensated: gravity"],
    ),
    "dead wrench axis": ({"wrench": hold((WRIST, 2))}, ["wrist.fz", "always 1.25"]),
    "force bias": ({"wrench": add((WRIST, 0), 7.0)}, ["sensor wrist", "bias", "7"]),
    "torque sign": ({"tau": scale((2,), -1)}, ["joint3", "opposite sign"]),
    "torque in mNm": ({"tau": scale((1,), 1e3)}, ["joint2", "mNm"]),
    "torques swapped": ({"tau": swap(1, 3)}, ["joint2", "joint4", "swapped"]),
    "dead torque": ({"tau": hold((4,))}, ["torque of joint5", "always 1.25"]),
    "gravity taken out": ({"tau": scale((1,), 0.03)}, ["joint2", "compensated: gravity"]),
    "torque offset": ({"tau": add((2,), 4.0)}, ["joint3", "offset", "+4.0"]),
    "velocity sign": ({"qd": scale((0,), -1)}, ["velocity of joint1", "opposite sign"]),
    "velocity in degrees": (
        {"qd": scale((slice(None),), 180 / np.pi)},
        ["velocity of joint2", "degrees"],
    ),
    "dead velocity": ({"qd": hold((3,))}, ["velocity of joint4", "always"]),
    "positions in degrees": (
        {"q": scale((slice(None),), 180 / np.pi)},
        ["position", "degrees", "limits"],
    ),
    "positions outside": ({"q": add((1,), 3.0)}, ["position of joint2", "limits"]),
    "time in ms": ({"time": lambda t: t * 1e3}, ["time", "milliseconds"]),
    "gap": ({"time": lambda t: np.where(t > 10, t + 5, t)}, ["gaps", "5"]),
    "repeated stamps": (
        {"time": lambda t: np.repeat(t[::2], 2)[: len(t)]},
        ["stamps", "repeat"],
    ),
    "missing values": ({"tau": drop}, ["torque of joint6", "missing"]),
    "infinite values": ({"tau": add((5,), np.inf)}, ["torque of joint6", "infinite"]),
}


@pytest.fixture(scope="module")
def told(robot, recording, tmp_path_factory):
    """What is found where a mistake is made, by its name."""

    def findings(mistake):
        changes, _ = MISTAKES[mistake]
        return findings_of(tmp_path_factory.mktemp("told"), robot, changed(recording, **changes))

    return cache(findings)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(told, mistake):
    _, words = MISTAKES[mistake]
    findings = told(mistake)
    assert any(all(word in line for word in words) for line in findings), findings


@pytest.mark.parametrize(
    "mistake", ["wrist polarity", "axes swapped", "torque sign", "torques swapped", "force bias"]
)
def test_a_mistake_is_named_alone(told, mistake):
    assert len(told(mistake)) == 1


def in_world_axes(robot, samples):
    """The recording as a driver logs it that gives the wrist's wrench in world axes."""
    turned = samples.wrench.copy()
    for i, q in enumerate(samples.q):
        R = robot.sensor_poses(q)[WRIST, :3, :3]
        turned[i, WRIST] = np.concatenate([R @ turned[i, WRIST, :3], R @ turned[i, WRIST, 3:]])
    return replace(samples, wrench=turned)


def test_a_sensor_logged_in_world_axes(tmp_path, robot, recording):
    findings = findings_of(tmp_path, robot, in_world_axes(robot, recording))
    assert len(findings) == 1
    assert "sensor wrist" in findings[0] and "frame: world" in findings[0]


def described_with(tmp_path, robot, load):
    """Its description with a load on the tool."""
    path = tmp_path / "robot.yaml"
    path.write_text(robot.description.path.read_text() + f"loads:\n  - {load}\n")
    return path


TOOL = "{link: tool, mass: 0.6, com: [0, 0, 0.05]}"


def test_a_load_that_the_model_lacks(tmp_path, robot, recording):
    path = described_with(tmp_path, robot, TOOL)
    loaded = free_motion(tl.load_robot(path), rate=100.0)
    findings = findings_of(tmp_path, robot, loaded)
    (found,) = findings
    mass = re.match(r"(\S+) \+- \S+ kg are missing at tool", found)
    assert mass is not None and abs(float(mass[1]) - 0.6) < 0.03
    assert "loads: [{link: tool, mass: 0.6" in found


def test_a_heavy_load_on_a_light_flange_is_no_unit(tmp_path, robot, recording):
    """Its weight is 9.8 times that of the flange, and its moments are those of a long lever."""
    path = described_with(tmp_path, robot, "{link: tool, mass: 7.9, com: [0, 0.2, 0.25]}")
    loaded = free_motion(tl.load_robot(path), rate=100.0)
    findings = findings_of(tmp_path, robot, loaded)
    of_sensors = [line for line in findings if line.startswith("sensor")]
    assert of_sensors and not any("kgf" in line for line in of_sensors), findings


@pytest.mark.parametrize("measured", ["joints", "a sensor before it", "itself alone"])
def test_a_load_at_the_centre_of_a_light_flange_is_a_unit_to_itself_alone(
    tmp_path, robot, recording, measured
):
    """Moments tell it from a unit no more; what is before the sensor feels a load, but no unit."""
    com = robot.mechanism.links["tool"].inertia.com.tolist()
    mass = 8.8 * outboard_mass(robot, "wrist")
    path = described_with(tmp_path, robot, f"{{link: tool, mass: {mass}, com: {com}}}")
    loaded = free_motion(tl.load_robot(path), rate=100.0)
    if measured != "joints":
        loaded.tau[:] = np.nan
    if measured == "itself alone":
        loaded.wrench[:, [s for s in range(3) if s != WRIST]] = np.nan
    findings = [x for x in findings_of(tmp_path, robot, loaded) if x.startswith("sensor wrist")]
    assert any("kgf" in line for line in findings) == (measured == "itself alone"), findings


def test_where_no_torque_is_measured_sensors_tell_the_order_of_positions(robot, recording):
    maker = WindowMaker(robot, 0.01)
    maker.add(recording)
    windows = maker.windows()
    turned = windows.ordered(robot, np.arange(7)[::-1], np.arange(7))
    assert joint_orders(robot, windows, []) == {}
    found = joint_orders(robot, turned, [])
    assert [*found] == ["motion"] and found["motion"].known == "reversed order"


def test_a_fixed_description_has_no_more_findings(tmp_path, robot):
    path, fixed = tmp_path / "robot.yaml", tmp_path / "fixed.yaml"
    text = robot.description.path.read_text()
    path.write_text(text + "loads:\n  - {link: tool, mass: 0.6, com: [0, 0, 0.05]}\n")
    log = tmp_path / "log.parquet"
    write_table(log, free_motion(tl.load_robot(path), rate=100.0), robot.description)
    assert main(["check", "sara-full", str(log), "--fix", str(fixed)]) == 1
    assert main(["check", str(fixed), str(log)]) == 0
    before = fixed.read_bytes()
    assert main(["check", str(fixed), str(log), "--fix", str(tmp_path / "no.yaml")]) == 0
    assert fixed.read_bytes() == before and not (tmp_path / "no.yaml").exists()


def upside_down(values):
    values[:, WRIST] *= -1.0


def offset(values):
    values[:, 2] += 6.0


def late(tau):
    tau[3:] = tau[:-3].copy()


def biased(values):
    values[:, WRIST, 0] += 7.0


FIXABLE = {
    "torque sign": ({"tau": scale((2,), -1.0)}, {"joints": {"joint3": {"sign": -1.0}}}),
    "all torques in mNm": (
        {"tau": lambda tau: tau * 1e3},
        {"joints": {f"joint{i}": {"gain": 0.001} for i in range(1, 8)}},
    ),
    "torque offset": ({"tau": offset}, {"joints": {"joint3": {"bias": 6.0}}}),
    "polarity": (
        {"wrench": upside_down},
        {"force_torque_sensors": {"wrist": {"polarity": "inboard"}}},
    ),
    "delay": ({"tau": late}, {"joints": {f"joint{i}": {"delay": 0.03} for i in range(1, 8)}}),
    "a sensor's delay": (
        {"wrench": lambda values: late(values[:, WRIST])},
        {"force_torque_sensors": {"wrist": {"delay": 0.03}}},
    ),
    "sensor bias": (
        {"wrench": biased},
        {"force_torque_sensors": {"wrist": {"bias": [7.0, 0.0, 0.0, 0.0, 0.0, 0.0]}}},
    ),
}


@pytest.mark.parametrize("mistake", FIXABLE)
def test_what_has_a_key_is_mended(tmp_path, robot, recording, mistake):
    changes, expected = FIXABLE[mistake]
    log, fixed = tmp_path / "log.parquet", tmp_path / "fixed.yaml"
    write_table(log, changed(recording, **changes), robot.description)
    assert main(["check", "sara-full", str(log), "--fix", str(fixed)]) == 1
    written = tl.load_robot(fixed).description
    entries = {"joints": written.joints, "force_torque_sensors": written.sensors}
    for key, names in expected.items():
        for entry in entries[key]:
            for name, value in names.get(entry.name, {}).items():
                found = getattr(entry, name)
                near = value if isinstance(value, str) else pytest.approx(value, rel=0.02, abs=1e-3)
                assert found == (pytest.approx(value, abs=0.1) if name == "bias" else near)
    assert check(fixed, log).findings == []


def mended(tmp_path, robot, samples):
    """The description that `--fix` writes; nothing is wrong with the recording then."""
    log, fixed = tmp_path / "log.parquet", tmp_path / "fixed.yaml"
    write_table(log, samples, robot.description)
    assert main(["check", "sara-full", str(log), "--fix", str(fixed)]) == 1
    assert check(fixed, log).findings == []
    return tl.load_robot(fixed).description


def test_the_frame_of_a_log_is_mended(tmp_path, robot, recording):
    sensors = mended(tmp_path, robot, in_world_axes(robot, recording)).sensors
    assert [sensor.frame for sensor in sensors] == ["sensor", "world", "sensor"]


def test_torques_without_gravity_are_mended(tmp_path, robot, recording):
    light = recording.tau - gravity_loads(robot, recording.q).torque
    joints = mended(tmp_path, robot, replace(recording, tau=light)).joints
    assert {joint.compensated for joint in joints} == {"gravity"}


def test_a_tool_that_is_modelled_but_not_mounted(tmp_path, robot, recording):
    path = described_with(tmp_path, robot, TOOL)
    findings = findings_of(tmp_path, robot, recording, str(path))
    (found,) = findings
    mass = re.match(r"(\S+) \+- \S+ kg too many at tool", found)
    assert mass is not None and abs(float(mass[1]) - 0.6) < 0.03


@pytest.mark.parametrize("degrees", [3.0, 5.0, 20.0])
def test_a_base_that_is_tilted_is_told_as_such(tmp_path, robot, degrees):
    angle = np.radians(degrees)
    gravity = 9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    tilted = Robot(robot.description, replace(robot.mechanism, gravity=gravity))
    findings = findings_of(tmp_path, robot, free_motion(tilted, rate=100.0))
    told = [re.match(r"the base is tilted by (\S+) \+- .* gravity: \[(.*)\]", x) for x in findings]
    assert all(told) and abs(float(told[0][1]) - degrees) < 0.5
    numbers = [float(x) for x in told[-1][2].split(",")]
    assert np.allclose(numbers, gravity, atol=0.2)


@pytest.mark.parametrize("log", ["c2", "f2", "a4", "d3"])
def test_a_real_panda_whose_hand_is_not_modelled(tmp_path, log):
    data = Path(os.environ.get("TOUCHLINE_DATA", REPOSITORY.parent / "shared" / "data"))
    path = data / "panda_touches" / f"{log}.csv.gz"
    if not path.exists():
        pytest.skip(f"no recordings at {data}: set TOUCHLINE_DATA")
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    text = (REPOSITORY / "examples" / "robots" / "panda_hand.yaml").read_text()
    fingers = "panda_leftfinger: {mass: 0.0}, panda_rightfinger: {mass: 0.0}"
    robot = tmp_path / "robot.yaml"
    robot.write_text(text + f"links: {{panda_hand: {{mass: 0.0}}, {fingers}}}\n")
    found = [
        re.match(r"(\S+) \+- \S+ kg are missing at panda_link8", x)
        for x in check(robot, path).findings
    ]
    (mass,) = [float(m[1]) for m in found if m]
    assert 0.5 <= mass <= 0.9


def test_a_bandwidth_too_high_for_the_rate(tmp_path, robot):
    slow = free_motion(robot, rate=30.0)
    findings = findings_of(tmp_path, robot, slow)
    assert any("K dt = 3.33" in line and "about 10" in line for line in findings)


def test_a_touch_hides_nothing_and_is_no_finding(tmp_path, robot, recording):
    touched = recording.wrench.copy()
    touch = (recording.time % 5 > 3.5)[:, None]
    touched[:, BASE, :3] -= 25.0 * touch
    assert findings_of(tmp_path, robot, replace(recording, wrench=touched)) == []


def test_the_model_alone(robot):
    result = check("sara-full")
    assert result.findings == []
    text = result.text()
    for words in ("base carries 31.1", "rank 7", "wrist (all axes), handle.fz"):
        assert words in text
