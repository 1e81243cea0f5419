# SPDX-License-Identifier: Apache-2.0
"""Every example in the documentation is run: here, or by a test of its page in test_docs.py."""

import re
import shlex
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from prose import REPOSITORY

import touchline as tl
from touchline.cli import main
from touchline.simulation.scenario import three_touches
from touchline.touch.stroke import Stroke

DOCS = REPOSITORY / "docs"
SARA = REPOSITORY / "src" / "touchline" / "robots" / "sara" / "robot.yaml"
BROADCASTER = REPOSITORY / "ros" / "touchline_broadcaster" / "src" / "touch_broadcaster.cpp"
EXTERNAL = REPOSITORY / "tests" / "core" / "external" / "CMakeLists.txt"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
NOWHERE = "127.0.0.1:9"  # an address at which nothing answers
# Pages whose blocks test_docs.py runs in their order; what this file runs of the others.
IN_ORDER = {f"howto/{name}.md" for name in ("calibrate", "live", "react", "interface")} | {
    "tutorial.md"
}
HERE = {
    ("architecture.md", "cmake"): 1,
    ("architecture.md", "cpp"): 1,
    ("detection.md", "yaml"): 1,
    ("howto/many.md", "sh"): 2,
    ("interface.md", "python"): 2,
    ("interface.md", "yaml"): 1,
    ("live.md", "python"): 2,
    ("live.md", "sh"): 3,
    ("live.md", "yaml"): 1,
    ("reaction.md", "yaml"): 1,
}


def blocks(page: str, language: str) -> list[str]:
    return [block for kind, block in BLOCK.findall((DOCS / page).read_text()) if kind == language]


def described(folder, page: str | None = None):
    """A description of sara in a folder, with the keys of a page's example."""
    keys = yaml.safe_load(SARA.read_text()) | {"model": "robot:sara"}
    if page is not None:
        keys |= yaml.safe_load(blocks(page, "yaml")[0])
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(keys, sort_keys=False))
    return path


def rows(robot):
    """Samples of a touched arm, one by one, as a loop of one's own gets them."""
    s = three_touches(robot).samples
    return zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True)


def test_no_example_is_left_out():
    found = {}
    for path in sorted(DOCS.rglob("*.md")):
        page = str(path.relative_to(DOCS))
        if page in IN_ORDER or page.startswith("reference/"):
            continue
        for language, _ in BLOCK.findall(path.read_text()):
            if language != "text" and (page, language) != ("reaction.md", "python"):
                found[page, language] = found.get((page, language), 0) + 1
    assert found == HERE


@pytest.mark.parametrize("page", ["detection.md", "interface.md", "reaction.md"])
def test_keys_of_a_description_are_accepted(page, tmp_path):
    keys = yaml.safe_load(blocks(page, "yaml")[0])
    robot = tl.load_robot(described(tmp_path, page))
    if page == "detection.md":
        told = robot.description.detection
        assert list(told.method) == keys["detection"]["method"]
        assert told.false_alarms == keys["detection"]["false_alarms"]
    elif page == "interface.md":
        assert list(tl.Touch(robot).widgets) == list(keys["interface"])
    else:
        assert len(robot.description.policy.rules) == len(keys["policy"]["rules"])


def test_the_loops_of_the_interface_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    described(tmp_path, "interface.md")
    samples = list(rows(tl.load_robot("sara")))
    loop, reading = blocks("interface.md", "python")
    known = {"samples": samples}
    exec(compile(loop, "interface.md", "exec"), known)
    assert {"start", "lamp", "speed", "page"} <= set(known["touch"].widgets)

    t = np.linspace(0.0, 1.0, 40)
    ways = {"1": np.c_[0 * t, -t], "7": np.r_[np.c_[t, 0 * t], np.c_[1 - 0.4 * t, -t]]}
    seven = Stroke("page", "link3", np.c_[np.linspace(0, 1, 80), 0.05 * ways["7"]], np.ones(80))
    touch = SimpleNamespace(strokes=[seven])
    known = {"tl": tl, "touch": touch, "strokes": list(ways.values()), "labels": list(ways)}
    exec(compile(reading, "interface.md", "exec"), known)
    assert known["recognizer"].read(seven.cleaned())[0][0] == "7"


