# SPDX-License-Identifier: Apache-2.0
"""The ROS package: launch file, RViz configuration and package.xml fit the node and each other.

Neither `launch` nor RViz is there: stand-ins take what the launch file would start, and the RViz
configuration is read as what it is, YAML.
"""

import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import pytest
import yaml
from test_live_ros import environment, needs_ros

import touchline as tl

PACKAGE = Path(__file__).parents[2] / "ros" / "touchline"
NODE = Path(tl.__file__).parent / "live" / "node.py"
MESSAGES = NODE.with_name("messages.py")


@pytest.fixture
def launched(monkeypatch):
    """What the launch file starts: arguments by name, and the processes."""

    class Thing(SimpleNamespace):
        def __init__(self, *given, **named):
            super().__init__(given=given, **named)

    names = ("DeclareLaunchArgument", "ExecuteProcess", "IfCondition", "LaunchConfiguration")
    kinds = {name: type(name, (Thing,), {}) for name in names}
    modules = {
        "launch": {"LaunchDescription": lambda entities: entities},
        "launch.actions": {n: kinds[n] for n in ("DeclareLaunchArgument", "ExecuteProcess")},
        "launch.conditions": {"IfCondition": kinds["IfCondition"]},
        "launch.substitutions": {"LaunchConfiguration": kinds["LaunchConfiguration"]},
    }
    for name, members in modules.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    made = runpy.run_path(str(PACKAGE / "launch" / "touchline.launch.py"))[
        "generate_launch_description"
    ]()
    declared = {e.given[0]: e for e in made if isinstance(e, kinds["DeclareLaunchArgument"])}
    return declared, [e for e in made if isinstance(e, kinds["ExecuteProcess"])]


def command(process, arguments):
    """The words that are started, with arguments filled in as `launch` does."""

    def said(part):
        return part if isinstance(part, str) else arguments[part.given[0]]

    return [said(w) if not isinstance(w, list) else "".join(map(said, w)) for w in process.cmd]


def test_the_launch_file_starts_the_node_with_parameters_that_it_has(launched):
    declared, (node, rviz) = launched
    values = {name: getattr(e, "default_value", "arm.yaml") for name, e in declared.items()}
    assert not hasattr(declared["robot"], "default_value")  # it must be given
    assert all(entity.description for entity in declared.values())
    words = command(node, values)
    assert words[1:4] == ["-m", "touchline.live.node", "--ros-args"]
    given = dict(word.split(":=") for word in words[5::2])
    known = set(re.findall(r'declare\("(\w+)"', NODE.read_text()))
    assert set(given) <= known and given["robot"] == "'arm.yaml'" and given["record"] == "''"
    assert set(declared) - set(given) == {"rviz"}
    assert rviz.condition.given[0].given == ("rviz",) and values["rviz"] == "false"
    assert Path(command(rviz, values)[2]).is_file()


def test_rviz_shows_what_the_node_publishes():
    shown = yaml.safe_load((PACKAGE / "rviz" / "touchline.rviz").read_text())[
        "Visualization Manager"
    ]
    displays = {display["Name"]: display for display in shown["Displays"]}
    assert all(re.fullmatch(r"rviz_default_plugins/\w+", d["Class"]) for d in displays.values())
    topic = displays["Contacts"]["Topic"]
    assert displays["Contacts"]["Class"].endswith("/MarkerArray")
    name = topic["Value"].replace("/touchline/", "~/")
    assert re.search(rf'"{re.escape(name)}": self._markers\b', MESSAGES.read_text())
    assert 'name: str = "touchline"' in NODE.read_text()  # so that ~ is /touchline
    assert topic["Reliability Policy"] == "Reliable"
    described = displays["Robot"]["Description Topic"]
    assert described["Durability Policy"] == "Transient Local"  # it is published once
    assert shown["Global Options"]["Fixed Frame"] == "world"  # as the node's `frame`


def test_the_package_names_what_it_needs_and_has():
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    needs = {entry.text for entry in package.findall("exec_depend")}
    used = set(
        re.findall(r"from (\w+)\.(?:msg|srv) import", NODE.read_text() + MESSAGES.read_text())
    )
    assert used - {"rcl_interfaces"} <= needs and {"rclpy", "launch", "rviz2"} <= needs
    setup = (PACKAGE / "setup.py").read_text()
    assert package.findtext("version") == tl.__version__ and f'version="{tl.__version__}"' in setup
    assert f'NAME = "{package.findtext("name")}"' in setup
    for file in re.findall(r'\["((?:launch|rviz)/[\w.]+)"\]', setup):
        assert (PACKAGE / file).is_file()


@needs_ros
def test_what_the_launch_file_starts_runs(launched):
    declared, (node, _) = launched
    values = {name: getattr(e, "default_value", "no_such_robot") for name, e in declared.items()}
    done = subprocess.run(
        command(node, values),
        check=False,
        env=environment(78),
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2 and "no_such_robot" in done.stderr
