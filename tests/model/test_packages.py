# SPDX-License-Identifier: Apache-2.0
import subprocess
import sys
from pathlib import Path

import pytest

from touchline.model import packages
from touchline.model.packages import PackageMissingError, package_folder, resolve


@pytest.fixture
def tree(tmp_path):
    """first/pkg/x, second/x, share/pkg/x and pkg/urdf below one folder."""
    for place in ("first/pkg", "second", "third/pkg", "prefix/share/pkg", "pkg/urdf"):
        (tmp_path / place).mkdir(parents=True)
    return tmp_path


def touch(path):
    path.write_text("x")
    return path


def test_package_dirs_in_order(tree):
    inside = touch(tree / "first/pkg/x")
    direct = touch(tree / "second/x")
    assert resolve("package://pkg/x", tree, [tree / "first", tree / "second"]) == inside
    assert resolve("package://pkg/x", tree, [tree / "second", tree / "first"]) == direct
    assert resolve("package://pkg/x", tree, [tree / "third", tree / "second"]) == direct
    touch(tree / "first/x")
    assert resolve("package://pkg/x", tree, [tree / "first"]) == inside


def test_a_package_around_the_model(tree):
    found = touch(tree / "pkg/x")
    assert resolve("package://pkg/x", tree / "pkg/urdf") == found


@pytest.mark.parametrize(
    ("variable", "value"), [("AMENT_PREFIX_PATH", "prefix"), ("ROS_PACKAGE_PATH", "prefix/share")]
)
def test_an_installed_package(tree, monkeypatch, variable, value):
    found = touch(tree / "prefix/share/pkg/x")
    monkeypatch.setenv(variable, str(tree / value))
    assert resolve("package://pkg/x", tree) == found


def test_paths(tree):
    found = touch(tree / "second/x y")
    assert resolve("second/x y", tree) == found
    assert resolve(str(found), tree / "first") == found
    assert resolve(f"file://{tree}/second/x%20y", tree / "first") == found


def test_what_is_missing_is_said(tree):
    with pytest.raises(
        PackageMissingError, match=r"^package 'nope' not found: install it, .*now: a"
    ):
        resolve("package://nope/x", tree, [tree.__class__("a")])
    with pytest.raises(FileNotFoundError, match=r"^package 'pkg' has no file 'y'$"):
        resolve("package://pkg/y", tree, [tree / "first"])


def test_the_data_package_is_named(tree, monkeypatch):
    monkeypatch.setattr(sys, "path", [])
    monkeypatch.setattr(sys, "prefix", str(tree))
    with pytest.raises(PackageMissingError, match="`pip install example-robot-data`"):
        resolve("package://example-robot-data/x", tree)


def test_shipped_robots(tree, monkeypatch):
    for name in ("sara", "other"):
        (tree / "robots" / name).mkdir(parents=True)
    model = touch(tree / "robots/sara/sara.xml")
    touch(tree / "robots/other/notes.txt")
    monkeypatch.setattr(packages, "ROBOTS", tree / "robots")
    assert packages.resolve_robot("sara") == model
    with pytest.raises(FileNotFoundError, match="no robot 'saar' ships with.*there are: sara"):
        packages.resolve_robot("saar")


def test_models_are_found_without_pinocchio():
    """The data package is only looked at: nothing of it is imported."""
    code = """
import sys
from pathlib import Path
from touchline.model.packages import resolve
try:
    resolve("package://example-robot-data/robots/panda_description/urdf/panda.urdf", Path())
except FileNotFoundError:
    print("absent")
heavy = {"pinocchio", "mujoco", "trimesh", "scipy", "example_robot_data"} & set(sys.modules)
sys.exit(f"imported: {heavy}" if heavy else 0)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_folder_is_absolute_where_package_dirs_is_not(tmp_path, monkeypatch):
    """Else xacro would look for it from the including file's folder."""
    (tmp_path / "ws" / "arm").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    found = package_folder("arm", Path("ws/arm/urdf"), [Path("ws")])
    assert found == tmp_path / "ws" / "arm"
