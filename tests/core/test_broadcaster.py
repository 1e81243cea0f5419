# SPDX-License-Identifier: Apache-2.0
"""The ros2_control broadcaster, against headers with the interfaces' signatures and no ROS."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from program import BROADCASTER, COMPILER, PLAIN, compile_program

import touchline as tl
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import Run, three_touches

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
def test_it_gives_what_the_pipeline_feels_to_the_last_bit(logged, run_whole):
    folder, robot, s = logged
    given = (folder / "sara.touchline", folder / "log.csv")
    lines = run_whole("broadcaster", PLAIN, *given, counting=True)
    assert [line for line in lines if line.startswith("FAILED")] == []
    given = np.array([line.split() for line in lines], dtype=float)
    estimate, _ = tl.Pipeline(robot).run(s.time, s.q, s.qd, s.tau, s.wrench)
    np.testing.assert_array_equal(given[:, 0], s.time)
    felt = np.column_stack([estimate.tau_ext, estimate.segment_wrench.reshape(len(s), -1)])
    np.testing.assert_array_equal(given[:, 1:], felt)
    assert np.nanmax(np.abs(felt)) > 5.0


@compiles
def test_the_plugin_includes_all_that_it_needs(tmp_path):
    source = BROADCASTER / "src" / "touch_broadcaster.cpp"
    assert compile_program(source, tmp_path / "none", "-fsyntax-only") == ""


def test_the_plugin_is_described_as_it_is_written():
    library = ET.parse(BROADCASTER / "touchline_broadcaster.xml").getroot()
    plugin = library.find("class")
    assert plugin is not None
    source = (BROADCASTER / "src" / "touch_broadcaster.cpp").read_text()
    exported = source[source.index("PLUGINLIB_EXPORT_CLASS(") :]
    assert plugin.get("type") in exported and plugin.get("base_class_type") in exported
    cmake = (BROADCASTER / "CMakeLists.txt").read_text()
    assert f"add_library({library.get('path')} SHARED" in cmake
    assert "touchline_broadcaster.xml)" in cmake
    package = ET.parse(BROADCASTER / "package.xml").getroot()
    named = {element.text for element in package.findall("depend")}
    words = cmake[cmake.index("set(ros_packages") :].split(")")[0].split()[1:]
    assert named == set(words)
