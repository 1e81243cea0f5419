# SPDX-License-Identifier: Apache-2.0
"""Exported robots: read back as they were, and refused with a clear line where they are damaged."""

import os
import subprocess
import sys

import pytest
from program import COMPILER, SANITIZED
from robots import load_example

import touchline as tl
from touchline.cli import main
from touchline.native import core


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    path = tmp_path_factory.mktemp("exported") / "sara.touchline"
    assert main(["export", "sara", "--out", str(path)]) == 0
    return path


def test_what_is_read_is_what_was_written(exported):
    robot = core.read_robot(str(exported))
    assert robot.to_bytes() == exported.read_bytes()
    assert tuple(robot.joint_names) == tl.load_robot("sara").joint_names
    assert len(robot.surfaces) == len(robot.links) > 5
    assert len(robot.stand_ins) == 7  # after losses of any of its three sensors


def refused(path, content):
    path.write_bytes(content)
    with pytest.raises(ValueError, match="bad.touchline: ") as told:
        core.read_robot(str(path))
    return str(told.value)


def test_files_that_are_none_are_refused(exported, tmp_path):
    good, path = exported.read_bytes(), tmp_path / "bad.touchline"
    assert "no exported robot" in refused(path, b"")
    assert "no exported robot" in refused(path, b"PK\x03\x04" + good[4:])
    assert "ends too soon" in refused(path, good[:20])
    assert "truncated: " in refused(path, good[:-1])
    assert "goes on after its end" in refused(path, good + b"\0")
    later = good[:8] + (99).to_bytes(4, "little") + good[12:]
    assert "it has format 99" in refused(path, later)
    flipped = bytearray(good)
    flipped[len(good) // 2] ^= 1
    assert "checksum differs" in refused(path, bytes(flipped))
    with pytest.raises(ValueError, match="cannot be read"):
        core.read_robot(str(tmp_path / "none.touchline"))


def test_export_tells_what_it_cannot_do(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert main(["export", "sara", "--out", str(tmp_path / "file" / "sara.touchline")]) == 2
    assert main(["export", "sara", "--out", str(tmp_path / "a"), "--period", "0"]) == 2
    assert main(["export", "nobody", "--out", str(tmp_path / "a")]) == 2
    for line in capsys.readouterr().err.splitlines():
        assert line.startswith("touchline: ")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_export_replaces_an_exported_robot_and_nothing_else(tmp_path, capsys):
    out, described = tmp_path / "sara.touchline", tmp_path / "robot.yaml"
    described.write_text("name: mine\n")
    for _ in range(2):
        assert main(["export", "sara", "--out", str(out)]) == 0
    assert main(["export", "sara", "--out", str(described)]) == 2
    assert "robot.yaml: exists and is no exported robot" in capsys.readouterr().err
    assert described.read_text() == "name: mine\n"


def test_export_makes_the_folder_of_its_file(tmp_path):
    out = tmp_path / "new" / "sara.touchline"
    assert main(["export", "sara", "--out", str(out)]) == 0
    assert out.stat().st_size > 1000


@pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")
def test_no_damage_goes_unnoticed_or_breaks_the_reader(exported, run_whole):
    lines = run_whole("robot_file", SANITIZED, exported)
    outcomes = dict(reversed(line.split(maxsplit=1)) for line in lines)
    counts = {what: int(count) for what, count in outcomes.items()}
    assert sum(counts.values()) > 1500
    assert counts["it is damaged: its check"] > 200
    assert sum(n for what, n in counts.items() if what.startswith("it is truncated")) > 200
    assert sum(n for what, n in counts.items() if what.startswith("robot: ")) > 50


@pytest.mark.parametrize("name", ["sara", "panda_no_hand", "ur10e"])
def test_no_kernel_of_linear_algebra_shows_in_what_the_core_knows(name, tmp_path):
    """Of places that explain alike the last digit of a robot chooses: it is the same everywhere."""
    robot = name if name == "sara" else str(load_example(name).description.path)
    written = []
    for kernel in ({}, {"OPENBLAS_CORETYPE": "Prescott"}):  # the processor's own; no fused sums
        path = tmp_path / f"{len(written)}.touchline"
        command = [sys.executable, "-m", "touchline", "export", robot, "--out", str(path)]
        subprocess.run(command, env={**os.environ, **kernel}, capture_output=True, check=True)
        written.append(path.read_bytes())
    assert written[0] == written[1]
