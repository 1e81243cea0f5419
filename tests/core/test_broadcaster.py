# SPDX-License-Identifier: Apache-2.0
"""The ros2_control broadcaster, against headers with the interfaces' signatures and no ROS."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from program import COMPILER, compile_program, run_program

import touchline as tl
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import Run, three_touches

HERE = Path(__file__).parent
PACKAGE = HERE.parents[1] / "ros" / "touchline_broadcaster"

compiles = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """Folder with an exported robot and a log; the robot; samples at whole nanoseconds."""
    folder = tmp_path_factory.mktemp("broadcaster")
    robot = tl.load_robot("sara")
    s = three_touches(robot, speed=1.0, seconds=0.6, settings=Run(noise=SensorNoise())).samples
    s.time[:] = 1e-9 * np.round(1e9 * s.time)
    tl.Pipeline(robot).export(folder / "sara.touchline")
    columns = np.column_stack([s.time, s.q, s.qd, s.tau, s.wrench.reshape(len(s), -1)])
    lines = [",".join(repr(x) for x in row) for row in columns.tolist()]
    (folder / "log.csv").write_text("\n".join(["names", *lines]) + "\n")
    return folder, robot, s


@compiles
def test_it_gives_what_the_pipeline_feels_to_the_last_bit(logged):
    folder, robot, s = logged
    program = folder / "broadcaster"
    includes = [f"-I{HERE / 'ros_signatures'}", f"-I{PACKAGE / 'include'}"]
    source = HERE / "broadcaster.cpp"
    # Both files as one: the core is compiled once.
    plugin = ("-include", PACKAGE / "src" / "touch_broadcaster.cpp")
    complaint = compile_program(source, program, "-O1", *includes, *plugin)
    assert complaint == ""
    lines = run_program(program, folder / "sara.touchline", folder / "log.csv").stdout.splitlines()
    assert [line for line in lines if line.startswith("FAILED")] == []
    given = np.array([line.split() for line in lines], dtype=float)
    estimate, _ = tl.Pipeline(robot).run(s.time, s.q, s.qd, s.tau, s.wrench)
    np.testing.assert_array_equal(given[:, 0], s.time)
    felt = np.column_stack([estimate.tau_ext, estimate.segment_wrench.reshape(len(s), -1)])
    np.testing.assert_array_equal(given[:, 1:], felt)
    assert np.nanmax(np.abs(felt)) > 5.0


def test_the_plugin_is_described_as_it_is_written():
    library = ET.parse(PACKAGE / "touchline_broadcaster.xml").getroot()
    plugin = library.find("class")
    assert plugin is not None
    source = (PACKAGE / "src" / "touch_broadcaster.cpp").read_text()
    exported = source[source.index("PLUGINLIB_EXPORT_CLASS(") :]
    assert plugin.get("type") in exported and plugin.get("base_class_type") in exported
    cmake = (PACKAGE / "CMakeLists.txt").read_text()
    assert f"add_library({library.get('path')} SHARED" in cmake
    assert "touchline_broadcaster.xml)" in cmake
    package = ET.parse(PACKAGE / "package.xml").getroot()
    named = {element.text for element in package.findall("depend")}
    words = cmake[cmake.index("set(ros_packages") :].split(")")[0].split()[1:]
    assert named == set(words)