def test_the_loops_of_the_live_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = described(tmp_path)
    assert main(["simulate", "three_touches", "--out", "run.parquet", "--rate", "500"]) == 0
    connected, own = blocks("live.md", "python")
    known = {}
    replayed = connected.replace("ur://192.168.1.10", "replay://run.parquet?speed=0")
    assert replayed != connected
    exec(compile(replayed, "live.md", "exec"), known)
    assert known["pipeline"].events

    # The states' names are those of franky and ur-rtde: tests/live reads real ones.
    panda, ur = own.splitlines()
    zeros = np.zeros(7)
    franka = SimpleNamespace(time=1.0, q=zeros, dq=zeros, tau_J=zeros)
    robot = tl.load_robot(path)
    monkeypatch.setattr(tl.live, "from_ur_rtde", tl.live.from_franka)
    for line in (panda, ur):
        known = {"tl": tl, "robot": robot, "pipeline": tl.Pipeline(robot)}
        known |= {"arm": SimpleNamespace(state=franka), "receive": franka}
        exec(compile(line, "live.md", "exec"), known)
        assert known["result"].time == franka.time


def test_the_commands_of_the_live_page(tmp_path, monkeypatch, capsys):
    """Where no robot answers, that is said; nothing is installed and no node is started."""
    monkeypatch.chdir(tmp_path)
    described(tmp_path)
    simulated = ["live", "--robot", "sara", "--source", "sim://", "--duration", "2.5"]
    assert main([*simulated, "--record", "run.mcap"]) == 0
    live, node, export = blocks("live.md", "sh")
    for line in live.splitlines():
        program, *arguments = shlex.split(line, comments=True)
        assert program == "touchline"
        source = arguments[-1]
        reachable = not source.startswith(("ros2", "ur", "franka"))
        arguments[-1] = re.sub(r"//[\d.]+$", f"//{NOWHERE}", source)
        if reachable:
            assert main([*arguments, "--duration", "1.5"]) == 0, line
        elif not source.startswith("ros2"):
            capsys.readouterr()
            assert main(arguments) == 2, line
            assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert [shlex.split(line)[0] for line in node.splitlines()] == ["pip", "touchline", "python"]
    assert main(shlex.split(export.splitlines()[0])[1:]) == 0
    assert (tmp_path / "robot.touchline").exists()


def test_the_broadcasters_parameters_are_those_it_declares():
    keys = yaml.safe_load(blocks("live.md", "yaml")[0])
    declared = set(re.findall(r'auto_declare<[^(]*>\("(\w+)"', BROADCASTER.read_text()))
    assert set(keys["touch"]["ros__parameters"]) <= declared
    assert (
        keys["controller_manager"]["ros__parameters"]["touch"]["type"]
        in (REPOSITORY / "ros" / "touchline_broadcaster" / "touchline_broadcaster.xml").read_text()
    )


def run_here(block, folder, monkeypatch, *logs):
    monkeypatch.chdir(folder)
    (folder / "runs").mkdir()
    for name in logs:
        assert main(["simulate", "three_touches", "--out", name]) == 0
    assert main(shlex.split(block)[1:]) == 0


def test_many_recordings(tmp_path, monkeypatch):
    many, _ = blocks("howto/many.md", "sh")
    run_here(many, tmp_path, monkeypatch, "runs/a.parquet", "runs/b.parquet")
    assert (tmp_path / "results" / "fleet.html").exists()


def test_one_recording_in_other_viewers(tmp_path, monkeypatch):
    for module, package in (("rerun", "rerun-sdk"), ("foxglove", "foxglove-sdk")):
        pytest.importorskip(module, reason=f"{package} is not installed")
    _, one = blocks("howto/many.md", "sh")
    run_here(one, tmp_path, monkeypatch, "run.parquet")
    assert (tmp_path / "run.rrd").exists() and (tmp_path / "run.mcap").exists()


def test_lines_of_cpp_and_cmake_stand_in_programs_that_are_built():
    (cmake,) = blocks("architecture.md", "cmake")
    built = (
        EXTERNAL.read_text().replace("touchline 0.1", "touchline").replace("external", "controller")
    )
    for line in cmake.splitlines():
        assert line.split("#")[0].strip() in built
    (cpp,) = blocks("architecture.md", "cpp")
    example = (REPOSITORY / "core" / "example" / "replay.cpp").read_text()
    assert "touchline::RedundantPipeline" in cpp and "touchline::RedundantPipeline" in example
    assert "touchline::read_robot(" in cpp and "touchline::read_robot(" in example
    assert "pipeline.update({time, q, qd, tau, wrench})" in cpp
    assert "pipeline.update({time, q, qd, tau, tau + n})" in example  # wrenches follow the torques
